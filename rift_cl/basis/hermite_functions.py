"""Hermite functions of one variable, in the two forms, by recurrences that do not overflow.

    der: e_n(x) = He_n(x) exp(-x^2 / 2) / sqrt(n!) = (-d/dx)^n exp(-x^2 / 2) / sqrt(n!)
    std: h_n(x) = (2^n n! sqrt(pi))^(-1/2) H_n(x) exp(-x^2 / 2), orthonormal

He and H are the probabilists' and the physicists' Hermite polynomials (Abramowitz and Stegun,
22.1; Refregier 2003 for ``std`` as shapelets; Siegman 1973 for ``der``, the elegant modes). Both
span the same functions order by order; derivatives, projection and blur are simple in ``der``, the
inner product and the Fourier transform in ``std``.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Form = Literal["der", "std"]
FloatArray = NDArray[np.float64]
# In whitened units.
_FAR = 1e3


def he_polynomials(x: NDArray[Any], order: int) -> FloatArray:
    """He_n(x) / sqrt(n!) for n = 0..order, (..., order + 1), without the Gaussian."""
    return _he_ladder(np.ones_like(x), x, order)


def functions(x: NDArray[Any], order: int, form: Form) -> FloatArray:
    """e_n(x) or h_n(x) for n = 0..order.

    Args:
        x: (...) float64.
        order: highest n.
        form: which of the two.

    Returns:
        (..., order + 1).
    """
    x = nearby(x)
    gaussian = np.exp(-x * x / 2)
    if form == "der":
        return _he_ladder(gaussian, x, order)
    table = [math.pi**-0.25 * gaussian]
    for n in range(order):
        below = math.sqrt(n / (n + 1)) * table[n - 1] if n else 0.0
        table.append(math.sqrt(2 / (n + 1)) * x * table[n] - below)
    return np.stack(table, -1)


def nearby(x: NDArray[Any]) -> NDArray[Any]:
    """Positions without those so far out that powers overflow; the Gaussian is 0 long before."""
    return np.asarray(np.clip(x, -_FAR, _FAR))


def derivatives(table: FloatArray, form: Form) -> FloatArray:
    """d/dx of all but the last function in a table of ``functions``.

    e_n' = -sqrt(n + 1) e_(n+1); h_n' = sqrt(n / 2) h_(n-1) - sqrt((n + 1) / 2) h_(n+1).

    Args:
        table: (..., order + 2).
        form: of the table.

    Returns:
        (..., order + 1).
    """
    n = np.arange(table.shape[-1] - 1)
    if form == "der":
        return np.asarray(-np.sqrt(n + 1) * table[..., 1:])
    slopes = -np.sqrt((n + 1) / 2) * table[..., 1:]
    slopes[..., 1:] += np.sqrt(n[1:] / 2) * table[..., : len(n) - 1]
    return np.asarray(slopes)


def products(tables: NDArray[Any], modes: NDArray[np.intp]) -> NDArray[Any]:
    """Products over the dimensions.

    Args:
        tables: (..., dim, order + 1) of functions of one variable.
        modes: (K, dim) which of them.

    Returns:
        (..., K).
    """
    product = tables[..., 0, modes[:, 0]]
    for axis in range(1, modes.shape[1]):
        product = product * tables[..., axis, modes[:, axis]]
    return np.asarray(product)


@cache
def overlaps(order: int) -> FloatArray:
    """Integrals of e_m e_n over the line, (order + 1, order + 1); those of h_m h_n are 0 or 1.

    By parts they are derivatives at 0 of the Gaussian's autocorrelation sqrt(pi) exp(-t^2 / 4):
    sqrt(pi) (-1)^((n-m)/2) (m+n-1)!! / (2^((m+n)/2) sqrt(m! n!)) when m + n is even, and else 0.
    """
    table = np.zeros((order + 1, order + 1))
    for m in range(order + 1):
        for n in range(m % 2, order + 1, 2):
            half = (m + n) // 2
            # (2 half - 1)!! = (2 half)! / (2^half half!)
            log = math.lgamma(m + n + 1) - math.lgamma(half + 1) - 2 * half * math.log(2)
            log -= (math.lgamma(m + 1) + math.lgamma(n + 1)) / 2
            table[m, n] = (-1) ** ((n - m) // 2) * math.sqrt(math.pi) * math.exp(log)
    table.flags.writeable = False
    return table


def _he_ladder(first: NDArray[Any], x: NDArray[Any], order: int) -> FloatArray:
    table = [first]
    for n in range(order):
        below = math.sqrt(n) * table[n - 1] if n else 0.0
        table.append((x * table[n] - below) / math.sqrt(n + 1))
    return np.stack(table, -1)
