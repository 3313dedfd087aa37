"""Line integrals of every slice of a volume along the rays of a fan, by slab tables.

Slices fill the lanes as the z of a cone's volume do; a table's rows are the slices themselves.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.device import Device
from rift_cl.geometry import Cone, Fan, Grid
from rift_cl.operators.projector.cone.slab_projector import SlabProjector
from rift_cl.operators.projector.cone.slab_table import Samples, SlabTable, fan_table

# Rows next to which a detector is far away: slices have no height on it.
_FLAT = 1e-12


class FanSlicesProjector(SlabProjector):
    """Line integrals of every slice of a volume along the rays of a ``Fan``.

    Args:
        grid: the grid of the volume, (nz, ny, nx).
        scan: source and detector.
        footprint: ``strip`` or ``linear``, as those of ``SlabProjector`` along the rows.
        device: the device to use; the default device if not given.
        dtype: ``float32``, or ``float64`` where the device has it.
        depth_power: of the inverse of the depth that a sample is weighted by: 1 gives line
            integrals, 2 multiplies by ``source_to_axis / depth`` again, as filtered backprojection
            wants it.

    The domain is ``grid.shape``; the range is (views, nz, bins).

    Raises:
        InputError: as ``SlabProjector``, or ``depth_power`` is neither 1 nor 2.
        DeviceError: the device has no float64.
    """

    scan: Any
    _footprints = ("strip", "linear")
    _table = staticmethod(fan_table)

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
        super().__init__(grid, cast(Any, scan), footprint, device, dtype, depth_power=depth_power)

    @staticmethod
    def _data_rows(scan: Any) -> int | None:
        return None

    @cached_property
    def _beam(self) -> Cone:
        scan = self.scan
        return Cone(
            scan.angles,
            self.grid.slices,
            scan.bins,
            (_FLAT * scan.pitch, scan.pitch),
            scan.source_to_axis,
            scan.source_to_detector,
            (0, scan.center),
            curved=scan.curved,
        )

    @cached_property
    def _column(self) -> Samples:
        return Samples(self.grid.slices, 0.0, 1.0)

    def _part(self, z: slice, views: slice) -> FanSlicesProjector:
        part = cast(FanSlicesProjector, super()._part(z, views))
        # Slices are counted from the part's first, as its rows are.
        part._column = Samples(part.grid.slices, 0.0, 1.0)
        return part

    def _rows(self, slices: int) -> int:
        return slices

    def _lower(self, table: SlabTable, slices: int) -> SlabTable:
        return replace(table, rows=slices + 2 * table.row_taps)

    def _seen(self, z: slice, views: slice) -> tuple[slice, ...]:
        return views, z

    def _facts(self) -> list[str]:
        return [
            f"grid {' x '.join(map(str, self.grid.shape))}",
            f"{self.scan.views} fan views of {self.scan.bins} bins",
            f"magnification {self.scan.magnification:.3g}",
            f"footprint {self.footprint}",
        ]
