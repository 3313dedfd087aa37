"""The numbers behind the slab projector: where the volume's slabs lie in the tables of the views.

``kernels/include/cone/slab_table.h`` derives the method. Here its per-view records are computed, in
float64. Views are walked in slabs across y, whose lines follow each other along x, or in slabs
across x; both see lines along z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Grid
from rift_cl.operators.projector.cone.upright import Upright

Floats = NDArray[np.float64]
Whole = NDArray[np.int32]

# Counts of columns or rows that a shadow may touch: kernels are built for each. Table rows are one
# detector row apart, or as much more as keeps a shadow in the most of them.
_MOST_ROW_TAPS = 8
_TAPS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
# Entries of a table stand in whole groups of so many, with empty ones before the first.
_GROUP = 8
# Distance of table rows, in detector rows, that are read at points: linear interpolation between
# them then costs next to nothing of what the cubic one between the detector's leaves, while one
# row apart costs 0.5 dB on the head of 128^3 voxels.
_POINT_ROWS = 0.5
# Cosine of the angle to a slab beyond which no ray is walked by it, and the smallest shadow of a
# sample in bins, next to which float32 still tells places apart.
_STEEPEST, _SMALLEST = 0.1, 1e-3
# Room for rounding in shadows that just fit their entries.
_SLACK = 1e-4
# Rows that the stretch reads to either side, in units of the wider of the two pitches.
_REACH = 2


@dataclass(frozen=True)
class Samples:
    """An axis of the grid, or a part of one.

    Args:
        count: how many samples there are.
        start: coordinate of the axis' first sample.
        step: from sample to sample.
        first: which sample of the axis they begin with.
    """

    count: int
    start: float
    step: float
    first: int = 0

    @classmethod
    def of(cls, grid: Grid, axis: int) -> Samples:
        """Those along an axis, counted as in ``grid.shape``."""
        return cls(grid.shape[axis], float(grid.coordinates(axis)[0]), grid.spacing[axis])

    @property
    def places(self) -> Floats:
        """Coordinates of all of them."""
        return self.start + self.step * np.arange(
            self.first, self.first + self.count, dtype=np.float64
        )

    @property
    def ends(self) -> Floats:
        """Outer edges of the first and of the last."""
        return self.start + self.step * (self.first + np.array([-0.5, self.count - 0.5]))


@dataclass(frozen=True)
class SlabTable:
    """The views that are walked along one axis.

    Args:
        views: which view of the scan each is, (n,).
        lines, slabs: samples along a slab and across the slabs.
        column_forms, row_forms: where samples are seen along the columns and the rows of a table,
            as slab_places.cl reads them, (n, 8).
        amplitudes: weight of each slab, (n, slabs).
        firsts: which row of the stretched view stands first in a table, (n,).
        steps: rows of the detector from one table row to the next, for each column, (n, columns).
        gains: what a column of the table is multiplied by, (n, columns).
        rows, columns: entries of a table along each axis.
        pad: empty columns before the first.
        taps, row_taps: columns and rows that a sample's shadow touches at most.
        widest: columns from one line to the next at most.
        wide: whether a table's rows are further apart than the detector's.
    """

    views: Whole
    lines: Samples
    slabs: Samples
    column_forms: Floats
    row_forms: Floats
    amplitudes: Floats
    firsts: Whole
    steps: Floats
    gains: Floats
    rows: int
    columns: int
    pad: int
    taps: int
    row_taps: int
    widest: float
    wide: bool

    @property
    def entries(self) -> int:
        """Numbers in one view's table."""
        return self.rows * self.columns

    def of_views(self, run: slice) -> SlabTable:
        """The table of a run of the scan's views, with the numbers of the whole."""
        chosen = (self.views >= run.start) & (self.views < run.stop)
        return replace(
            self,
            views=(self.views[chosen] - run.start).astype(np.int32),
            column_forms=self.column_forms[chosen],
            row_forms=self.row_forms[chosen],
            amplitudes=self.amplitudes[chosen],
            firsts=self.firsts[chosen],
            steps=self.steps[chosen],
            gains=self.gains[chosen],
        )


def slab_table(
    grid: Grid, scan: Cone | Upright, footprint: str, depth_power: int = 2, *, along_x: bool
) -> SlabTable:
    """The table of the views whose slabs have lines along x, or of those with lines along y.

    Args:
        grid: the volume.
        scan: the scan.
        footprint: ``strip``, ``linear`` or ``point``.
        depth_power: of the inverse of the depth that a sample is weighted by; 2 is that of line
            integrals, 1 of a ``Cone`` has another factor ``depth / source_to_axis``.
        along_x: which of the two.

    Raises:
        InputError: the source stands in the volume, a ray runs along the slabs of either walk, or
            bins and samples are of very different sizes.
    """
    by_y = walked_along_x(grid, scan)
    shadow = max(
        _Walk.of(grid, scan, np.flatnonzero(by_y == way), along_x=way).row_shadow()
        for way in (True, False)
    )
    pitch = max(1.0, shadow / (_MOST_ROW_TAPS - 1))
    pitch = _POINT_ROWS if footprint == "point" else pitch
    row_taps = _fitting(shadow / pitch, footprint)
    views = np.flatnonzero(by_y == along_x)
    walk = _Walk.of(grid, scan, views, along_x=along_x)
    widest, narrowest = walk.shadows()
    taps = _taps(widest, narrowest, footprint, scan)
    pad = -(-taps // _GROUP) * _GROUP
    columns = -(-(pad + scan.bins + taps) // _GROUP) * _GROUP
    slopes = np.abs(walk.slopes)
    firsts, rows = walk.row_ranges(pitch, slopes, row_taps)
    padding = (0, 0), (pad, columns - pad - scan.bins)
    slopes = np.pad(slopes, padding, mode="edge")
    steps, gains, amplitudes = pitch * slopes, (pitch * slopes) ** 2, walk.amplitudes(pitch)
    if depth_power != 2:
        gains *= slopes ** (depth_power - 2.0)
        reaches = walk.reaches(walk.slabs.places) / scan.source_to_axis
        amplitudes *= reaches ** (2.0 - depth_power)
    return SlabTable(
        views=views.astype(np.int32),
        lines=walk.lines,
        slabs=walk.slabs,
        column_forms=walk.column_forms(scan.center[1] + pad),
        row_forms=walk.row_forms(pitch, firsts),
        amplitudes=amplitudes,
        firsts=firsts.astype(np.int32),
        steps=steps,
        gains=gains,
        rows=rows,
        columns=columns,
        pad=pad,
        taps=taps,
        row_taps=row_taps,
        widest=widest,
        wide=pitch > 1,
    )


def fan_table(
    grid: Grid, beam: Cone, footprint: str, depth_power: int, *, along_x: bool
) -> SlabTable:
    """As ``slab_table``, of a fan that sees every slice alike: a table's rows are the slices.

    Args:
        grid: the volume.
        beam: the fan as a cone that has a row for each slice.
        footprint: ``strip``, ``linear`` or ``point``.
        depth_power: of the inverse of the depth that a sample is weighted by; 1 is that of line
            integrals, 2 has another factor ``source_to_axis / depth``.
        along_x: which of the two.
    """
    views = np.flatnonzero(walked_along_x(grid, beam) == along_x)
    walk = _Walk.of(grid, beam, views, along_x=along_x)
    widest, narrowest = walk.shadows()
    taps, row_taps = _taps(widest, narrowest, footprint, beam), 2
    pad = -(-taps // _GROUP) * _GROUP
    columns = -(-(pad + beam.bins + taps) // _GROUP) * _GROUP
    padding = (0, 0), (pad, columns - pad - beam.bins)
    slopes = np.pad(np.abs(walk.slopes), padding, mode="edge")
    reaches = walk.reaches(walk.slabs.places)
    area = walk.lines.step * walk.slabs.step * beam.source_to_detector / beam.pitch[1]
    # Sample i is seen in row i, behind the empty ones.
    form = np.array([0.0, 1.0, 0.0, 1.0, 0.0, 0.0, row_taps, 0.0])
    return SlabTable(
        views=views.astype(np.int32),
        lines=walk.lines,
        slabs=walk.slabs,
        column_forms=walk.column_forms(beam.center[1] + pad),
        row_forms=np.broadcast_to(form, (len(views), len(form))),
        amplitudes=area / reaches * (beam.source_to_axis / reaches) ** (depth_power - 1),
        firsts=np.full(len(views), -row_taps, np.int32),
        steps=np.ones_like(slopes),
        gains=slopes**depth_power,
        rows=grid.slices + 2 * row_taps,
        columns=columns,
        pad=pad,
        taps=taps,
        row_taps=row_taps,
        widest=widest,
        wide=False,
    )


def ray_lengths(scan: Cone | Upright) -> Floats:
    """Length of each pixel's ray from source to detector over its reach across, (rows, bins).

    The reach is that to the detector's plane, or that within the fan's plane of a curved one.
    """
    v = (np.arange(scan.rows) - scan.center[0]) * scan.pitch[0] / scan.source_to_detector
    aside = np.zeros(scan.bins) if scan.curved else np.tan(scan.fan_angles())
    lengths: Floats = np.sqrt(1 + v[:, None] ** 2 + aside**2)
    return lengths


def walked_along_x(grid: Grid, scan: Cone | Upright) -> NDArray[np.bool_]:
    """Which views are walked in slabs across y: those that look along y rather than along x.

    Raises:
        InputError: the source stands in the volume, or a view can be walked in neither way.
    """
    _check_source(grid, scan)
    _, dy, dx = grid.spacing
    prefer = dx * np.abs(np.cos(scan.angles)) >= dy * np.abs(np.sin(scan.angles))
    every = np.arange(scan.views)
    by_y, by_x = (_Walk.of(grid, scan, every, along_x=way).possible() for way in (True, False))
    neither = ~(by_y | by_x)
    if neither.any():
        width = np.rad2deg(np.ptp(scan.fan_angles()))
        raise InputError(
            f"Cone: in view {int(np.flatnonzero(neither)[0])} rays run along the planes of samples "
            f"across x as well as across y: the fan is {width:.0f} degrees wide, about 90 are "
            "allowed; leave out the detector's outer columns, or give distances in the grid's unit"
        )
    return np.where(prefer, by_y, ~by_x)


@dataclass(frozen=True)
class _Walk:
    """Views that are walked alike.

    Args:
        scan: the scan.
        lines, slabs, column: the grid's samples along the lines' axis, across the slabs, along z.
        ahead, aside: direction from the source to the axis and that of the detector's rows, each
            as (line, slab) coordinates, (2, n).
        heights: of the source, (n,).
        source: of each view, as (line, slab) coordinates, (2, n).
    """

    scan: Cone | Upright
    lines: Samples
    slabs: Samples
    column: Samples
    ahead: Floats
    aside: Floats
    heights: Floats
    source: Floats

    @classmethod
    def of(
        cls, grid: Grid, scan: Cone | Upright, views: NDArray[np.intp], *, along_x: bool
    ) -> _Walk:
        cosine, sine = np.cos(scan.angles[views]), np.sin(scan.angles[views])
        ahead, aside = np.stack([-sine, cosine]), np.stack([cosine, sine])
        if not along_x:
            ahead, aside = ahead[::-1], aside[::-1]
        z, *yx = (Samples.of(grid, axis) for axis in range(3))
        lines, slabs = reversed(yx) if along_x else yx
        distances, offsets = (places[views] for places in _sources(scan))
        source = offsets * aside - distances * ahead
        return cls(scan, lines, slabs, z, ahead, aside, scan.heights[views], source)

    @property
    def slopes(self) -> Floats:
        """Slabs that a ray passes on its reach, over their distance; signed, (n, bins)."""
        gamma = self.scan.fan_angles()
        ahead, aside = self.ahead[1][:, None], self.aside[1][:, None]
        turned: Floats = ahead * np.cos(gamma) + aside * np.sin(gamma)
        return turned if self.scan.curved else turned / np.cos(gamma)

    def reaches(self, places: Floats) -> Floats:
        """Distance of the source from places across the slabs, (n, places); not above 0 beyond."""
        reaches: Floats = (places - self.source[1][:, None]) * np.sign(self.ahead[1])[:, None]
        return reaches

    def possible(self) -> NDArray[np.bool_]:
        """Whether every ray crosses the slabs, and the source stands before all of them."""
        gamma = self.scan.fan_angles()
        ahead, aside = self.ahead[1][:, None], self.aside[1][:, None]
        steep = (ahead * np.cos(gamma) + aside * np.sin(gamma)) * np.sign(ahead) > _STEEPEST
        before = self.reaches(self.slabs.ends) > 0
        found: NDArray[np.bool_] = steep.all(axis=1) & before.all(axis=1)
        return found

    @property
    def _fractions(self) -> Floats:
        """Tangent of the fan angle at (a, b) as n0 n1 n2 d0 d1 d2, (n, 6)."""
        across, along = (-(self.source * way).sum(axis=0) for way in (self.aside, self.ahead))
        return np.stack([across, *self.aside, along, *self.ahead], axis=1)

    def shadows(self) -> tuple[float, float]:
        """The widest shadow of a sample of a line in bins, and the narrowest."""
        if not len(self.heights):
            return 1.0, 1.0
        _, n1, n2, d0, d1, d2 = (f[:, None, None] for f in self._fractions.T)
        b = self.slabs.places[:, None]
        ends = self.lines.places[[0, -1]] + self.lines.step * np.array([[-0.5], [0.5]])
        edges = [(n1 * a + n2 * b) / (d0 + d1 * a + d2 * b) for a in ends]
        width = np.abs(edges[1] - edges[0]) * self._bins_per_tangent
        # Of an arc, tangents are further apart than angles by 1 / cos^2 at most.
        narrowing = np.cos(self.scan.fan_angles()).min() ** 2 if self.scan.curved else 1.0
        return float(width.max()), float(width.min()) * narrowing

    @property
    def _bins_per_tangent(self) -> float:
        return self.scan.source_to_detector / self.scan.pitch[1]

    def column_forms(self, origin: float) -> Floats:
        """Where samples of lines are seen along the columns."""
        forms = self._fractions
        scale = self._bins_per_tangent
        if not self.scan.curved:
            forms[:, :3] *= scale
        ends = np.broadcast_to([origin, scale], (len(forms), 2))
        return np.concatenate([forms, ends], axis=1)

    def row_shadow(self) -> float:
        """The widest shadow of a sample along the columns, in detector rows at slope 1."""
        nearest = self.reaches(self.slabs.places).min(initial=np.inf)
        return float(self._rows_per_tangent * self.column.step / nearest) * (1 + _SLACK)

    @property
    def _rows_per_tangent(self) -> float:
        return self.scan.source_to_detector / self.scan.pitch[0]

    def row_ranges(self, pitch: float, slopes: Floats, taps: int) -> tuple[NDArray[np.intp], int]:
        """The first row of each view's table, (n,), and rows of a table.

        Rows that neither the volume nor the detector reaches are left out.
        """
        if not len(slopes):
            return np.zeros(0, np.intp), 1
        ends = self.column.ends - self.heights[:, None]
        near, far = (self.reaches(self.slabs.places[[at]])[:, 0] for at in (0, -1))
        scale = self._rows_per_tangent / pitch
        seen = np.stack([end * scale / reach for end in ends.T for reach in (near, far)])
        steps = pitch * np.stack([slopes.min(axis=1), slopes.max(axis=1)])
        reach = _REACH * np.maximum(1, steps) + 1
        row0, row1 = -self.scan.center[0], self.scan.rows - 1 - self.scan.center[0]
        low = np.maximum(seen.min(axis=0) - 1, ((row0 - reach) / steps).min(axis=0))
        high = np.minimum(seen.max(axis=0) + 1, ((row1 + reach) / steps).max(axis=0))
        firsts = np.floor(low).astype(np.intp) - taps
        lasts = np.maximum(np.ceil(high).astype(np.intp), firsts) + taps
        return firsts, int((lasts - firsts).max()) + 1

    def row_forms(self, pitch: float, firsts: NDArray[np.intp]) -> Floats:
        """Where samples along z are seen along the rows."""
        sign, zero = np.sign(self.ahead[1]), np.zeros(len(firsts))
        scale = zero + self._rows_per_tangent / pitch
        numerators = -self.heights * scale, scale, zero
        return np.stack([*numerators, -sign * self.source[1], zero, sign, -firsts, zero], axis=1)

    def amplitudes(self, pitch: float) -> Floats:
        """Weight of each slab, (n, slabs)."""
        volume = self.lines.step * self.slabs.step * self.column.step
        scale = volume * self._bins_per_tangent * self._rows_per_tangent / pitch**2
        weights: Floats = scale / self.reaches(self.slabs.places) ** 2
        return weights


def _taps(widest: float, narrowest: float, footprint: str, scan: Cone | Upright) -> int:
    taps = _fitting(widest, footprint)
    if not taps or (narrowest < _SMALLEST and footprint != "point"):
        raise InputError(
            f"{_called(scan)}: pitch is {scan.pitch}, so that a sample's shadow is "
            f"{narrowest:.3g} to {widest:.3g} bins wide, {_SMALLEST} to {_TAPS[-1] - 1} are "
            "allowed: see that all lengths have one unit, or bin the data or the volume"
        )
    return taps


def _called(scan: Cone | Upright) -> str:
    """What the user gave: the views of vectors are read from upright detectors."""
    return "Vectors" if isinstance(scan, Upright) else "Cone"


def _fitting(shadow: float, footprint: str) -> int:
    """Entries that a shadow may touch, or 0 where they are too many."""
    if footprint == "point":
        return 2
    touched = shadow * (1 + _SLACK) + 1 if footprint == "strip" else 2 * max(1.0, shadow)
    return next((n for n in _TAPS if n >= touched), 0)


def _check_source(grid: Grid, scan: Cone | Upright) -> None:
    y, x = (Samples.of(grid, axis).ends for axis in (1, 2))
    corners = np.array([(a, b) for a in x for b in y])
    aside = corners @ np.stack([np.sin(scan.angles), -np.cos(scan.angles)])
    distances, _ = _sources(scan)
    depth = distances - aside.max(axis=0)
    if not (depth > 0).all():
        view = int(np.argmin(depth))
        reach = aside[:, view].max()
        if isinstance(scan, Upright):
            raise InputError(
                f"Vectors: in view {view} the source stands {distances[view]:g} before the middle "
                f"of the grid as the detector faces it, and the volume reaches {reach:.4g} that "
                "way, so that it would stand in the volume, beside it or behind it: see that the "
                "detector faces the grid, give a smaller grid, or all lengths in one unit"
            )
        raise InputError(
            f"Cone: source_to_axis is {distances[view]:g}, but the volume reaches "
            f"{reach:.4g} towards the source in view {view}, which would stand in "
            "it or beside it: give a smaller grid, or all lengths in one unit"
        )


def _sources(scan: Cone | Upright) -> tuple[Floats, Floats]:
    """Where each view's source stands from the axis: how far behind it, and how far aside."""
    if isinstance(scan, Upright):
        return scan.source_to_axis, scan.offsets
    return np.full(scan.views, scan.source_to_axis), np.zeros(scan.views)
