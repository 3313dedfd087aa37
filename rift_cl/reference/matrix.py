"""A projector that is nothing but its matrix, in float64.

The rows of the matrix are the rays of a scan, view by view; its columns are the pixels of one
slice, row by row. Every slice of a volume is looked at in the same way.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.geometry import Fan, Grid, Parallel

Floats = NDArray[np.float64]


class MatrixProjector:
    """A pair of projection and backprojection, exactly adjoint since both read one matrix.

    Args:
        matrix: sparse (angles * bins, ny * nx) matrix.
        grid: the image (ny, nx) or volume (nz, ny, nx).
        scan: how it is looked at.
    """

    def __init__(self, matrix: Any, grid: Grid, scan: Parallel | Fan) -> None:
        self.matrix = matrix
        self._grid, self._scan = grid, scan

    def project(self, image: ArrayLike) -> Floats:
        """Sinogram (angles, bins) of an image, or stack (angles, nz, bins) of a volume."""
        slices = np.asarray(image, dtype=np.float64).reshape(self._grid.slices, -1)
        rays = (self.matrix @ slices.T).reshape(len(self._scan.angles), self._scan.bins, -1)
        rows = self._grid.shape[:-2]
        views: Floats = rays.transpose(0, 2, 1).reshape(len(rays), *rows, self._scan.bins)
        return views

    def backproject(self, sinogram: ArrayLike) -> Floats:
        """Image of a sinogram, or volume of a stack: the transposed matrix applied to it."""
        views = np.asarray(sinogram, dtype=np.float64)
        rays = views.reshape(len(views), self._grid.slices, -1).transpose(0, 2, 1)
        slices = self.matrix.T @ rays.reshape(-1, self._grid.slices)
        pixels: Floats = slices.T.reshape(self._grid.shape)
        return pixels
