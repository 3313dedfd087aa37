"""The numbers behind the projector of a fan: where every ray of every view crosses the grid.

``kernels/include/tomo/fan_footprint.h`` says how they are used. A view looks along y, so that rows
are its slabs, where the ray through the grid's middle passes more rows than columns, and along x
otherwise. Everything is computed in float64 and counted in lines and slabs of the grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Fan, Grid

Floats = NDArray[np.float64]

_VIEW_NUMBERS, _MOST_RAYS = 16, 14
# Slabs that a source must stand before the first one, between whose middles its rays are counted.
_CLEAR = 1.0
# Shares by which counts of what is in reach are widened, since shadows change from bin to bin.
_BESIDE = 0.02
_ROUNDING = 1e-4
# Lines by which rays that are kept as they are may miss the grid.
_MISS = 4.0
# Rays that a kernel may load beyond the last.
_LANES = 8


@dataclass(frozen=True)
class FanRays:
    """The views that look along one axis; every array has a row for each.

    Args:
        views: which view of the scan each is, (n,) int32.
        starts: where each ray crosses the middle slab, in lines, (n, stride).
        slopes: lines that it goes on by the next slab, (n, stride).
        widths: of bins in lines at the middle slab, or 0 if the footprint has no use for them,
            (n, stride).
        factors: what each bin's sum is multiplied by, (n, stride).
        numbers: of the views, (n, 16); see ``fan_footprint.h``.
        pixels: most of a slab that a bin reaches.
        rays: most that a pixel reaches.
    """

    views: NDArray[np.int32]
    starts: Floats
    slopes: Floats
    widths: Floats
    factors: Floats
    numbers: Floats
    pixels: int
    rays: int


def fan_rays(grid: Grid, scan: Fan, footprint: str, depth_power: int) -> tuple[FanRays, FanRays]:
    """The rays of the views that look along y, and of those along x.

    Args:
        grid: the image.
        scan: the scan.
        footprint: ``strip``, ``joseph`` or ``linear``.
        depth_power: of the inverse depth in the weights, 1 or 2; see ``FanProjector``.

    Raises:
        InputError: a source stands in the grid, or so near that some of it lies beside or behind.
    """
    along_y = _look_along_y(grid, scan)
    pair = [
        _View(grid, scan, np.flatnonzero(along_y == wanted), along_y=wanted).rays(
            footprint, depth_power
        )
        for wanted in (True, False)
    ]
    stride = scan.bins + 1 + max(pair[0].rays, pair[1].rays, _LANES)
    return _padded(pair[0], stride), _padded(pair[1], stride)


def _look_along_y(grid: Grid, scan: Fan) -> NDArray[np.bool_]:
    """Which views look along y."""
    (dy, dx), (height, width) = grid.spacing, grid.shape
    x, y = _sources(grid, scan)
    rows, columns = np.abs(y), np.abs(x)
    before_rows, before_columns = rows - (height - 1) / 2, columns - (width - 1) / 2
    outside = np.maximum(before_rows, before_columns) >= _CLEAR
    if not outside.all() or _nearest(grid, scan).min() <= 0:
        near = np.flatnonzero(~outside) if not outside.all() else [_nearest(grid, scan).argmin()]
        raise InputError(
            f"source_to_axis is {scan.source_to_axis:g}: in view {int(near[0])} the source stands "
            f"within the grid, which is {height * dy:g} x {width * dx:g} (y, x), or beside it; "
            "check that both are in one unit of length"
        )
    # Ties are decided as those of views that differ by rounding are.
    along = rows >= columns * (1 - 1e-12)
    along[before_rows < _CLEAR] = False
    along[before_columns < _CLEAR] = True
    return along


def _sources(grid: Grid, scan: Fan) -> tuple[Floats, Floats]:
    """Where the sources stand from the grid's middle, in columns and in rows."""
    (dy, dx), (y, x) = grid.spacing, grid.center
    radius = scan.source_to_axis
    return (radius * np.sin(scan.angles) - x) / dx, (-radius * np.cos(scan.angles) - y) / dy


def _nearest(grid: Grid, scan: Fan) -> Floats:
    """Least distance of the grid's corners from each source, along the ray through the axis."""
    (dy, dx), (height, width), (y, x) = grid.spacing, grid.shape, grid.center
    cosine, sine = np.cos(scan.angles), np.sin(scan.angles)
    half = np.abs(sine) * width * dx / 2 + np.abs(cosine) * height * dy / 2
    distance: Floats = scan.source_to_axis - x * sine + y * cosine - half
    return distance


class _View:
    """The views that look along one axis: arrays of one number to a view, or (views, rays).

    Slopes are counted away from the source, so that lines grow with them on either side of it.
    """

    def __init__(self, grid: Grid, scan: Fan, views: NDArray[np.int64], *, along_y: bool) -> None:
        self.scan, self.views, self.along_y = scan, views, along_y
        # Axes are counted as those of a grid, (y, x).
        line, slab = (1, 0) if along_y else (0, 1)
        self.lines, self.slabs = grid.shape[line], grid.shape[slab]
        self.to_line, self.to_slab = grid.spacing[line], grid.spacing[slab]
        x, y = (places[views] for places in _sources(grid, scan))
        self.line = (x if along_y else y) + (self.lines - 1) / 2
        depth = -(y if along_y else x)
        self.side, self.depth = np.sign(depth), np.abs(depth)
        cosine, sine = np.cos(scan.angles[views]), np.sin(scan.angles[views])
        # Along the detector, and ahead to it, both in lines and slabs.
        self.across = (cosine, sine) if along_y else (sine, cosine)
        self.ahead = (-sine, cosine) if along_y else (cosine, -sine)
        self.mirrored = (self.side > 0) != along_y

    def rays(self, footprint: str, depth_power: int) -> FanRays:
        strip, linear = footprint == "strip", footprint == "linear"
        edges = self._slopes(np.arange(self.scan.bins + 1.0) - 0.5)
        middles = self._slopes(np.arange(self.scan.bins, dtype=np.float64))
        with np.errstate(invalid="ignore"):
            exact_widths = self.depth[:, None] * np.diff(edges, axis=1)
        low, high = self._bounds()
        kept = np.clip(edges, low, high)
        reaching = np.diff(kept, axis=1) > 0
        if linear:
            # A hat as wide as its bin reaches the grid from wherever its middle is.
            breadths = exact_widths / self.depth[:, None]
            with np.errstate(invalid="ignore"):
                reaching = (middles + breadths > low) & (middles - breadths < high)
        seen = reaching & np.isfinite(exact_widths)
        widths = np.where(seen, exact_widths, 0)
        rays = kept if strip else np.where(seen, middles, np.clip(middles, low, high))
        slant = np.abs(rays)
        starts = self.line[:, None] + self.depth[:, None] * rays
        starts = starts + (slant / 2 + 0.5 if strip else 0.0)
        gaps = widths if strip else self._gaps(middles, seen)
        spanned = self._spanned(footprint, slant, widths, gaps)
        first_seen = seen.argmax(axis=1) if linear else 0
        numbers = self._numbers(footprint, widths, spanned, first_seen)
        across = self.depth[:, None] * np.diff(kept, axis=1) if strip else widths
        return FanRays(
            views=self.views.astype(np.int32),
            starts=starts,
            slopes=self.side[:, None] * rays,
            widths=widths if linear else np.zeros_like(widths),
            factors=self._factors(footprint, middles, exact_widths, depth_power),
            numbers=numbers,
            pixels=self._pixels(footprint, slant, across),
            rays=int(np.max(numbers[:, _MOST_RAYS], initial=1)),
        )

    def _slopes(self, places: NDArray[Any]) -> Floats:
        """Lines by slab of the rays to these bins, infinite where they get to no slab."""
        angles = (places - self.scan.center) * self.scan.pitch / self.scan.source_to_detector
        angles = angles if self.scan.curved else np.arctan(angles)
        cosine, sine = np.cos(angles), np.sin(angles)
        way = [
            (cosine * ahead[:, None] + sine * across[:, None])
            for ahead, across in zip(self.ahead, self.across, strict=True)
        ]
        forward = self.side[:, None] * way[1] / self.to_slab
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = np.where(forward > 0, way[0] / self.to_line / forward, np.inf)
        slopes = np.where(forward > 0, slopes, np.copysign(np.inf, way[0]))
        return np.where(self.mirrored[:, None], slopes[:, ::-1], slopes)

    def _bounds(self) -> tuple[Floats, Floats]:
        """Slopes on either side that miss the grid by far, (n, 1): beyond them rays need not go."""
        # As far as slabs reach: what is aslant by many lines leaves a slab far from its middle.
        half = self.slabs / 2
        depths = np.stack([self.depth - half, self.depth + half])
        low = ((-_MISS - self.line) / depths).min(axis=0) - 1 / depths[0]
        high = ((self.lines + _MISS - self.line) / depths).max(axis=0) + 1 / depths[0]
        return low[:, None], high[:, None]

    def _gaps(self, middles: Floats, seen: NDArray[np.bool_]) -> Floats:
        """Lines at the middle slab from each ray to the next, 0 beside those seen, (n, bins - 1).

        Where bins open by much of a right angle they are less than the widths on both sides.
        """
        backwards = seen[:, ::-1]
        before = np.logical_or.accumulate(seen, axis=1)[:, :-1]
        behind = np.logical_or.accumulate(backwards, axis=1)[:, -2::-1]
        with np.errstate(invalid="ignore"):
            return np.where(before & behind, self.depth[:, None] * np.diff(middles, axis=1), 0)

    def _factors(
        self, footprint: str, middles: Floats, exact_widths: Floats, depth_power: int
    ) -> Floats:
        """What each bin's sum is multiplied by: nothing where its width or its ray has no end."""
        lengths = self._lengths(middles, depth_power)
        with np.errstate(divide="ignore", invalid="ignore"):
            factors = lengths / exact_widths if footprint == "strip" else lengths
        ended = np.isfinite(middles) & np.isfinite(factors)
        if footprint == "linear":
            ended &= np.isfinite(exact_widths)
        return np.where(ended, factors, 0.0)

    def _lengths(self, slopes: Floats, depth_power: int) -> Floats:
        """Of each bin's ray from slab to slab; with a power of 2 over its depth as well."""
        lines, slabs = slopes * self.to_line, self.to_slab
        with np.errstate(invalid="ignore", over="ignore"):
            lengths: Floats = np.hypot(lines, slabs)
            if depth_power == 1:
                return lengths
            if self.scan.curved:
                depth = lengths
            else:
                depth = lines * self.ahead[0][:, None]
                depth = depth + (slabs * self.side * self.ahead[1])[:, None]
            return lengths * self.scan.source_to_axis / (self.depth[:, None] * depth)

    def _numbers(
        self,
        footprint: str,
        widths: Floats,
        spanned: tuple[Floats, Floats],
        first_seen: NDArray[np.int64] | int,
    ) -> Floats:
        scan, strip = self.scan, footprint == "strip"
        sign = np.where(self.mirrored, -1.0, 1.0)
        first = scan.center + (0.5 if strip else 0.0)
        behind = scan.bins - (0.0 if strip else 1.0)
        magnification = scan.source_to_detector / scan.pitch
        depth = self.side * self.depth
        across = self._form(self.across)
        ahead = self._form(self.ahead)
        across = across * sign * (1.0 if scan.curved else magnification) / ahead[0]
        ahead = ahead / ahead[0]
        nearest = 1 / (1 - (self.slabs - 1) / 2 / self.depth)
        numbers = np.zeros((len(self.views), _VIEW_NUMBERS))
        columns = (
            1 / depth,
            -self.line / depth,
            np.where(self.mirrored, behind - first, first),
            magnification,
            *across,
            *ahead[1:],
            self._reach(footprint, widths),
            float(self.along_y),
            self.mirrored,
            *spanned,
            np.floor(np.minimum(np.maximum(spanned[0] * nearest, spanned[1]), scan.bins + 1)) + 1,
            first_seen,
        )
        # The order is that of fan_footprint.h, in which 9 follows the two numbers of `ahead`.
        for place, values in enumerate(columns):
            numbers[:, place] = values
        return numbers

    def _reach(self, footprint: str, widths: Floats) -> Floats:
        """What the kernels widen a pixel by to find its first ray, see ``fan_footprint.h``.

        The edge that a pixel of slope q reaches by its end may be aslant by more than q: by what
        slopes change over (1 + c) / 2 lines, that distance over the depth in slabs.
        """
        if footprint == "strip":
            change = 0.5 / (self.depth - (self.slabs - 1) / 2)
            return (1 + _ROUNDING) * 0.5 / (1 - change)
        widest: Floats = np.max(widths, axis=1) * (footprint == "linear")
        return widest

    def _pixels(self, footprint: str, slant: Floats, widths: Floats) -> int:
        """Most pixels of a slab that a bin reaches, as ``fan_project.cl`` counts them.

        Args:
            footprint: name.
            slant: lines by slab of each ray, (n, rays).
            widths: of bins in lines at the middle slab, of strips as far as they are kept,
                (n, bins).
        """
        if footprint == "joseph" or not len(self.views):
            return 3
        widest = widths * (1 + (self.slabs - 1) / 2 / self.depth[:, None])
        if footprint == "strip":
            span = widest + np.maximum(slant[:, 1:], slant[:, :-1])
        else:
            span = 2 * np.maximum(1, widest)
        return int(min((1 + _BESIDE) * span.max(), self.lines)) + 3

    def _spanned(
        self, footprint: str, slant: Floats, widths: Floats, gaps: Floats
    ) -> tuple[Floats, Floats]:
        """Most bins that a pixel of the middle slab spans, and one of any slab, of each view.

        Args:
            footprint: name.
            slant: lines by slab of each ray, (n, rays).
            widths: of bins in lines at the middle slab, 0 of those that miss the grid, (n, bins).
            gaps: lines from each ray to the next there, 0 of those that miss it, (n, rays - 1).
        """
        shadow: Floats | float = 2.0
        if footprint == "strip":
            slants = np.maximum(slant[:, 1:], slant[:, :-1])
            shadow = 2 * self._reach(footprint, widths)[:, None] * (1 + slants)
        with np.errstate(divide="ignore", over="ignore"):
            spans = np.where(gaps > 0, shadow / gaps, 0.0).max(axis=1, initial=0)
        least = spans * widths.max(axis=1) if footprint == "linear" else np.zeros(len(spans))
        # Bins are the narrower the steeper their rays, by so much within a pixel's reach.
        steepest = np.max(np.where(widths > 0, slant[:, : widths.shape[1]], 0.0), axis=1)
        change = 2 * steepest * (1 + steepest) / (self.depth - (self.slabs - 1) / 2)
        beside, most = 1 + _BESIDE + change, self.scan.bins + 1.0
        return np.minimum(beside * spans, most), np.minimum(beside * least, most)

    def _form(self, way: tuple[Floats, Floats]) -> Floats:
        """How far a pixel lies that way: at line 0 and the middle slab, by a line, by a slab."""
        by_line, by_slab = way[0] * self.to_line, way[1] * self.to_slab
        return np.stack([by_slab * self.side * self.depth - by_line * self.line, by_line, by_slab])


def _padded(rays: FanRays, stride: int) -> FanRays:
    """The same with rows of ``stride`` rays, the further ones of no weight."""

    def pad(values: Floats, *, repeat: bool = False) -> Floats:
        beyond = values[:, -1:] * float(repeat)
        added = np.broadcast_to(beyond, (len(values), stride - values.shape[1]))
        return np.concatenate([values, added], axis=1)

    return FanRays(
        rays.views,
        pad(rays.starts, repeat=True),
        pad(rays.slopes, repeat=True),
        pad(rays.widths),
        pad(rays.factors),
        rays.numbers,
        rays.pixels,
        rays.rays,
    )
