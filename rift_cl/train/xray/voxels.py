"""Splats as voxels: slices for reports, and the linear system of a start from a volume.

A pixel is a mean over a little square and a voxel one over a little cube. The rasterizer stands for
the square by a dilation that keeps every splat's mass; the same dilation along all three axes makes
slices whose projections are what the rasterizer draws. Gaussians of a few voxels are little work:
NumPy does it, some ten million samples a second, a few times in a fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Grid

# Gaussians end at so many standard deviations or farther: what is left out has 2e-3 of the peak.
_EXTENT = 3.5
# Samples that are worked on together.
_TOGETHER = 1 << 21

Floats = NDArray[np.float64]


class Footprints:
    """The samples of N Gaussians of peak 1 on a grid: a matrix of N columns that is never stored.

    Args:
        grid: (nz, ny, nx).
        means: (N, 3) positions (x, y, z) in the grid's unit.
        quats: (N, 4) rotations (w, x, y, z).
        scales: (N, 3) standard deviations.
        dilation: variance that every Gaussian gains along the axes (x, y, z), one for all or one
            for each, while its mass stays.
    """

    def __init__(
        self,
        grid: Grid,
        means: Floats,
        quats: Floats,
        scales: Floats,
        *,
        dilation: float | Sequence[float] | Floats = 0.0,
    ) -> None:
        self.grid = grid
        self._spacing = np.array(grid.spacing[::-1])
        self._counts = np.array(grid.shape[::-1])
        first = [grid.coordinates(axis)[0] for axis in (2, 1, 0)]
        # In steps of the grid, from its first sample on.
        self._places = (np.asarray(means, float) - first) / self._spacing
        shapes = covariances(np.asarray(quats, float), np.asarray(scales, float))
        wider = shapes + np.eye(3) * np.asarray(dilation)
        self._peaks = np.sqrt(np.linalg.det(shapes) / np.linalg.det(wider))
        self._inverses = np.linalg.inv(wider) * np.multiply.outer(self._spacing, self._spacing)
        reach = _EXTENT * np.sqrt(np.diagonal(wider, axis1=1, axis2=2)) / self._spacing
        # A box holds a Gaussian, and never more than the grid.
        self._widths = np.minimum(2 * np.ceil(reach).astype(np.int64) + 1, self._counts)

    def __len__(self) -> int:
        """N."""
        return len(self._places)

    def sums(self, weights: Floats) -> Floats:
        """The sum of all Gaussians times their (N,) weights, (nz, ny, nx)."""
        total = np.zeros(int(self._counts.prod()))
        for splats, voxels, values in self._blocks():
            scaled = values * weights[splats, None]
            total += np.bincount(voxels.ravel(), scaled.ravel(), minlength=total.size)
        return total.reshape(self.grid.shape)

    def inner_products(self, volume: Floats) -> Floats:
        """The sum over the grid of each Gaussian times the volume, (N,)."""
        flat, found = volume.ravel(), np.empty(len(self))
        for splats, voxels, values in self._blocks():
            found[splats] = (values * flat[voxels]).sum(axis=1)
        return found

    def _blocks(self) -> Iterator[tuple[NDArray[np.intp], NDArray[np.int64], Floats]]:
        """Splats whose boxes are alike: their numbers, (n, k) samples and (n, k) values."""
        order = np.lexsort(self._widths.T)
        edges = np.flatnonzero((np.diff(self._widths[order], axis=0) != 0).any(axis=1)) + 1
        for alike in np.split(order, edges):
            if alike.size == 0:
                continue
            box = np.stack(
                np.meshgrid(*(np.arange(w) for w in self._widths[alike[0]]), indexing="ij"),
                axis=-1,
            ).reshape(-1, 3)
            step = max(1, _TOGETHER // len(box))
            for begin in range(0, alike.size, step):
                splats = alike[begin : begin + step]
                yield (splats, *self._values(splats, box))

    def _values(
        self, splats: NDArray[np.intp], box: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Floats]:
        places, widths = self._places[splats], self._widths[splats]
        first = np.rint(places).astype(np.int64) - widths // 2
        voxels = np.clip(first, 0, self._counts - widths)[:, None] + box
        away = voxels - places[:, None]
        square = ((away @ self._inverses[splats]) * away).sum(axis=-1)
        x, y, z = np.moveaxis(voxels, -1, 0)
        flat = (z * self._counts[1] + y) * self._counts[0] + x
        return flat, self._peaks[splats, None] * np.exp(-0.5 * square)


def covariances(quats: Floats, scales: Floats) -> Floats:
    """R S S^T R^T of quaternions (w, x, y, z) and scales: (N, 3, 3)."""
    with np.errstate(all="ignore"):
        w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    zero = np.zeros_like(w)
    # Rodrigues: R = 1 + 2 w [v] + 2 [v]^2 with [v] the matrix of the cross product.
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    rotation = np.eye(3) + 2 * w[:, None, None] * cross + 2 * cross @ cross
    root = rotation * scales[:, None, :]
    return np.asarray(root @ root.transpose(0, 2, 1))
