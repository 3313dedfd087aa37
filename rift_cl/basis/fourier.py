"""Fourier transforms of Hermite functions, and what follows from them.

With fhat(k) = integral of f(x) exp(-i k.x) dx the derivative form becomes the polynomial itself,
e_n -> sqrt(2 pi) (-i k)^n exp(-k^2 / 2) / sqrt(n!), and the standard form is its own transform,
h_n -> sqrt(2 pi) (-i)^n h_n(k) (Refregier 2003). Restricted to k = A^T q the former is the slice
theorem: p(-i A^T q) is the symbol that ``projection`` gives to a projected splat.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.hermite_functions import Form, functions, nearby


def transforms(k: NDArray[Any], order: int, form: Form) -> NDArray[np.complex128]:
    """Transforms of the functions of one variable.

    Args:
        k: (...) angular frequencies, in radians per whitened unit.
        order: up to which.
        form: of the functions.

    Returns:
        (..., order + 1).
    """
    if form == "std":
        turns = (-1j) ** np.arange(order + 1)
        return np.asarray(math.sqrt(2 * math.pi) * turns * functions(k, order, "std"))
    k = nearby(k)
    table = [math.sqrt(2 * math.pi) * np.exp(-k * k / 2) + 0j]
    for n in range(order):
        table.append(table[n] * k * (-1j / math.sqrt(n + 1)))
    return np.stack(table, -1)
