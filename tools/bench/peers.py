"""The peers: ASTRA on CPU and GPU, silx, gratopy and scikit-image, and ours in the latter's place.

Conventions, found by comparison with exact sinograms: ASTRA and silx let y grow upwards, which
turns the sign of the angles; gratopy's detector runs the other way as well; scikit-image has its
rotation axis at pixel and bin n // 2, so it gets a sinogram of the head half a pixel off.
Peers are imported when they are asked for, by name: none of them is needed otherwise.
"""

from __future__ import annotations

from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np

import rift_cl as rift
from bench.case import Case, Floats
from bench.contender import LeftOutError, TomographyContender
from rift_cl import phantom


class Astra(TomographyContender):
    """ASTRA's CPU algorithms, which use one thread."""

    place = "CPU"
    projector: ClassVar[str]
    ending: ClassVar[str] = ""

    def __init__(self, device: rift.Device, case: Case) -> None:
        super().__init__(device, case)
        self._astra = import_module("astra")
        image = self._astra.create_vol_geom(case.n, case.n)
        views = self._astra.create_proj_geom("parallel", 1.0, case.bins, -case.angles)
        self._image = self._astra.data2d.create("-vol", image, 0)
        self._views = self._astra.data2d.create("-sino", views, 0)
        projector = self._astra.create_projector(self.projector, views, image)
        self._algorithms = {kind: self._algorithm(kind, projector) for kind in ("FP", "BP", "FBP")}

    def _algorithm(self, kind: str, projector: int) -> int:
        settings = self._astra.astra_dict(kind + self.ending)
        image = "VolumeDataId" if kind == "FP" else "ReconstructionDataId"
        settings |= {"ProjectorId": projector, "ProjectionDataId": self._views, image: self._image}
        if kind == "FBP":
            settings["option"] = {"FilterType": "ram-lak"}
        return int(self._astra.algorithm.create(settings))

    def _run(self, kind: str, given: int, array: Floats, wanted: int) -> Any:
        self._astra.data2d.store(given, array)
        self._astra.algorithm.run(self._algorithms[kind])
        return self._astra.data2d.get(wanted)

    def forward(self, image: Any) -> Any:
        """Project."""
        return self._run("FP", self._image, image, self._views)

    def backward(self, sinogram: Any) -> Any:
        """Backproject."""
        return self._run("BP", self._views, sinogram, self._image)

    def fbp(self, sinogram: Any) -> Any:
        """Reconstruct."""
        return self._run("FBP", self._views, sinogram, self._image)


class AstraLine(Astra):
    """Rays weighted by their length in a pixel."""

    name, projector = "ASTRA line", "line"


class AstraLinear(Astra):
    """Joseph's interpolation."""

    name, projector = "ASTRA linear", "linear"


class AstraStrip(Astra):
    """Rays as wide as a bin, weighted by area."""

    name, projector = "ASTRA strip", "strip"


class AstraGpu(Astra):
    """ASTRA's CUDA algorithms on NumPy arrays, which it copies to the GPU and back."""

    name, projector = "ASTRA, CUDA", "cuda"
    place = "GPU"
    ending = "_CUDA"
    repeats = 3

    def __init__(self, device: rift.Device, case: Case) -> None:
        if not import_module("astra").use_cuda():
            raise LeftOutError("ASTRA finds no CUDA device")
        super().__init__(device, case)


class AstraGpuTensors(TomographyContender):
    """ASTRA's CUDA projectors of volumes, on torch's tensors that stay on the GPU."""

    name = "ASTRA 3D, CUDA tensors"
    arrays = "device"
    place = "GPU"
    operations = ("forward", "backward")
    repeats = 3

    def __init__(self, device: rift.Device, case: Case) -> None:
        super().__init__(device, case)
        astra = import_module("astra")
        if not astra.use_cuda():
            raise LeftOutError("ASTRA finds no CUDA device")
        self._torch = import_module("torch")
        self._direct = import_module("astra.experimental")
        volume = astra.create_vol_geom(case.n, case.n, case.slices)
        views = astra.create_proj_geom("parallel3d", 1.0, 1.0, case.slices, case.bins, case.angles)
        self._projector = astra.create_projector("cuda3d", views, volume)
        self._image = self._torch.zeros((case.slices, case.n, case.n), device="cuda")
        self._views = self._torch.zeros((case.slices, case.views, case.bins), device="cuda")

    def enter(self, array: Floats) -> Any:
        """Copy to the GPU; its projections are (slice, view, bin), of one slice too."""
        slices, views, bins = self._views.shape
        if array.shape[-1] == bins:
            array = array.reshape(views, slices, bins).swapaxes(0, 1)
        tensor = self._torch.from_numpy(np.ascontiguousarray(array)).cuda()
        return tensor.reshape(slices, *tensor.shape[-2:])

    def leave(self, array: Any) -> Floats:
        """Copy to the host, without the axis of a single slice."""
        found: Floats = array.cpu().numpy()
        if self.case.slices == 1:
            return found[0]
        return found.swapaxes(0, 1) if found.shape[-1] == self.case.bins else found

    def forward(self, image: Any) -> Any:
        """Project and wait for the result."""
        self._direct.direct_FP3D(self._projector, image, self._views)
        self._torch.cuda.synchronize()
        return self._views

    def backward(self, sinogram: Any) -> Any:
        """Backproject and wait for the result."""
        self._direct.direct_BP3D(self._projector, self._image, sinogram)
        self._torch.cuda.synchronize()
        return self._image


class Silx(TomographyContender):
    """silx.opencl on the same device; its filter uses NumPy's FFT where gpyfft is missing."""

    name = "silx"

    def __init__(self, device: rift.Device, case: Case) -> None:
        super().__init__(device, case)
        projection = import_module("silx.opencl.projection")
        backprojection = import_module("silx.opencl.backprojection")
        middle, offset = (case.bins - 1) / 2, (case.bins - case.n) / 2
        self._project = projection.Projection(
            (case.n, case.n),
            angles=-case.angles,
            detector_width=case.bins,
            axis_position=middle,
            ctx=device.context,
        ).projection
        self._back = backprojection.Backprojection(
            (case.views, case.bins),
            slice_shape=(case.n, case.n),
            angles=-case.angles,
            ctx=device.context,
            extra_options={"gpu_offset_x": offset, "gpu_offset_y": offset},
        )

    def forward(self, image: Any) -> Any:
        """Project."""
        return self._project(image)

    def backward(self, sinogram: Any) -> Any:
        """Backproject."""
        return self._back.backprojection(sinogram)

    def fbp(self, sinogram: Any) -> Any:
        """Reconstruct."""
        return self._back.filtered_backprojection(sinogram)


class Gratopy(TomographyContender):
    """Gratopy on the same device, arrays on the device; it has no filters."""

    name = "gratopy"
    arrays = "device"
    operations = ("forward", "backward")

    def __init__(self, device: rift.Device, case: Case) -> None:
        super().__init__(device, case)
        self._gratopy = import_module("gratopy")
        self._settings = self._gratopy.ProjectionSettings(
            device.queue,
            self._gratopy.RADON,
            (case.n, case.n),
            np.pi - case.angles,
            case.bins,
            image_width=float(case.n),
            detector_width=float(case.bins),
            angle_weights=1.0,
        )

    def enter(self, array: Floats) -> Any:
        """Copy to the device; its sinograms are (bin, angle)."""
        turned = array.T if array.shape == self.case.sinogram.shape else array
        return self.device.array(turned)

    def leave(self, array: Any) -> Floats:
        """Copy to the host."""
        values: Floats = array.get()
        return values.T if values.shape == self.case.sinogram.T.shape else values

    def forward(self, image: Any) -> Any:
        """Project and wait for the result."""
        result = self._gratopy.forwardprojection(image, self._settings)
        self.device.finish()
        return result

    def backward(self, sinogram: Any) -> Any:
        """Backproject and wait for the result."""
        result = self._gratopy.backprojection(sinogram, self._settings)
        self.device.finish()
        return result


class ScikitImage(TomographyContender):
    """scikit-image, on the CPU; ``radon`` sees the disc alone, with n bins."""

    name = "scikit-image"
    place = "CPU"
    module: ClassVar[str] = "skimage.transform"

    def __init__(self, device: rift.Device, case: Case) -> None:
        super().__init__(device, case)
        self._transform = import_module(self.module)
        self._degrees = -np.rad2deg(case.angles)

    @cached_property
    def sinogram(self) -> Floats:
        """The exact sinogram with the axis at pixel n // 2 and bin bins // 2."""
        n = self.case.n
        grid = rift.Grid((n, n), center=(n - 1) / 2 - n // 2)
        scan = rift.Parallel(self.case.angles, self.case.bins, center=self.case.bins // 2)
        return phantom.shepp_logan_sinogram(grid, scan)

    def forward(self, image: Any) -> Any:
        """Project, and add the bins that see nothing."""
        views = self._transform.radon(image, self._degrees, circle=True).T
        before = self.case.bins // 2 - self.case.n // 2
        return np.pad(views, ((0, 0), (before, self.case.bins - self.case.n - before)))

    def backward(self, sinogram: Any) -> Any:
        """Backproject."""
        return self._inverse(sinogram, None)

    def fbp(self, sinogram: Any) -> Any:
        """Reconstruct."""
        return self._inverse(sinogram, "ramp")

    def _inverse(self, sinogram: Floats, name: str | None) -> Any:
        size = self.case.n
        settings = {"output_size": size, "filter_name": name, "circle": False}
        return self._transform.iradon(sinogram.T, self._degrees, **settings)


class RiftAsScikitImage(ScikitImage):
    """Ours under scikit-image's names, NumPy in and out; it knows the default device alone."""

    name = "rift_cl, as scikit-image"
    place = ""
    module = "rift_cl.interop.skimage"
    ours = True
    repeats = 3

    def __init__(self, device: rift.Device, case: Case) -> None:
        if find_spec("skimage") is None:
            raise LeftOutError("scikit-image is not installed")
        if device.selector != rift.default_device().selector:
            raise LeftOutError("it works on the device that RIFT_DEVICE selects, not on this one")
        super().__init__(device, case)


PEERS: tuple[type[TomographyContender], ...] = (
    AstraLine,
    AstraLinear,
    AstraStrip,
    AstraGpu,
    AstraGpuTensors,
    Silx,
    Gratopy,
    ScikitImage,
    RiftAsScikitImage,
)
# Those that take stacks.
STACK_PEERS: tuple[type[TomographyContender], ...] = (AstraGpuTensors,)
