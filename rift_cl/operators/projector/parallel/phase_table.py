"""The numbers behind the phase-table projector: which row starts where in which view's table.

``kernels/include/tomo/phase_table.h`` derives the method. Here its per-view records are computed,
in float64, and turned into 32.32 fixed point. Views are walked along x when a step in x moves
further over the detector than a step in y, along y otherwise; either way the image is seen as
``rows`` of ``width`` columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Grid, Parallel
from rift_cl.operators.projector.footprint import FootprintRecords, footprint_records

LOG2_PHASES = 3
PHASES = 1 << LOG2_PHASES
_ONE = float(1 << 32)
# Bins per column beyond which 32.32 fixed point runs out of one side or the other.
_WITHIN = (1e-6, 1e6)
# A table that lies further than this from the detector, in bins, misses it as well from here.
_FAR = float(1 << 30)


@dataclass(frozen=True)
class PhaseTable:
    """The views that are walked along one axis.

    Args:
        views: which view of the scan each is, and how many columns it needs, (n, 2) int32.
        geometry: (base, slope, origin, step) per view in 32.32 fixed point, (n, 4) int64.
        footprints: what a pixel leaves on the detector.
        orders: the rows of each view sorted by phase, (n, rows) int32.
        starts: where each phase begins in ``orders``, (n, PHASES + 1) int32.
        columns: columns of a table, in whole segments.
        rows, width: the image as seen along this axis.
        padded: ``width`` in whole segments.
    """

    views: NDArray[np.int32]
    geometry: NDArray[np.int64]
    footprints: FootprintRecords
    orders: NDArray[np.int32]
    starts: NDArray[np.int32]
    columns: int
    rows: int
    width: int
    padded: int

    @property
    def entries(self) -> int:
        """Numbers in one view's table of one slice."""
        return PHASES * self.columns

    @property
    def nbytes(self) -> int:
        """Bytes of the records of all views, footprints in double precision."""
        arrays = (self.views, self.geometry, self.footprints.records, self.orders, self.starts)
        return sum(int(array.nbytes) for array in arrays)

    def part(self, views: slice, rows: slice, columns: slice, segment: int) -> PhaseTable:
        """The same numbers for some views of the scan and a part of the image.

        Args:
            views: which views of the scan; they are counted from the first of these.
            rows: which rows, as seen along this axis.
            columns: which columns, from the beginning of a segment on.
            segment: columns that one work-item handles.
        """
        chosen = (self.views[:, 0] >= views.start) & (self.views[:, 0] < views.stop)
        base, slope, origin, step = self.geometry[chosen].T
        base = base + slope * rows.start + (columns.start << 32)
        count, width = rows.stop - rows.start, columns.stop - columns.start
        orders, starts = _rows_by_phase(base, slope, count)
        return replace(
            self,
            views=self.views[chosen] - np.array([views.start, 0], np.int32),
            geometry=np.stack([base, slope, origin, step], axis=1),
            footprints=self.footprints.of_views(chosen),
            orders=orders,
            starts=starts,
            rows=count,
            width=width,
            padded=-(-width // segment) * segment,
        )


def phase_table(
    grid: Grid, scan: Parallel, footprint: str = "strip", *, along_x: bool, segment: int
) -> PhaseTable:
    """The table of the views that are walked along x, or of those along y.

    Args:
        grid: the image.
        scan: the scan.
        footprint: one of ``FOOTPRINTS``.
        along_x: which of the two.
        segment: columns that one work-item handles.
    """
    views = np.flatnonzero(walked_along_x(grid, scan) == along_x)
    # The walk's own axis, then the other one; `grid` counts axes as (y, x).
    walk, other = (1, 0) if along_x else (0, 1)
    cosine, sine = np.cos(scan.angles[views]), np.sin(scan.angles[views])
    if not along_x:
        cosine, sine = sine, cosine
    width, rows = grid.shape[walk], grid.shape[other]
    dx, dy = grid.spacing[walk], grid.spacing[other]
    slope = np.rint(dy * sine / (dx * cosine) * _ONE).astype(np.int64)
    base = np.maximum(0, -slope * (rows - 1))
    corner = grid.coordinates(walk)[0] * cosine + grid.coordinates(other)[0] * sine
    step = dx * cosine / scan.pitch
    origin = np.clip(scan.center + corner / scan.pitch - step * (base / _ONE), -_FAR, _FAR)
    if len(views) and not _WITHIN[0] < np.abs(step).min() <= np.abs(step).max() < _WITHIN[1]:
        raise InputError(
            f"pitch is {scan.pitch:g}, samples are {grid.spacing} apart: a bin may be at most "
            f"{1 / _WITHIN[0]:g} times as wide as a sample, or as narrow"
        )
    shadows = np.abs(step), np.abs(dy * sine / scan.pitch)
    padded = -(-width // segment) * segment
    used = ((base + np.maximum(slope, 0) * (rows - 1)) >> 32) + padded + 2
    orders, starts = _rows_by_phase(base, slope, rows)
    return PhaseTable(
        views=np.stack([views, used], axis=1).astype(np.int32),
        geometry=np.stack([base, slope, _fixed(origin), _fixed(step)], axis=1),
        footprints=footprint_records(footprint, *shadows, dx * dy / scan.pitch),
        orders=orders,
        starts=starts,
        columns=-(-int(np.max(used, initial=1)) // segment) * segment,
        rows=rows,
        width=width,
        padded=padded,
    )


def walked_along_x(grid: Grid, scan: Parallel) -> NDArray[np.bool_]:
    """Which views move further over the detector with a step in x than with one in y."""
    dy, dx = grid.spacing
    along: NDArray[np.bool_] = np.abs(dx * np.cos(scan.angles)) >= np.abs(dy * np.sin(scan.angles))
    return along


def _fixed(values: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.rint(values * _ONE).astype(np.int64)


def _rows_by_phase(
    base: NDArray[np.int64], slope: NDArray[np.int64], rows: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    positions = base[:, None] + slope[:, None] * np.arange(rows)
    # One byte per row, so that NumPy's stable sort is a radix sort.
    phases = ((positions >> (32 - LOG2_PHASES)) & (PHASES - 1)).astype(np.uint8)
    orders = np.argsort(phases, axis=1, kind="stable").astype(np.int32)
    counts = [np.count_nonzero(phases < r, axis=1) for r in range(PHASES + 1)]
    return orders, np.stack(counts, axis=1).astype(np.int32)
