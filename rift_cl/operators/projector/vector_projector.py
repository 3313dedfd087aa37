"""Line integrals for any places of source and flat detector, and their exact adjoint.

Forward: volume -> views of upright detectors, by slab tables -> those of the tilted ones, by
interpolation at the places where their rays meet. Adjoint: the same steps transposed, in reverse,
with the same numbers. Views that look along z rather than across see the volume with y and z
exchanged, so that their slabs lie across z.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.cl.host_arrays import download
from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Grid, Vectors
from rift_cl.operators.projector.projector import Projector
from rift_cl.operators.projector.rectification import Rectification
from rift_cl.operators.projector.slab_projector import SlabProjector
from rift_cl.operators.projector.upright import (
    Rectified,
    looking_along_z,
    pixel_slopes,
    rectified,
)


class VectorProjector(Projector):
    """Line integrals of a volume along the rays of a ``Vectors`` scan.

    Args:
        grid: the grid of the volume, (nz, ny, nx).
        scan: places of source and detector, view by view.
        footprint: how a sample's shadow is shared among the bins of the upright detector,
            ``strip`` (the default) or ``linear``; see ``SlabProjector``.
        device: the device to use; the default device if not given.
        dtype: ``float32``, or ``float64`` where the device has it.

    The domain is ``grid.shape``; the range is (views, rows, bins). Besides volume and data the
    views of all upright detectors are held in the device's memory.

    Raises:
        InputError: the grid is no volume, the footprint or the type is unknown, a source stands in
            the volume or far beside its detector, rays of a view are more than some 85 degrees
            apart, or bins and samples are of very different sizes.
        DeviceError: the device has no float64.
    """

    scan: Vectors

    def __init__(
        self,
        grid: Grid,
        scan: Vectors,
        footprint: str = "strip",
        device: Device | None = None,
        dtype: DTypeLike = np.float32,
    ) -> None:
        if not isinstance(grid, Grid) or len(grid.shape) != 3:
            raise InputError(
                f"grid is {grid!r:.60}, wanted a volume such as Grid((256, 256, 256)): the rays of "
                "Vectors run through one"
            )
        shape = scan.views, scan.rows, scan.bins
        super().__init__(grid.shape, shape, device or default_device(), dtype)
        self.grid, self.scan, self.footprint = grid, scan, footprint
        along_z = looking_along_z(scan)
        self._parts = [
            _Part(self, rectified(grid, scan, along_z=way))
            for way in (False, True)
            if (along_z == way).any()
        ]

    def __reduce__(self) -> tuple[Any, ...]:
        return VectorProjector, (self.grid, self.scan, self.footprint, self.device, self.dtype)

    def _facts(self) -> list[str]:
        scan = self.scan
        return [
            f"grid {' x '.join(map(str, self.grid.shape))}",
            f"{scan.views} views of {scan.rows} x {scan.bins} bins, placed by vectors",
            f"footprint {self.footprint}",
        ]

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        for part in self._parts:
            upright = self.device.empty(part.projector.range, self.dtype)
            part.projector._apply(part.seen(x), upright)
            part.rectification.read(upright, out, 0, part.count)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        for number, part in enumerate(self._parts):
            upright = self.device.empty(part.projector.range, self.dtype)
            part.rectification.spread(y, upright, 0, part.count)
            volume = out if number == 0 else self.device.empty(self.domain, self.dtype)
            part.backproject(upright, volume)
            if number > 0:
                axpby(self.device, 1.0, volume, 1.0, out)

    def slopes(self, x: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How ``A(x)`` changes as each pixel moves, the source staying where it is.

        Args:
            x: the volume.

        Returns:
            The data, and their derivatives by the pixel's place, (3, views, rows, bins), in the
            order (x, y, z).
        """
        volume = self.device.array(x, self.dtype)
        data = np.zeros(self.range)
        slopes = np.zeros((3, *self.range))
        for part in self._parts:
            upright = self.device.empty(part.projector.range, self.dtype)
            part.projector._apply(part.seen(volume), upright)
            read = []
            for slope in range(3):
                out = self.device.empty(self.range, self.dtype)
                part.rectification.read(upright, out, 0, part.count, slope)
                host = download(self.device, out)
                read.append(host[part.found.views].astype(np.float64))
            data[part.found.views] = read[0]
            slopes[:, part.found.views] = pixel_slopes(self.scan, part.found, read[1], read[2])
        return data, slopes

    @property
    def scratch(self) -> int:
        """Bytes needed besides the arrays that go in and come out."""
        volume = self.dtype.itemsize * self.shape[1]
        return max(part.scratch for part in self._parts) + 2 * volume


class _Part:
    """Views that look alike: the projector of their upright detectors, and the way from these."""

    def __init__(self, owner: VectorProjector, found: Rectified) -> None:
        self._owner, self.found = owner, found
        self._exchanged = found.along_z
        self.count = len(found.views)
        self.projector = SlabProjector(
            found.grid, cast(Cone, found.upright), owner.footprint, owner.device, owner.dtype
        )

    @cached_property
    def rectification(self) -> Rectification:
        owner, found = self._owner, self.found
        tilted = owner.scan.rows, owner.scan.bins
        upright = found.upright.rows, found.upright.bins
        return Rectification(owner.device, tilted, upright, found.views, found.forms, owner.dtype)

    def seen(self, volume: DeviceArray) -> DeviceArray:
        """The volume as these views see it, with y and z exchanged or as it is."""
        if not self._exchanged:
            return volume
        turned = self._owner.device.empty(self.projector.domain, volume.dtype)
        self._exchange(volume, turned, back=0)
        return turned

    def backproject(self, upright: DeviceArray, volume: DeviceArray) -> None:
        """Write what upright views give to the volume."""
        if not self._exchanged:
            self.projector._apply_adjoint(upright, volume)
            return
        turned = self._owner.device.empty(self.projector.domain, volume.dtype)
        self.projector._apply_adjoint(upright, turned)
        self._exchange(volume, turned, back=1)

    def _exchange(self, volume: DeviceArray, turned: DeviceArray, *, back: int) -> None:
        device = self._owner.device
        nz, ny, nx = self._owner.domain
        tile = 16 if device.traits.is_cpu else 1
        device.launch(
            "volume_turn",
            (-(-nz // tile), -(-nx // tile), ny),
            volume=volume,
            slabs=turned,
            lines=nz,
            depth=nx,
            padded_depth=nx,
            volume_i=nx,
            volume_j=ny * nx,
            volume_k=1,
            slab_stride=nz * nx,
            line_stride=nx,
            TILE=tile,
            BACK=back,
            DOUBLE=int(volume.dtype == np.float64),
        )

    @property
    def scratch(self) -> int:
        """Bytes of its upright views and of what their projector needs."""
        item = self._owner.dtype.itemsize
        return self.projector.scratch + item * self.projector.shape[0] + self.rectification.nbytes
