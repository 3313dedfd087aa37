"""The small problems that solvers are tested on, and an operator that is nothing but a matrix."""

from __future__ import annotations

from functools import cache

import numpy as np

from rift_cl import Grid, LinearOperator, Parallel, Projector
from rift_cl.reconstruct.solvers.conjugate_gradients import Cgls
from rift_cl.reconstruct.solvers.fista import Fista
from rift_cl.reconstruct.solvers.pdhg import Pdhg
from rift_cl.reconstruct.solvers.simultaneous_iteration import Sirt
from rift_cl.reference import phase_table

GRID = Grid((22, 25), spacing=(1.0, 0.8))
SCAN = Parallel(np.linspace(0, np.pi, 18, endpoint=False) + 0.01, bins=33, pitch=0.9)
METHODS = {
    "cgls": Cgls,
    "sirt": Sirt,
    "fista": lambda A, y, **given: Fista(A, y, 0.02, **given),
    "pdhg": lambda A, y, **given: Pdhg(A, y, 0.02, **given),
}


class Matrix(LinearOperator):
    """A matrix between arrays of any shapes, without grid or scan."""

    def __init__(self, matrix, domain, range, device, dtype="float32"):
        super().__init__(domain, range, device, dtype)
        self.matrix = np.asarray(matrix)

    def _apply(self, x, out):
        out.set((self.matrix @ x.get().ravel()).reshape(self.range).astype(self.dtype))

    def _apply_adjoint(self, y, out):
        out.set((self.matrix.T @ y.get().ravel()).reshape(self.domain).astype(self.dtype))


@cache
def twin_matrix(grid, scan):
    """The matrix that the projector is, made once."""
    return phase_table(grid, scan).matrix


def problem(device, *, noise=0.0, scan=SCAN, grid=GRID, dtype="float32"):
    """A projector, its matrix, a smooth image and its noisy data."""
    A = Projector(grid, scan, device=device, dtype=dtype)
    matrix = twin_matrix(grid, scan)
    y, x = np.meshgrid(*(grid.coordinates(axis) for axis in (0, 1)), indexing="ij")
    truth = np.exp(-((x - 1) ** 2 + (y + 2) ** 2) / 18) + (np.hypot(x + 2, y - 1) < 5) * 0.6
    data = matrix @ truth.ravel()
    data += noise * np.random.default_rng(5).standard_normal(data.size)
    return A, matrix, truth, data.reshape(A.range).astype(dtype)


def soft_disc(grid):
    """An ellipse with a soft edge, in the middle of a grid."""
    y, x = np.meshgrid(grid.coordinates(0), grid.coordinates(1), indexing="ij")
    return 1 / (1 + np.exp((np.hypot(x / 14, y / 9) - 1) * 9))


def dense(operator):
    """The matrix of a small operator."""
    units = np.eye(int(np.prod(operator.domain)), dtype=operator.dtype)
    return np.stack([operator(unit.reshape(operator.domain)).ravel() for unit in units], axis=1)


def finished(solver, steps):
    """Run to the end; the reports."""
    return list(solver.run(steps))
