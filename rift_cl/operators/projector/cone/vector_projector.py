"""Line integrals for any places of source and flat detector, and their exact adjoint.

Forward: volume -> views of upright detectors, by slab tables -> those of the tilted ones, by
interpolation at the places where their rays meet. Adjoint: the same steps transposed, in reverse,
with the same numbers. Views that look along z rather than across see the volume with y and z
exchanged, so that their slabs lie across z.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import download
from rift_cl.geometry import Cone, Grid, Vectors
from rift_cl.operators.projector.cone.rectification import Rectification
from rift_cl.operators.projector.cone.slab_projector import SlabProjector
from rift_cl.operators.projector.cone.upright import (
    Rectified,
    looking_along_z,
    pixel_slopes,
    rectified,
)
from rift_cl.operators.projector.volume_in_parts import VolumeInParts


class VectorProjector(VolumeInParts):
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
        super().__init__(grid, scan, device, dtype, rows=scan.rows)
        self.footprint = footprint
        along_z = looking_along_z(scan)
        self._parts = [
            _Part(self, rectified(grid, scan, along_z=way))
            for way in (False, True)
            if (along_z == way).any()
        ]

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
    def block(self) -> int:
        """Slices that are not cut between."""
        # Views that look along z walk from slice to slice.
        whole = any(part.exchanged for part in self._parts)
        return self.domain[0] if whole else super().block

    def _need(self, slices: int, views: int, *, sparing: bool) -> tuple[int, int]:
        item, of_a_slice = self.dtype.itemsize, math.prod(self.domain[1:])
        data = item * views * math.prod(self.range[1:])
        needs, arrays = zip(
            *(part.need(slices, views, sparing=sparing) for part in self._parts), strict=True
        )
        # The volume besides that of a part, which may be exchanged or one of two to be added.
        volumes = len(self._parts) if self.block == self.domain[0] else 0
        return data + volumes * item * slices * of_a_slice + max(needs), max(data, *arrays)

    def _part(self, z: slice, views: slice) -> VectorProjector:
        part = self._bare_part(z, views)
        part._parts = [each.of(part, z, views) for each in self._parts if each.count_in(views)]
        return part


class _Part:
    """Views that look alike: the projector of their upright detectors, and the way from these.

    Args:
        owner: the projector whose views they are.
        found: the views and their upright detectors.
        projector: that of the upright detectors; made if not given.
    """

    def __init__(
        self, owner: VectorProjector, found: Rectified, projector: SlabProjector | None = None
    ) -> None:
        # Not the owner, which would be kept in a circle of references with its arrays.
        self._device, self._dtype, self._domain = owner.device, owner.dtype, owner.domain
        self._tilted, self.found = (owner.scan.rows, owner.scan.bins), found
        self.exchanged = found.along_z
        self.count = len(found.views)
        self.projector = projector or SlabProjector(
            found.grid, cast(Cone, found.upright), owner.footprint, owner.device, owner.dtype
        )

    def _run(self, views: slice) -> slice:
        """Which of these views a run of the scan's holds."""
        first, stop = np.searchsorted(self.found.views, [views.start, views.stop])
        return slice(int(first), int(stop))

    def count_in(self, views: slice) -> int:
        """Number of these views in a run of the scan's."""
        run = self._run(views)
        return int(run.stop - run.start)

    def of(self, owner: VectorProjector, z: slice, views: slice) -> _Part:
        """A part's views and slices; all slices if these look along z."""
        run, found = self._run(views), self.found
        chosen = replace(
            found,
            views=(found.views[run] - views.start).astype(np.int32),
            upright=found.upright.subset(np.arange(run.start, run.stop)),
            forms=found.forms[run],
        )
        depth = slice(0, self.projector.domain[0]) if self.exchanged else z
        return _Part(owner, chosen, self.projector._part(depth, run))

    def need(self, slices: int, views: int, *, sparing: bool) -> tuple[int, int]:
        """Bytes of volume, upright views and records of a part, and of the largest array."""
        views = min(views, self.count)
        depth = self.projector.domain[0] if self.exchanged else slices
        need, array = self.projector._need(depth, views, sparing=sparing)
        return need + self.rectification.nbytes, array

    @cached_property
    def rectification(self) -> Rectification:
        found = self.found
        upright = found.upright.rows, found.upright.bins
        return Rectification(
            self._device, self._tilted, upright, found.views, found.forms, self._dtype
        )

    def seen(self, volume: DeviceArray) -> DeviceArray:
        """The volume as these views see it, with y and z exchanged or as it is."""
        if not self.exchanged:
            return volume
        turned = self._device.empty(self.projector.domain, volume.dtype)
        self._exchange(volume, turned, back=0)
        return turned

    def backproject(self, upright: DeviceArray, volume: DeviceArray) -> None:
        """Write what upright views give to the volume."""
        if not self.exchanged:
            self.projector._apply_adjoint(upright, volume)
            return
        turned = self._device.empty(self.projector.domain, volume.dtype)
        self.projector._apply_adjoint(upright, turned)
        self._exchange(volume, turned, back=1)

    def _exchange(self, volume: DeviceArray, turned: DeviceArray, *, back: int) -> None:
        device = self._device
        nz, ny, nx = self._domain
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
