"""The sets of modes that additive splats are made of, as columns of graded Hermite modes in space.

Kernels know graded modes in three dimensions alone; a set is a matrix from its own coefficients to
those. Sets of the plane leave out modes across it, a row set of Laguerre's reaches beyond its name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis import Hermite, Laguerre, n_coeff, order_of, place
from rift_cl.basis.indices import graded
from rift_cl.basis.projection import gamma_matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModeSet:
    """Modes that a splat's coefficients are of.

    Args:
        name: for tables.
        matrix: (modes in space up to ``order``, own coefficients), normalised derivative form.
        geometry: numbers that place a splat: 5 in the plane, 9 in space.
    """

    name: str
    matrix: Floats
    geometry: int

    def even(self, gram: Floats) -> ModeSet:
        """The same set by modes that are orthonormal, which a solver takes fewer steps for.

        Args:
            gram: (modes in space) products of the graded modes as they are seen.
        """
        own = self.matrix.T @ gram @ self.matrix
        root = np.linalg.cholesky(own)
        return replace(self, matrix=np.linalg.solve(root, self.matrix.T).T)

    @property
    def order(self) -> int:
        """Highest total order of the modes in space."""
        return order_of(len(self.matrix), 3)

    @property
    def count(self) -> int:
        """Own coefficients of a channel."""
        return self.matrix.shape[1]

    def parameters(self, channels: int) -> int:
        """Numbers of a splat."""
        return self.geometry + self.count * channels

    def splats(self, budget: int, channels: int) -> int:
        """How many splats a number of parameters buys."""
        return max(1, round(budget / self.parameters(channels)))


def in_plane(order: int) -> ModeSet:
    """All modes of the plane up to a total order."""
    return ModeSet(_name(order), _across(np.eye(n_coeff(order, 2))), 5)


def laguerre_rows(rows: int) -> ModeSet:
    """The modes of the plane with p + |l| <= rows."""
    basis = Laguerre(rows, truncation="row")
    return ModeSet(f"LG row {rows}", _across(basis.to_hermite(np.eye(basis.n_coeff)).T), 5)


def in_space(order: int) -> ModeSet:
    """All modes of space up to a total order."""
    return ModeSet(_name(order), np.eye(n_coeff(order, 3)), 9)


def _name(order: int) -> str:
    return f"HG {order}" if order else "Gaussian"


def _across(plane: Floats) -> Floats:
    """Columns of graded modes (x, y) as columns of graded modes (x, y, z)."""
    order = order_of(len(plane), 2)
    rows = place(np.pad(graded(order, 2), ((0, 0), (0, 1))))
    space = np.zeros((n_coeff(order, 3), plane.shape[1]))
    space[rows] = plane
    return space


def seen_gram(order: int, projections: Sequence[Floats]) -> Floats:
    """Products of graded modes in space as views see them, the mean over the views.

    Args:
        order: highest of the modes.
        projections: (out, 3) of unit rows for each view, from a round splat to its picture.
    """
    total = np.zeros((n_coeff(order, 3), n_coeff(order, 3)))
    for rows in projections:
        to_screen = gamma_matrix(rows, order)
        seen = Hermite(order, len(rows)).gram()
        total += to_screen.T @ seen @ to_screen / len(projections)
    return total / total[0, 0]


def directions(count: int) -> list[Floats]:
    """Screens (2, 3) evenly over the directions of space, by Fibonacci's spiral."""
    k = np.arange(count) + 0.5
    z, phi = 1 - 2 * k / count, k * np.pi * (1 + np.sqrt(5))
    along = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], 1)
    return [np.linalg.svd(d[None])[2][1:] for d in along]
