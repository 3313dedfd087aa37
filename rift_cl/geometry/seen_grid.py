"""What a scan from a point sees: the size of a pixel at the axis, and the voxels it fills."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.cone import Cone
from rift_cl.geometry.fan import Fan
from rift_cl.geometry.grid import Grid
from rift_cl.geometry.scan_value import checked_length
from rift_cl.geometry.vectors import Vectors

# Rows that an interpolation of any footprint reads beside a shadow.
_BESIDE = 4
# Least cosine of the angle to a direction along which a detector's edge, or a view, mostly is.
_MOSTLY = math.sqrt(0.5)
# Share of the views that may look past the axis before the volume is taken to stand elsewhere.
_PAST = 0.25
# What differs by no more than rounding is the same.
_SAME = 1e-9

Floats = NDArray[np.float64]


class ScanLengths(NamedTuple):
    """Lengths that most views of a scan have.

    Args:
        source_to_axis: distance of the source from the axis.
        source_to_detector: distance of the source from the detector.
        pitch: distance between rows and between bins on the detector.
    """

    source_to_axis: float
    source_to_detector: float
    pitch: tuple[float, float]

    @property
    def pixel(self) -> tuple[float, float]:
        """Distance between rows and between bins as they are seen at the axis."""
        share = self.source_to_axis / self.source_to_detector
        return self.pitch[0] * share, self.pitch[1] * share


def scan_lengths(scan: Fan | Cone | Vectors) -> ScanLengths:
    """Lengths of a scan; of vectors, the medians over the views.

    Args:
        scan: a fan's pitch counts for rows as well.
    """
    if isinstance(scan, Vectors):
        normal = _normals(scan)
        to_detector = np.abs(((scan.middle - scan.source) * normal).sum(axis=1))
        to_axis = to_detector * _share_to_axis(scan, normal)
        beside = np.hypot(scan.source[:, 0], scan.source[:, 1])
        # Of upright views that look straight at the axis it is this, to the bit.
        to_axis = np.where(np.isclose(to_axis, beside, rtol=_SAME, atol=0), beside, to_axis)
        pitch = [np.median(np.linalg.norm(v, axis=1)) for v in (scan.down, scan.across)]
        lengths = float(np.median(to_axis)), float(np.median(to_detector))
        return ScanLengths(*lengths, (float(pitch[0]), float(pitch[1])))
    pitch_of = scan.pitch if isinstance(scan, Cone) else (scan.pitch, scan.pitch)
    return ScanLengths(scan.source_to_axis, scan.source_to_detector, pitch_of)


def _normals(scan: Vectors) -> Floats:
    """Unit vectors across the detector, (views, 3)."""
    normal = np.cross(scan.across, scan.down)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _share_to_axis(scan: Vectors, normal: Floats) -> Floats:
    """How far along its rays each view meets the axis, as a share of the way to the detector.

    Where the plane through the axis that faces the detector, upright, cuts them. Of views that look
    along the axis it is where they meet the plane z = 0.
    """
    flat = normal * [1, 1, 0]
    way = ((scan.middle - scan.source) * flat).sum(axis=1)
    along = (flat * flat).sum(axis=1) < _SAME
    height = np.where(along, (scan.middle - scan.source)[:, 2], 1)
    share = -(scan.source * flat).sum(axis=1) / np.where(along, 1, way)
    return np.asarray(np.abs(np.where(along, -scan.source[:, 2] / height, share)))


def seen_grid(scan: Fan | Cone | Vectors, spacing: float | None = None) -> Grid:
    """Cubic voxels over what the detector shows, centred on the rotation axis.

    Across the axis they reach as far as the detector's longer side does at the axis; along it, from
    the detector's first row to its last as seen at the axis, and as far as the source rises.

    Args:
        scan: a fan gives the pixels of a slice.
        spacing: edge of a voxel; a bin as it is seen at the axis if not given.

    Raises:
        InputError: the spacing is no positive length, or vectors look past the axis x = y = 0 at
            another place.
    """
    row, bin = scan_lengths(scan).pixel
    edge = bin if spacing is None else checked_length("seen_grid", "spacing", spacing)
    if isinstance(scan, Vectors):
        check_axis(scan)
        width, low, high = _reach_of_vectors(scan)
    else:
        center = scan.center if isinstance(scan, Fan) else scan.center[1]
        width = 2 * max(center + 0.5, scan.bins - 0.5 - center) * bin
        low, high = (0.0, edge) if isinstance(scan, Fan) else _rows_of_cone(scan, row)
    across = max(1, _whole(width / edge))
    if isinstance(scan, Fan):
        return Grid((across, across), edge)
    along = max(1, _whole((high - low) / edge))
    return Grid((along, across, across), edge, ((low + high) / 2, 0, 0))


def check_axis(scan: Vectors) -> None:
    """Refuse vectors that turn about another axis than the one that a grid is centred on.

    Views may stand anywhere, so that some may look past the axis; but where many do, and more of
    them see the place that their middle rays pass nearest, the object is there.

    Raises:
        InputError: it is.
    """
    seen = _views_of_axis(scan)
    if seen >= (1 - _PAST) * scan.views:
        return
    x, y, _ = _looked_at(scan)
    moved = scan.source - [x, y, 0], scan.middle - [x, y, 0]
    about = _views_of_axis(Vectors(*moved, scan.across, scan.down, scan.rows, scan.bins))
    if about > seen:
        raise InputError(
            f"{seen} of {scan.views} views see the axis x = y = 0, on which the volume is centred, "
            f"and {about} see x = {x:.4g}, y = {y:.4g}, near which their middle rays pass: "
            f"subtract ({x:.6g}, {y:.6g}, 0) from the places of source and detector in the vectors"
        )


def slices_beyond(scan: Cone | Vectors, grid: Grid) -> tuple[int, int]:
    """Slices below a grid and above it that rays to the first and to the last rows pass through.

    Rays that leave the plane of the source go on to do so behind the axis, as far as the grid
    reaches. Rows that are all on one side of that plane have rays beyond the grid in front of it.

    Args:
        scan: source and detector.
        grid: of the volume, as high as rows are seen at the axis.
    """
    lengths = scan_lengths(scan)
    row, _ = lengths.pixel
    first = scan.center[0] + 0.5 if isinstance(scan, Cone) else scan.rows / 2
    heights = first * row, (scan.rows - first) * row
    radius = max(n * d / 2 for n, d in zip(grid.shape[1:], grid.spacing[1:], strict=True))
    share = radius / (lengths.source_to_axis * grid.spacing[0])
    below, above = (_whole(abs(height) * share) for height in heights)
    return below, above


def rows_seen(scan: Cone | Vectors, grid: Grid) -> tuple[int, int]:
    """The first detector row that voxels are seen in, in any view, and the one after the last.

    With the rows beside them that are read between; at least one. Of vectors these are all rows.

    Args:
        scan: source and detector.
        grid: the voxels, none of them as far from the axis as the source.
    """
    if isinstance(scan, Vectors):
        return 0, scan.rows
    z, half = grid.center[0], grid.shape[0] * grid.spacing[0] / 2
    ends = z - half - float(scan.heights.max()), z + half - float(scan.heights.min())
    across = zip(grid.center[1:], grid.shape[1:], grid.spacing[1:], strict=True)
    radius = math.hypot(*(abs(middle) + count * step / 2 for middle, count, step in across))
    nearest, farthest = scan.source_to_axis - radius, scan.source_to_axis + radius
    scale = scan.source_to_detector / scan.pitch[0]
    low, high = (
        end * scale / (nearest if end * way > 0 else farthest)
        for end, way in zip(ends, (-1, 1), strict=True)
    )
    beside = _BESIDE + grid.spacing[0] * scale / nearest
    first = math.floor(scan.center[0] + low - beside)
    stop = math.ceil(scan.center[0] + high + beside) + 1
    first = min(max(first, 0), scan.rows - 1)
    return first, min(max(stop, first + 1), scan.rows)


def _rows_of_cone(scan: Cone, row: float) -> tuple[float, float]:
    """The lowest and the highest place that rows show at the axis."""
    first = (-0.5 - scan.center[0]) * row + float(scan.heights.min())
    last = (scan.rows - 0.5 - scan.center[0]) * row + float(scan.heights.max())
    return first, last


def _looked_at(scan: Vectors) -> Floats:
    """The point whose squared distances from the rays to the detector's middle sum to the least."""
    ahead = scan.middle - scan.source
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    beside = np.eye(3) - ahead[:, :, None] * ahead[:, None, :]
    across_rays = (beside @ scan.source[:, :, None]).sum(axis=0)[:, 0]
    # Of rays that are all parallel it is the one nearest the origin.
    place = np.linalg.pinv(beside.sum(axis=0), rcond=_SAME) @ across_rays
    return np.where(np.abs(place) > _SAME * np.abs(place).max(), place, 0)


def _views_of_axis(scan: Vectors) -> int:
    """The number of views with a shadow of the axis, where their middle rays pass it."""
    ahead = scan.middle - scan.source
    share = _share_to_axis(scan, _normals(scan))
    place = np.zeros_like(ahead)
    place[:, 2] = (scan.source + share[:, None] * ahead)[:, 2]
    # A place is so many bins, rows and ways to the middle from the source, times its depth.
    basis = np.stack([scan.across, scan.down, ahead], axis=2)
    bins, rows, depth = np.linalg.solve(basis, (place - scan.source)[:, :, None])[:, :, 0].T
    inside = (2 * np.abs(bins) <= scan.bins * depth) & (2 * np.abs(rows) <= scan.rows * depth)
    return int(np.count_nonzero(inside & (depth > 0)))


def _reach_of_vectors(scan: Vectors) -> tuple[float, float, float]:
    """What is seen across the axis, and the lowest and the highest place along it.

    Counted from where the middle of the detector looks past the axis. Where bins run along z the
    detector lies on its side; views that look along z have no side that the axis could be on.
    """
    lengths = scan_lengths(scan)
    row, bin = lengths.pixel
    height, width = scan.rows * row, scan.bins * bin
    share = lengths.source_to_axis / lengths.source_to_detector
    places = scan.source + share * (scan.middle - scan.source)
    normal = np.cross(scan.across, scan.down)
    flat = np.hypot(normal[:, 0], normal[:, 1])
    across_z = _MOSTLY * np.linalg.norm(scan.across, axis=1)
    if np.median(np.abs(scan.across[:, 2]) - across_z) > 0:
        height, width = width, height
    if np.median(flat - _MOSTLY * np.linalg.norm(normal, axis=1)) > 0:
        aside = (places[:, 0] * normal[:, 1] - places[:, 1] * normal[:, 0]) / flat
        width += 2 * abs(float(np.median(aside)))
    half = height / 2
    return width, float(places[:, 2].min()) - half, float(places[:, 2].max()) + half


def _whole(count: float) -> int:
    """The whole number above, but for rounding."""
    return math.ceil(count - 1e-6)
