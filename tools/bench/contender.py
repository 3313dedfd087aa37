"""What the benchmark compares: one interface for the peers and for ourselves.

What a contender must do to bring our arrays into its own conventions, and results back, happens
in ``prepared`` and ``leave``, which are not timed, unless its users would have to pay for it every
time. In tomography our conventions are an image (y, x) and a sinogram (angle, bin); we take stacks
as well.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Case, Floats
from rift_cl import metrics

# The adjoint test runs both directions twice more; beyond this many updates it would take minutes.
_ADJOINT_UPDATES = 1e9
# Noise must vanish where scikit-image, whose disc is half a pixel off, wants zeros.
_MARGIN = 2.0


def relative(found: Floats, exact: Floats) -> float:
    """The relative L2 distance."""
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


class LeftOutError(RuntimeError):
    """One of ours cannot take part here, though nothing is wrong with it."""


class Contender(ABC):
    """Some operations by one package, at one size.

    Args:
        device: the OpenCL device to use, if it uses one.
        case: the size.
    """

    name: str
    arrays = "NumPy"
    ours = False
    # "CPU" or "GPU" for who works there alone, whatever the OpenCL device is.
    place = ""
    operations: tuple[str, ...]
    # Runs of each operation in a round.
    repeats = 1

    def __init__(self, device: rift.Device, case: Any) -> None:
        self.device = device
        self.case = case

    @abstractmethod
    def prepared(self, operation: str) -> Callable[[], Any]:
        """A call that does an operation and nothing else, its inputs in place."""

    @classmethod
    def fits(cls, device: rift.Device) -> bool:
        """Whether it works on that kind of device: on a GPU no race with what the CPU does."""
        return cls.place in ("", "CPU" if device.traits.is_cpu else "GPU")

    def leave(self, array: Any) -> Floats:
        """Bring a result back."""
        return np.asarray(array)

    def rates(self, seconds: float) -> dict[str, float]:
        """How much is done in a second by an operation that takes so long."""
        return {}

    @abstractmethod
    def accuracy(self, outputs: Mapping[str, Floats], *, seed: int) -> dict[str, float | None]:
        """Scores of the last result of each operation."""


class TomographyContender(Contender):
    """Projection, backprojection and reconstruction."""

    case: Case
    operations: tuple[str, ...] = ("forward", "backward", "fbp")

    @property
    def sinogram(self) -> Floats:
        """The exact sinogram with the axis where this contender has it."""
        return self.case.projections

    def enter(self, array: Floats) -> Any:
        """Bring an array to where this contender wants it."""
        return array

    @abstractmethod
    def forward(self, image: Any) -> Any:
        """Project an image."""

    @abstractmethod
    def backward(self, sinogram: Any) -> Any:
        """Backproject a sinogram, without a filter."""

    def fbp(self, sinogram: Any) -> Any:
        """Reconstruct from a sinogram with the plain ramp."""
        raise NotImplementedError(f"{self.name} has no filtered backprojection")

    def prepared(self, operation: str) -> Callable[[], Any]:
        """The operation on the head, or on its sinogram."""
        array = self.enter(self.case.image if operation == "forward" else self.sinogram)
        run = getattr(self, operation)
        return lambda: run(array)

    def rates(self, seconds: float) -> dict[str, float]:
        """Updates per second."""
        return {"updates_per_s": self.case.updates / seconds}

    def accuracy(self, outputs: Mapping[str, Floats], *, seed: int) -> dict[str, float | None]:
        """Scores of the last results; of the first slice, since a stack's are all alike."""
        case, mask, found = self.case, self.case.disc(), outputs.get("fbp")
        image = None if found is None else found.reshape(-1, case.n, case.n)[0]
        test = case.slices == 1 and case.updates <= _ADJOINT_UPDATES
        return {
            "forward_error": relative(outputs["forward"], self.sinogram),
            "fbp_psnr_db": None if image is None else metrics.psnr(image, case.truth, mask=mask),
            "fbp_ssim": None if image is None else metrics.ssim(image, case.truth, mask=mask),
            "adjoint_mismatch": self._adjoint_mismatch(seed=seed) if test else None,
        }

    def _adjoint_mismatch(self, *, seed: int) -> float:
        """|<Ax, y> - s <x, A'y>| / (|Ax| |y|) for white noise x in the disc and y = Ax.

        Packages scale their backprojection differently, so the factor s is fitted first, on the
        phantom and its projection.
        """
        case = self.case
        image, views, back = self._there_and_back(case.truth)
        scale = np.sum(views**2) / np.sum(image * back)
        noise = np.random.default_rng(seed).standard_normal(case.truth.shape).astype(np.float32)
        image, views, back = self._there_and_back(noise * case.disc(margin=_MARGIN))
        energy = np.sum(views**2)
        return float(abs(energy - scale * np.sum(image * back)) / energy)

    def _there_and_back(self, image: Floats) -> tuple[Any, Any, Any]:
        views = np.array(self.leave(self.forward(self.enter(image))), dtype=np.float32)
        back = self.leave(self.backward(self.enter(views)))
        return image.astype(np.float64), views.astype(np.float64), back.astype(np.float64)


class RiftOnHost(TomographyContender):
    """Ours, NumPy in and out."""

    name = "rift_cl, NumPy"
    ours = True
    repeats = 3

    def __init__(self, device: rift.Device, case: Case) -> None:
        super().__init__(device, case)
        self.A = rift.Projector(case.grid, case.scan, device=device)

    def forward(self, image: Any) -> Any:
        """Project an image and wait for the result."""
        return self._waited(self.A(image))

    def backward(self, sinogram: Any) -> Any:
        """Backproject a sinogram and wait for the result."""
        return self._waited(self.A.T(sinogram))

    def fbp(self, sinogram: Any) -> Any:
        """Reconstruct, the design of the filter included, and wait for the result."""
        return self._waited(rift.fbp(self.A, sinogram))

    def _waited(self, result: Any) -> Any:
        self.device.finish()
        return result


class RiftOnDevice(RiftOnHost):
    """Ours, arrays on the device in and out."""

    name = "rift_cl, device"
    arrays = "device"

    def enter(self, array: Floats) -> Any:
        """Copy to the device."""
        return self.device.array(array)

    def leave(self, array: Any) -> Floats:
        """Copy to the host."""
        return np.asarray(self.device.get(array))
