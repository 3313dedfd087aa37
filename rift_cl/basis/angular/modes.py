"""Hermite- and Laguerre-Gaussian modes of a plane, in standard form, with their derivatives.

Both are orthonormal sets in graded order. An order N has N + 1 modes of either kind, which span
the same functions: Laguerre modes and their derivatives are mixtures of the Hermite ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis import hermite_functions as hermite
from rift_cl.basis.conversion import laguerre_matrices
from rift_cl.basis.indices import graded

Floats = NDArray[np.float64]


class PlaneModes(NamedTuple):
    """K modes at points: (..., K) values, and derivatives by x and by y."""

    values: Floats
    by_x: Floats
    by_y: Floats


def hermite_modes(x: Floats, y: Floats, count: int) -> PlaneModes:
    """The first modes h_m(x) h_n(y), in the order (0,0), (1,0), (0,1), (2,0), (1,1)..

    h_n is H_n(x) exp(-x^2 / 2) / sqrt(2^n n! sqrt(pi)), H_n the physicists' polynomials.
    """
    order = _order(count)
    modes = graded(order, 2)[:count]
    table = hermite.functions(np.stack([x, y], -1), order + 1, "std")
    steep = hermite.derivatives(table, "std")
    flat = table[..., : order + 1]
    by_x = np.stack([steep[..., 0, :], flat[..., 1, :]], -2)
    by_y = np.stack([flat[..., 0, :], steep[..., 1, :]], -2)
    return PlaneModes(*(hermite.products(tables, modes) for tables in (flat, by_x, by_y)))


def laguerre_modes(x: Floats, y: Floats, count: int) -> PlaneModes:
    """The first real modes, by total order 2 p + l; l goes down, cosine before sine.

    For l > 0 they are sqrt(2) Re and sqrt(2) Im of
    (-1)^p sqrt(p! / (pi (p + l)!)) (x + i y)^l L_p^l(r^2) exp(-r^2 / 2); for l = 0 that itself.
    """
    order = _order(count)
    whole_orders = hermite_modes(x, y, len(graded(order, 2)))
    mixtures = laguerre_matrices(order, "real")
    ends = np.cumsum([len(matrix) for matrix in mixtures])[:-1]

    def mixed(modes: Floats) -> Floats:
        parts = np.split(modes, ends, axis=-1)
        mixes = [part @ matrix.T for part, matrix in zip(parts, mixtures, strict=True)]
        return np.concatenate(mixes, -1)[..., :count]

    return PlaneModes(*(mixed(modes) for modes in whole_orders))


def _order(count: int) -> int:
    """The lowest order that has this many modes up to it."""
    return next(n for n in range(count + 1) if (n + 1) * (n + 2) // 2 >= count)
