"""The X-ray transform of a slice through a fan as a matrix: what the fan's kernels evaluate.

The strip of a bin lies between the rays to its two edges. In a row of pixels (a column, where the
view looks along x) it cuts a part from each pixel; the bin's value is the sum over rows of the
pixels' values, weighted by these parts over the strip's width in pixels in the middle of the row,
times the length of the central ray in the row: a mean over rays side by side. The hats of
``joseph`` and ``linear`` stand for the parts where rays alone are looked at. A bin of which an edge
runs beside the rows, or away from them, is endlessly wide: it has nothing of any pixel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from rift_cl.geometry import Fan, Grid
from rift_cl.reference.matrix import MatrixProjector

Floats = NDArray[np.float64]


def fan(grid: Grid, scan: Fan, footprint: str = "strip", depth_power: int = 1) -> MatrixProjector:
    """The projector whose matrix is that of ``fan_matrix``."""
    return MatrixProjector(fan_matrix(grid, scan, footprint, depth_power), grid, scan)


def fan_matrix(grid: Grid, scan: Fan, footprint: str = "strip", depth_power: int = 1) -> Any:
    """The matrix of the transform, sparse (angles * bins, ny * nx), in the unit of length.

    Args:
        grid: the image.
        scan: how it is looked at.
        footprint: ``strip``, ``joseph`` or ``linear``.
        depth_power: 2 for weights over the depth of the pixel's slab on the bin's ray.
    """
    views = [_view(grid, scan, angle, footprint, depth_power) for angle in scan.angles]
    return sparse.csr_matrix(np.concatenate(views))


def _view(grid: Grid, scan: Fan, angle: float, footprint: str, depth_power: int) -> Floats:
    cosine, sine = np.cos(angle), np.sin(angle)
    source = scan.source_to_axis * np.array([sine, -cosine])
    ahead, across = np.array([-sine, cosine]), np.array([cosine, sine])
    x, y = grid.coordinates(1), grid.coordinates(0)
    dy, dx = grid.spacing
    middle = np.array([grid.center[1], grid.center[0]]) - source
    columns, rows = abs(middle[0]) / dx, abs(middle[1]) / dy
    along_y = rows >= columns * (1 - 1e-12)
    # Slabs beside the source would have rays that never come to them.
    if min(rows - len(y) / 2, columns - len(x) / 2) < 0.5:
        along_y = rows - len(y) / 2 > columns - len(x) / 2
    lines, slabs, to_line, to_slab = (x, y, dx, dy) if along_y else (y, x, dy, dx)
    line, slab = (0, 1) if along_y else (1, 0)

    def slopes(places: NDArray[Any]) -> Floats:
        """Pixels that the rays to these bins go on by from slab to slab, NaN of those beside."""
        gamma = (places - scan.center) * scan.pitch / scan.source_to_detector
        gamma = gamma if scan.curved else np.arctan(gamma)
        way = np.cos(gamma)[:, None] * ahead + np.sin(gamma)[:, None] * across
        seen: Floats = way[:, line] / to_line / (way[:, slab] / to_slab)
        return np.where(way[:, slab] * middle[slab] > 0, seen, np.nan)

    bins = np.arange(scan.bins)
    edges, middles = slopes(np.arange(scan.bins + 1) - 0.5), slopes(bins)
    lengths = np.hypot(middles * to_line, to_slab)
    found = np.zeros((scan.bins, len(lines), len(slabs)))
    pixels = np.arange(len(lines))
    for b, place in enumerate(slabs):
        depth = (place - source[slab]) / to_slab
        first = (source[line] - lines[0]) / to_line
        width = np.abs(np.diff(depth * edges))
        if footprint == "strip":
            before = _before(first + depth * edges[:, None] - pixels, np.abs(edges)[:, None])
            share = np.abs(np.diff(before, axis=0)) / width[:, None]
        else:
            half = np.maximum(1, width)[:, None] if footprint == "linear" else 1.0
            distance = first + depth * middles[:, None] - pixels
            share = np.maximum(0, 1 - np.abs(distance) / half) / half
        if depth_power == 2:
            ray = depth * np.stack([middles * to_line, np.full(scan.bins, to_slab)], axis=1)
            away = np.linalg.norm(ray, axis=1) if scan.curved else np.abs(ray @ ahead[[line, slab]])
            share = share * (scan.source_to_axis / away)[:, None]
        found[:, :, b] = np.nan_to_num(share * lengths[:, None])
    view: Floats = (found.transpose(0, 2, 1) if along_y else found).reshape(scan.bins, -1)
    return view


def _before(distance: Floats, slant: Floats) -> Floats:
    """The part of a pixel of one that lies before an edge, aslant by so much, at a distance."""
    short, long = np.minimum(slant, 1), np.maximum(slant, 1)
    inside = np.maximum(0, (1 + slant) / 2 - np.abs(distance))
    ramp = np.minimum(inside, short)
    end = (ramp**2 / (2 * np.maximum(short, 1e-12)) + inside - ramp) / long
    part: Floats = np.where(distance > 0, 1 - end, end)
    return part
