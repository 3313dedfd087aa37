"""The projector of a cone by slabs, from first principles.

A view crosses planes of samples, its slabs: those across y where it looks along y rather than
along x, else those across x. Along the detector's rows a sample's shadow ends where its edges are
seen. Along its columns everything is seen twice: first in rows ``q`` apart of a detector that
stands along the slabs, where a sample at z above the source, in a slab at the distance e from it,
has its shadow at ``S z / e``, whatever its fan angle,

    seen[n] = sum over samples of  area / (p_u p_v) (S / e)^2 / q^2 * column_share * row_share * x,

and then in the rows of the real one, to which a column passes them on by cubic convolution, since
its ray leaves the slabs at the slope d,

    y[i] = (q d)^2 sum over n of  weight(q d n + center - i) * seen[n] * length,

with the length of the ray over its reach. ``q`` is one row of the detector, unless a shadow is more
than 7 of them: it is a seventh of the largest one then, and the convolution's kernel is as wide as
``q d``, integrated over the detector's rows. The footprint ``point`` takes samples for points
instead: shares are those of linear interpolation, ``q`` is half a row, and as far as the detector
reaches the cubic takes what it misses beyond its rows from the straight line through two of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.geometry import Cone, Grid

Floats = NDArray[np.float64]


class ConeProjector:
    """A pair of projection and backprojection, exactly adjoint since both read one matrix.

    Args:
        grid: the volume, (nz, ny, nx).
        scan: how it is looked at.
        footprint: ``strip``, ``linear`` or ``point``.
    """

    def __init__(self, grid: Grid, scan: Cone, footprint: str = "strip") -> None:
        shadow = max(_row_shadow(grid, scan, view) for view in range(scan.views))
        pitch = 0.5 if footprint == "point" else max(1.0, shadow / 7)
        views = [_view(grid, scan, view, footprint, pitch) for view in range(scan.views)]
        self.matrix = np.concatenate(views)
        self._domain, self._range = grid.shape, (scan.views, scan.rows, scan.bins)

    def project(self, volume: ArrayLike) -> Floats:
        """Projections (views, rows, bins) of a volume."""
        seen: Floats = self.matrix @ np.asarray(volume, float).ravel()
        return seen.reshape(self._range)

    def backproject(self, projections: ArrayLike) -> Floats:
        """Volume of projections: the transposed matrix applied to them."""
        back: Floats = self.matrix.T @ np.asarray(projections, float).ravel()
        return back.reshape(self._domain)


def _slabs(grid: Grid, scan: Cone, view: int) -> tuple[bool, Floats]:
    """Whether a view is seen in slabs across y, and their distances from the source."""
    angle, (_, dy, dx) = scan.angles[view], grid.spacing
    if dx * abs(np.cos(angle)) >= dy * abs(np.sin(angle)):
        return True, np.abs(grid.coordinates(1) + scan.source_to_axis * np.cos(angle))
    return False, np.abs(grid.coordinates(2) - scan.source_to_axis * np.sin(angle))


def _row_shadow(grid: Grid, scan: Cone, view: int) -> float:
    distances = _slabs(grid, scan, view)[1]
    shadow = scan.source_to_detector * grid.spacing[0] / scan.pitch[0] / distances.min()
    return float(shadow) * (1 + 1e-4)


def _view(grid: Grid, scan: Cone, view: int, footprint: str, q: float) -> Any:
    """The matrix of one view, (rows * bins, nz * ny * nx)."""
    angle, height = scan.angles[view], scan.heights[view]
    (dz, dy, dx), (z, y, x) = grid.spacing, (grid.coordinates(axis) for axis in range(3))
    across_y, distances = _slabs(grid, scan, view)
    lines, slabs, step = (x, y, dx) if across_y else (y, x, dy)
    reach, (row_pitch, pitch) = scan.source_to_detector, scan.pitch
    gamma = scan.fan_angles()
    turned = angle - gamma
    slopes = np.abs(np.cos(turned) if across_y else np.sin(turned))
    slopes = slopes if scan.curved else slopes / np.cos(gamma)
    columns = np.arange(scan.bins) - scan.center[1]
    passed, numbers = _passed_on(scan, q * slopes, wide=q > 1, continued=footprint == "point")
    matrix = np.zeros((scan.rows, scan.bins, len(z), len(y), len(x)))
    for j, (slab, distance) in enumerate(zip(slabs, distances, strict=True)):
        edges = np.stack([lines - step / 2, lines + step / 2])
        place = (edges, slab) if across_y else (slab, edges)
        seen = _column(scan, angle, *place) / pitch
        column_shares = _shares(columns, seen, footprint)
        edges = np.stack([z - dz / 2, z + dz / 2]) - height
        row_shares = _shares(numbers, reach * edges / distance / row_pitch / q, footprint)
        weight = dz * dy * dx * (reach / distance) ** 2 / (pitch * row_pitch) / q**2
        rows = np.einsum("inu,nz->iuz", passed, row_shares)
        part = weight * np.einsum("iuz,ua->iuza", rows, column_shares)
        if across_y:
            matrix[:, :, :, j, :] = part
        else:
            matrix[:, :, :, :, j] = part
    return (matrix * _lengths(scan)).reshape(scan.rows * scan.bins, -1)


def _passed_on(scan: Cone, steps: Floats, *, wide: bool, continued: bool) -> tuple[Floats, Floats]:
    """Weights in the detector's rows of those along the slabs, (rows, n, bins), and their n."""
    reach = 1 + 2 * max(1.0, steps.max())
    ends = (np.array([-reach, scan.rows - 1 + reach]) - scan.center[0])[:, None] / steps
    numbers = np.arange(np.floor(ends.min()), np.ceil(ends.max()) + 1)
    places = numbers[:, None] * steps + scan.center[0]
    off = places - np.arange(scan.rows)[:, None, None]
    if continued:
        return steps**2 * _continued(places, scan.rows), numbers
    if not wide:
        return steps**2 * _cubic(off), numbers
    weights = _cubic_integral((off + 0.5) / steps) - _cubic_integral((off - 0.5) / steps)
    return steps**2 * weights, numbers


def _continued(places: Floats, rows: int) -> Floats:
    """Weights of rows by the cubic, beyond whose ends the detector goes on in a straight line."""
    weights = _cubic(places - np.arange(rows)[:, None, None])
    within = (places >= -0.5) & (places <= rows - 0.5)
    for n in (1, 2):
        for beyond, end, inner in ((-n, 0, 1), (rows - 1 + n, rows - 1, rows - 2)):
            missed = within * _cubic(places - beyond)
            weights[end] += (n + 1 if rows > 1 else 1) * missed
            if rows > 1:
                weights[inner] -= n * missed
    return weights


def _column(scan: Cone, angle: float, x: Any, y: Any) -> Any:
    """Where points are seen along a row, from the foot of the source, as a length."""
    aside = x * np.cos(angle) + y * np.sin(angle)
    depth = scan.source_to_axis - x * np.sin(angle) + y * np.cos(angle)
    seen = np.arctan2(aside, depth) if scan.curved else aside / depth
    return scan.source_to_detector * seen


def _lengths(scan: Cone) -> Floats:
    v = (np.arange(scan.rows) - scan.center[0]) * scan.pitch[0]
    u = (np.arange(scan.bins) - scan.center[1]) * scan.pitch[1] * (not scan.curved)
    lengths = np.sqrt(scan.source_to_detector**2 + v[:, None] ** 2 + u**2)
    return (lengths / scan.source_to_detector)[:, :, None, None, None]


def _shares(entries: Any, edges: Any, footprint: str) -> Floats:
    """What each entry receives of samples whose shadows end at ``edges``, (entries, samples)."""
    low, high = edges.min(axis=0), edges.max(axis=0)
    middle, width = (low + high) / 2, high - low
    if footprint == "strip":
        above = np.minimum(high, entries[:, None] + 0.5) - np.maximum(low, entries[:, None] - 0.5)
        overlaps: Floats = np.maximum(above, 0) / width
        return overlaps
    half_width = np.ones_like(width) if footprint == "point" else np.maximum(1, width)

    def heights(at: Any) -> Floats:
        found: Floats = np.maximum(0, 1 - np.abs(at - middle) / half_width)
        return found

    # Entries that do not exist take their part as well.
    first = entries[0] + np.floor(middle - half_width - entries[0])
    every = first + np.arange(np.ceil(2 * half_width.max()) + 2)[:, None]
    shares: Floats = heights(entries[:, None]) / heights(every).sum(axis=0)
    return shares


def _cubic(distance: Floats) -> Floats:
    """The kernel of cubic convolution (Keys 1981)."""
    d = np.minimum(np.abs(distance), 2)
    far = 2 - 4 * d + 2.5 * d**2 - 0.5 * d**3
    return np.where(d < 1, 1 - 2.5 * d**2 + 1.5 * d**3, far)


def _cubic_integral(distance: Floats) -> Floats:
    """Of the kernel of cubic convolution, from 0 on."""
    d = np.minimum(np.abs(distance), 2)
    near = d - 2.5 / 3 * d**3 + 0.375 * d**4
    far = 2 * d - 2 * d**2 + 2.5 / 3 * d**3 - 0.125 * d**4 - 1 / 6
    return np.sign(distance) * np.where(d < 1, near, far)
