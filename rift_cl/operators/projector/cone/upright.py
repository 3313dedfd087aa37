"""Upright detectors in the place of those of a ``Vectors`` scan, and the way from one to the other.

Slab tables want detectors whose columns run along the axis that slabs have in common. Before any
source such a detector can be thought of, upright in the place of the tilted one. Where a pixel's
ray meets it is a ratio of linear forms of the pixel's row and column, a homography. Views that look
along z rather than across are seen with y and z exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Grid, Vectors

Floats = NDArray[np.float64]

# Columns and rows beside what is seen that the cubics of reading and of stretching reach.
_BESIDE = 4
# An upright detector this many times larger than the tilted one is no sensible way to go.
_LARGEST = 64
# Tangent of the angle that a ray may have with the normal of its upright detector.
_WIDEST = 12.0
# Cosine of the tilt up to which upright detectors are turned as the tilted ones are.
_LEVEL = 0.5


@dataclass(frozen=True)
class Upright:
    """Upright detectors of some views of a scan; a ``Cone`` whose source may stand anywhere.

    Args:
        angles: of the source in radians, (n,).
        heights: of source and detector along the axis, (n,).
        source_to_axis: of each source, along the line at a right angle to its detector, (n,).
        offsets: of the axis from that line, along the rows, of the source's side, (n,).
        source_to_detector: of all of them.
        rows, bins: of a detector.
        pitch: distance between rows and between bins.
        center: (row, bin) at which the source's foot on the detector lies.
    """

    angles: Floats
    heights: Floats
    source_to_axis: Floats
    offsets: Floats
    source_to_detector: float
    rows: int
    bins: int
    pitch: tuple[float, float]
    center: tuple[float, float]
    curved: bool = False

    @property
    def views(self) -> int:
        """Number of views."""
        return len(self.angles)

    def subset(self, views: NDArray[np.intp]) -> Upright:
        """The upright detectors of some views, given by their numbers."""
        names = "angles", "heights", "source_to_axis", "offsets"
        return replace(self, **{name: getattr(self, name)[views] for name in names})

    @property
    def magnification(self) -> float:
        """How much larger the detectors show what stands at the axis, in the middle of views."""
        return self.source_to_detector / float(np.median(self.source_to_axis))

    def fan_angles(self) -> Floats:
        """Angles of the columns' rays in the plane across the axis, in radians, (bins,)."""
        u = (np.arange(self.bins) - self.center[1]) * self.pitch[1]
        gamma: Floats = np.arctan2(u, self.source_to_detector)
        return gamma


@dataclass(frozen=True)
class Rectified:
    """Views of a scan that look across, or along z, and their upright detectors.

    Args:
        views: which of the scan, (n,) int32.
        upright: their upright detectors.
        grid: the grid in their coordinates.
        forms: as ``kernels/include/cone/upright.h`` reads them, (n, 18).
        along_z: whether they look along z.
    """

    views: NDArray[np.int32]
    upright: Upright
    grid: Grid
    forms: Floats
    along_z: bool


def looking_along_z(scan: Vectors) -> NDArray[np.bool_]:
    """Which views look along z rather than across it."""
    way = scan.middle - scan.source
    along: NDArray[np.bool_] = np.abs(way[:, 2]) > np.hypot(way[:, 0], way[:, 1])
    return along


def rectified(grid: Grid, scan: Vectors, *, along_z: bool) -> Rectified:
    """The views that look along z, with y and z exchanged, or those that look across; at least one.

    Args:
        grid: the volume.
        scan: the scan.
        along_z: which of the two.

    Raises:
        InputError: a ray runs along or away from its upright detector.
    """
    views = np.flatnonzero(looking_along_z(scan) == along_z)
    # Coordinates count as (x, y, z), axes of a grid as (z, y, x).
    axes = [0, 2, 1] if along_z else [0, 1, 2]
    source = scan.source[views][:, axes]
    reach = (scan.middle - scan.source)[views][:, axes]
    across, down = (vectors[views][:, axes] for vectors in (scan.across, scan.down))
    shape, *lengths = (v[::-1] for v in (grid.shape, grid.spacing, grid.center))
    seen = Grid([int(shape[n]) for n in axes[::-1]], *([v[n] for n in axes[::-1]] for v in lengths))
    angles = _angles(reach, np.cross(across, down))
    steps = across, down
    forms = _frames(angles) @ np.stack([reach, *steps], axis=2)
    _check_ahead(views, forms, scan)
    depths = forms[:, 2, 0]
    forms = forms / depths[:, None, None]
    upright = _detectors(forms, scan, seen, angles, source, depths)
    return Rectified(views.astype(np.int32), upright, seen, _counted(forms, upright), along_z)


def pixel_slopes(scan: Vectors, found: Rectified, by_column: Floats, by_row: Floats) -> Floats:
    """Derivatives of views by the places of their pixels, (3, n, rows, bins), as (x, y, z).

    Args:
        scan: the scan.
        found: some of its views.
        by_column: derivatives by the column at which a pixel is seen upright, (n, rows, bins).
        by_row: and by the row.
    """
    axes = [0, 2, 1] if found.along_z else [0, 1, 2]
    k, i = (np.arange(n) - (n - 1) / 2 for n in (scan.bins, scan.rows))
    slopes = np.empty((3, *by_column.shape))
    frames = _frames(found.upright.angles)
    scale = found.upright.source_to_detector / np.array(found.upright.pitch[::-1])
    for n, view in enumerate(found.views):
        # From the source, along the upright detector's rows, its columns and ahead.
        places = [
            reach + across * k + down * i[:, None]
            for reach, across, down in zip(
                frames[n] @ (scan.middle - scan.source)[view, axes],
                frames[n] @ scan.across[view, axes],
                frames[n] @ scan.down[view, axes],
                strict=True,
            )
        ]
        along, up = by_column[n] * scale[0] / places[2], by_row[n] * scale[1] / places[2]
        ahead = -(along * places[0] + up * places[1]) / places[2]
        slopes[:, n] = np.einsum("aij,ab->bij", np.stack([along, up, ahead]), frames[n])[axes]
    return slopes


def _angles(reach: Floats, normal: Floats) -> Floats:
    """Angles of upright detectors: those of the tilted ones, or where these lie, of the rays."""
    normal = normal * np.sign((reach * normal).sum(axis=1))[:, None]
    level = np.hypot(normal[:, 0], normal[:, 1]) >= _LEVEL * np.linalg.norm(normal, axis=1)
    ahead = np.where(level[:, None], normal, reach)
    angles: Floats = np.arctan2(-ahead[:, 0], ahead[:, 1])
    return angles


def _frames(angles: Floats) -> Floats:
    """Unit vectors along the rows, along the columns and ahead, of each view, (n, 3, 3)."""
    cosine, sine = np.cos(angles), np.sin(angles)
    zero, one = np.zeros_like(angles), np.ones_like(angles)
    vectors = [[cosine, sine, zero], [zero, zero, one], [-sine, cosine, zero]]
    frames: Floats = np.array(vectors).transpose(2, 0, 1)
    return frames


def _corners(scan: Vectors) -> Floats:
    """(1, k, i) of the outermost pixels, k and i counted from the detector's middle, (3, 4)."""
    k, i = (scan.bins - 1) / 2, (scan.rows - 1) / 2
    return np.array([[1.0, 1, 1, 1], [-k, k, -k, k], [-i, -i, i, i]])


def _check_ahead(views: NDArray[np.intp], forms: Floats, scan: Vectors) -> None:
    depth = forms[:, 2] @ _corners(scan)
    wide = np.abs(forms[:, 0] @ _corners(scan)) > _WIDEST * depth
    beside = ~(depth > 0).all(axis=1) | wide.any(axis=1)
    if beside.any():
        raise InputError(
            f"Vectors: view {views[beside.argmax()]} has rays at a right angle to its upright "
            "detector, or nearly: check the source, or leave out the detector's outer rows and "
            "columns"
        )


def _detectors(
    forms: Floats, scan: Vectors, grid: Grid, angles: Floats, source: Floats, depths: Floats
) -> Upright:
    """Upright detectors that hold what the tilted ones and the grid's shadow have in common."""
    to_detector = float(np.median(depths))
    frames = _frames(angles)
    # Columns and rows of the forms are per unit of tangent, whose steps should stay what they are.
    slopes = forms[:, :2, 1:] - forms[:, :2, :1] * forms[:, 2:, 1:]
    steps = np.hypot(slopes[..., 0], slopes[..., 1])
    step = np.median(steps, axis=0)
    seen = forms @ _corners(scan)
    pixels = seen[:, :2] / seen[:, 2:]
    shadow = _shadow(grid, angles, source)
    low = np.maximum(pixels.min(axis=2), shadow.min(axis=2)) / step
    high = np.minimum(pixels.max(axis=2), shadow.max(axis=2)) / step
    # Where a detector is upright, its pixels are those of the scan.
    shift = pixels[0, :, 0] / step % 1.0
    first = np.floor(np.min(low, axis=0) - shift).astype(int) - _BESIDE
    last = np.ceil(np.maximum(np.max(high, axis=0) - shift, first)).astype(int) + _BESIDE
    first, count = first + shift, last + 1 - first
    if (count > _LARGEST * max(scan.rows, scan.bins)).any():
        raise InputError(
            f"Vectors: upright detectors would have {count[1]} x {count[0]} pixels in the place of "
            f"{scan.rows} x {scan.bins}: views differ too much in size, or are seen too aslant"
        )
    return Upright(
        angles=angles,
        heights=source[:, 2],
        source_to_axis=-(frames[:, 2] * source).sum(axis=1),
        offsets=(frames[:, 0] * source).sum(axis=1),
        source_to_detector=to_detector,
        rows=int(count[1]),
        bins=int(count[0]),
        pitch=(float(step[1]) * to_detector, float(step[0]) * to_detector),
        center=(-float(first[1]), -float(first[0])),
    )


def _shadow(grid: Grid, angles: Floats, source: Floats) -> Floats:
    """Tangents (along rows, along columns) at which the grid's corners are seen, (n, 2, 8)."""
    half = np.array(grid.shape[::-1]) * grid.spacing[::-1] / 2
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, 8)
    places = signs * half[:, None] + np.array(grid.center[::-1])[:, None] - source[:, :, None]
    across, up, ahead = np.moveaxis(_frames(angles) @ places, 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        shadow = np.where(ahead[:, None] > 0, np.stack([across, up], axis=1) / ahead[:, None], 0)
    # A grid that is partly behind the source has no shadow that ends.
    bounded = (ahead > 0).all(axis=1)[:, None, None]
    found: Floats = np.where(bounded, shadow, np.where(signs[0] > 0, np.inf, -np.inf))
    return found


def _counted(forms: Floats, upright: Upright) -> Floats:
    """Forms in rows and columns from the upright detector's middle, and the way back."""
    counts = np.array([upright.bins, upright.rows])
    scale = upright.source_to_detector / np.array(upright.pitch[::-1])
    offset = np.array(upright.center[::-1]) - (counts - 1) / 2
    there = forms.copy()
    there[:, :2] = scale[:, None] * forms[:, :2] + offset[:, None] * forms[:, 2:]
    # From (u, v, 1) to (1, k, i); both lists stand as numerators, then their divisor, of (1, k, i)
    # and of (1, u, v).
    back = np.linalg.inv(there)[:, [1, 2, 0]][:, :, [2, 0, 1]]
    return np.concatenate([there.reshape(-1, 9), back.reshape(-1, 9)], axis=1)
