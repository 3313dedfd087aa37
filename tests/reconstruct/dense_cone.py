"""Line integrals of a cone as a sparse matrix on the host: each voxel spread over four bins."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, vstack

from rift_cl.cl.elementwise import copy
from rift_cl.cl.host_arrays import download
from rift_cl.operators import LinearOperator


class DenseCone(LinearOperator):
    """The projector of a cone, by its definition, for small grids."""

    def __init__(self, grid, scan, device):
        super().__init__(grid.shape, (scan.views, scan.rows, scan.bins), device)
        self.grid, self.scan = grid, scan
        self._matrix = vstack([_view(grid, scan, k) for k in range(scan.views)]).tocsr()

    def _apply(self, x, out):
        self._put(self._matrix @ download(self.device, x).ravel().astype(float), out)

    def _apply_adjoint(self, y, out):
        self._put(self._matrix.T @ download(self.device, y).ravel().astype(float), out)

    def _put(self, values, out):
        copy(self.device, self.device.array(values.reshape(out.shape), self.dtype), out)


def _view(grid, scan, view):
    z, y, x = np.meshgrid(*(grid.coordinates(axis) for axis in range(3)), indexing="ij")
    angle, S, pitch = scan.angles[view], scan.source_to_detector, scan.pitch
    depth = scan.source_to_axis - x * np.sin(angle) + y * np.cos(angle)
    across = x * np.cos(angle) + y * np.sin(angle)
    u = S * np.arctan2(across, depth) if scan.curved else S * across / depth
    reach = np.hypot(across, depth) if scan.curved else depth
    v = S * (z - scan.heights[view]) / reach
    weight = (np.prod(grid.spacing) * S / (reach**2 * pitch[0] * pitch[1])).ravel()
    column, row = (u / pitch[1] + scan.center[1]).ravel(), (v / pitch[0] + scan.center[0]).ravel()
    rows, columns, values = [], [], []
    for i in (np.floor(row), np.floor(row) + 1):
        for k in (np.floor(column), np.floor(column) + 1):
            seen = (k >= 0) & (k < scan.bins) & (i >= 0) & (i < scan.rows)
            hat = (1 - np.abs(row - i)) * (1 - np.abs(column - k)) * weight
            rows.append((i * scan.bins + k)[seen].astype(int))
            columns.append(np.flatnonzero(seen))
            values.append(hat[seen])
    shape = scan.rows * scan.bins, x.size
    places = np.concatenate(rows), np.concatenate(columns)
    matrix = csr_array((np.concatenate(values), places), shape)
    gamma = scan.fan_angles()
    flat = S * np.ones(scan.bins) if scan.curved else S / np.cos(gamma)
    rise = (np.arange(scan.rows) - scan.center[0])[:, None] * pitch[0]
    return matrix.multiply(np.hypot(flat, rise).ravel()[:, None])
