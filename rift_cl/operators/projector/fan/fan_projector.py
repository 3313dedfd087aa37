"""The X-ray transform of one slice through a fan, and its exact adjoint.

Forward: image -> padded planes (by rows, by columns) -> bins, each of which gathers the pixels that
its rays cross. Adjoint: views -> records of their rays -> pixels, each of which gathers the bins
that it is seen in. Both evaluate the same weights (``kernels/include/tomo/fan_footprint.h``);
``rift_cl/reference/fan.py`` has them as a matrix.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.errors import InputError
from rift_cl.geometry import Fan, Grid
from rift_cl.operators.projector.fan.fan_rays import FanRays, fan_rays
from rift_cl.operators.projector.footprint import FOOTPRINTS, check_depth_power, check_footprint
from rift_cl.operators.projector.projector import Projector

# Records of a run of views together: on a CPU they should stay in its caches.
_RECORD_BYTES = {"cpu": 1 << 20, "gpu": 64 << 20}
_RECORD = 4
# Pixels that a kernel reads at once.
_QUAD = 4
# Vectors of edges that an item of ``fan_project`` has.
_EDGE_VECTORS = {"cpu": 8, "gpu": 2}


class FanProjector(Projector):
    """Line integrals of an image along the rays of a fan.

    A bin's value is the mean over its width, in the image's unit times the grid's unit of length.
    Rays run through the whole grid, whether the detector stands behind it or not.

    Args:
        grid: the grid of the image, (ny, nx).
        scan: angles, source and detector, flat or curved.
        footprint: the projection of a pixel onto the detector. ``strip``: the area that the pixel
            shares with the strip between the rays to a bin's two edges; every view holds the whole
            mass. ``joseph``: rays to the bins' centres interpolate linearly between the pixels of
            each row or column that they cross; where bins are wider than samples they miss what
            lies between. ``linear``: the same, the hat widened to the bin where that is wider.
        device: the device to use; the default device if not given.
        dtype: ``float32``, or ``float64`` where the device has it.
        depth_power: 1 for line integrals. 2 multiplies what a pixel leaves, in both halves, by
            ``source_to_axis`` over its distance from the source along the ray through the axis
            (curved: along its own ray), which makes the adjoint the backprojection of filtered
            fan beams.

    Raises:
        InputError: the grid is a volume, the footprint is unknown, or a source stands in the grid.
        DeviceError: the device has no float64.
    """

    scan: Fan
    _settled = ("depth_power",)

    def __init__(
        self,
        grid: Grid,
        scan: Fan,
        footprint: str = "strip",
        device: Device | None = None,
        dtype: DTypeLike = np.float32,
        *,
        depth_power: int = 1,
    ) -> None:
        if not isinstance(grid, Grid) or not isinstance(scan, Fan):
            raise InputError(f"wanted a Grid and a Fan, got {grid!r:.60} and {scan!r:.60}")
        if len(grid.shape) != 2:
            raise InputError(f"grid has shape {grid.shape}, wanted that of one slice, (ny, nx)")
        super().__init__(grid.shape, (scan.views, scan.bins), device or default_device(), dtype)
        self.grid, self.scan, self.depth_power = grid, scan, check_depth_power(depth_power)
        self.footprint = check_footprint(footprint)
        self._rays = fan_rays(grid, scan, footprint, self.depth_power)
        self._precision = {"DOUBLE": int(self.dtype == np.float64)}
        self._macros = {
            "FOOTPRINT": FOOTPRINTS.index(footprint),
            "POWER": self.depth_power,
            **self._precision,
        }

    def _facts(self) -> list[str]:
        scan = self.scan
        return [
            f"grid {' x '.join(map(str, self.grid.shape))}",
            f"{scan.views} fan views of {scan.bins} bins",
            f"magnification {scan.magnification:g}",
            f"footprint {self.footprint}",
        ]

    @cached_property
    def _walks(self) -> tuple[_Walk, _Walk]:
        along_y, along_x = self._rays
        device, dtype = self.device, self.dtype
        return _Walk(device, along_y, dtype), _Walk(device, along_x, dtype)

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        for transpose, walk in enumerate(self._walks):
            if not walk.count:
                continue
            slabs, lines = self.grid.shape if not transpose else self.grid.shape[::-1]
            margin = walk.rays.pixels + _QUAD
            plane = self._split(x, slabs, lines, margin, transpose)
            self.device.launch(
                "fan_project",
                (-(-self.scan.bins // self._item_bins), walk.count),
                sinogram=out,
                plane=plane,
                **walk.arrays,
                **self._sizes(walk),
                slabs=slabs,
                lines=lines,
                margin=margin,
                **self._macros,
            )

    @property
    def _item_bins(self) -> int:
        """Bins that an item of ``fan_project`` owns; of strips, edges are one more."""
        lanes = self.device.traits.macros["LANES"]
        if self.footprint != "strip":
            return int(lanes)
        return _EDGE_VECTORS["cpu" if self.device.traits.is_cpu else "gpu"] * int(lanes) - 1

    def _split(
        self, image: DeviceArray, slabs: int, lines: int, margin: int, transpose: int
    ) -> DeviceArray:
        plane = self.device.zeros((slabs, lines + 2 * margin), self.dtype)
        tile = 16 if self.device.traits.is_cpu else 1
        self.device.launch(
            "plane_split",
            (-(-lines // tile), -(-slabs // tile), 1),
            image=image,
            plane=plane,
            slice0=0,
            rows=slabs,
            width=lines,
            margin=margin,
            TRANSPOSE=transpose,
            **self._precision,
        )
        return plane

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        height, width = self.grid.shape
        cpu, lanes = self.device.traits.is_cpu, self.device.traits.macros["LANES"]
        rows, run = (16, 64) if cpu else (1, 1)
        add = 0
        for walk in self._walks:
            for first, count in self._runs(walk):
                records = self.device.empty((count, walk.stride, _RECORD), self.dtype)
                self.device.launch(
                    "fan_records",
                    (-(-walk.stride // run), count),
                    records=records,
                    sinogram=y,
                    **walk.arrays,
                    **self._sizes(walk),
                    first=first,
                    RUN=run,
                    **self._macros,
                )
                self.device.launch(
                    "fan_backproject",
                    (-(-width // lanes), -(-height // rows)),
                    image=out,
                    records=records,
                    numbers=walk.arrays["numbers"],
                    first=first,
                    count=count,
                    **self._sizes(walk),
                    height=height,
                    width=width,
                    add=add,
                    CURVED=int(self.scan.curved),
                    ROWS=rows,
                    **self._macros,
                )
                add = 1

    def _sizes(self, walk: _Walk) -> dict[str, int]:
        return {"bins": self.scan.bins, "stride": walk.stride}

    def _runs(self, walk: _Walk) -> Iterator[tuple[int, int]]:
        """First view and number of views whose records exist at the same time."""
        most = max(1, self._record_bytes // self._each(walk))
        for first in range(0, walk.count, most):
            yield first, min(most, walk.count - first)

    def _each(self, walk: _Walk) -> int:
        return int(_RECORD * walk.stride * self.dtype.itemsize)

    @property
    def _record_bytes(self) -> int:
        return _RECORD_BYTES["cpu" if self.device.traits.is_cpu else "gpu"]

    @property
    def scratch(self) -> int:
        """Bytes needed besides the arrays that go in and come out."""
        height, width = self.grid.shape
        margins = [2 * (rays.pixels + _QUAD) for rays in self._rays]
        planes = max(height * (width + margins[0]), width * (height + margins[1]))
        records = max(self._record_bytes, *(self._each(walk) for walk in self._walks))
        rays = sum(walk.nbytes for walk in self._walks)
        return self.dtype.itemsize * planes + records + rays


class _Walk:
    """The views that look along one axis, and the device's copy of their rays."""

    def __init__(self, device: Device, rays: FanRays, dtype: np.dtype[Any]) -> None:
        self.rays = rays
        self.count, self.stride = rays.starts.shape
        self.arrays = {
            "starts": device.array(rays.starts, dtype),
            "slopes": device.array(rays.slopes, dtype),
            "widths": device.array(rays.widths, dtype),
            "factors": device.array(rays.factors, dtype),
            "numbers": device.array(rays.numbers, dtype),
            "views": device.array(rays.views),
        }
        self.nbytes: int = sum(array.nbytes for array in self.arrays.values())
