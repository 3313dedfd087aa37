"""Matrices between sets of modes: Hermite and Laguerre, standard and derivative form.

Within a total order N Laguerre modes are a unitary mixture of Hermite modes (Abramochkin and
Volostnikov 1991; Beijersbergen et al. 1993; O'Neil and Courtial 2000):

    LG_(n+,n-) = sum_k U[k, n-] HG_(N-k,k),    U[k, n-] = i^k B[k, n-],
    B[k, n-] = sqrt((N-k)! k! / (2^N n+! n-!)) [t^k] (1 + t)^n+ (1 - t)^n-.

B is the symmetric power of [[1, 1], [1, -1]] / sqrt(2) and is made as such, by the ladder recursion
of ``projection.gamma``: unitary to 2e-14 at N = 64, while sums by the formula cancel (they are off
by 1e-7 at N = 80). As U acts on ladder operators alone, it is the same in both forms.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.hermite_functions import Form, products
from rift_cl.basis.indices import Kind, graded
from rift_cl.basis.projection import gamma
from rift_cl.errors import InputError

# Condition of the map between the forms: 2.3, 6.1, 17, 48, 137, 395 at N = 2, 4, ..., 12.
MAX_FORM_ORDER = 12


@cache
def laguerre_matrices(order: int, kind: Kind) -> tuple[NDArray[Any], ...]:
    """Laguerre modes written in Hermite modes, one unitary matrix per total order.

    Args:
        order: up to which.
        kind: complex modes in the order of descending l, U^T; or real ones in the order of
            descending l, cosine before sine, an orthogonal matrix T.

    Returns:
        For N = 0..order (N + 1, N + 1): row j holds the coefficients of Laguerre mode j in the
        Hermite modes (N, 0), (N - 1, 1), ...; read-only.
    """
    hadamard = np.array([[1.0, 1.0], [1.0, -1.0]]) / math.sqrt(2)
    matrices = [_phased(B) if kind == "complex" else _real(B) for B in gamma(hadamard, order)]
    for matrix in matrices:
        matrix.flags.writeable = False
    return tuple(matrices)


@cache
def form_matrix(order: int, dim: int, source: Form, to: Form) -> NDArray[np.float64]:
    """From coefficients of one form to those of the other, graded total sets, (K, K), read-only.

    H_n = sum_k n! / (k! (n-2k)!) 2^(n-2k) He_(n-2k) and its inverse, normalised, in each dimension.

    Raises:
        InputError: the order is above 12, where the map loses the digits that it should keep.
    """
    if order > MAX_FORM_ORDER:
        raise InputError(
            f"total order {order} cannot change its form from {source!r} to {to!r}: the map is too "
            f"ill-conditioned above order {MAX_FORM_ORDER}; keep to one form"
        )
    line = _form_line(order, to)
    modes = graded(order, dim)
    # What products() takes: for each source mode and dimension, a row of the map's columns.
    matrix = products(line.T[modes], modes).T
    matrix.flags.writeable = False
    return matrix


def _form_line(order: int, to: Form) -> NDArray[np.float64]:
    """The map of one variable, (to, from)."""
    line = np.zeros((order + 1, order + 1))
    for n in range(order + 1):
        for k in range(n // 2 + 1):
            j = n - 2 * k
            share = math.sqrt(math.factorial(n) / math.factorial(j)) / math.factorial(k)
            if to == "der":
                line[j, n] = math.pi**-0.25 * share * 2.0 ** (n / 2 - 2 * k)
            else:
                line[j, n] = math.pi**0.25 * share * (-1) ** k * 2.0 ** (-n / 2 - k)
    return line


def _phased(B: NDArray[np.float64]) -> NDArray[np.complex128]:
    # The powers of i, without the rounding of a power.
    return np.asarray((np.array([1, 1j, -1, -1j])[np.arange(len(B)) % 4, None] * B).T)


def _real(B: NDArray[np.float64]) -> NDArray[np.float64]:
    """Real modes: sqrt 2 times the real and imaginary parts of the columns with l > 0."""
    U = _phased(B)
    T = np.empty(B.shape)
    half = (len(B) + 1) // 2
    T[0::2] = U[:half].real * math.sqrt(2)
    T[1::2] = U[: len(B) // 2].imag * math.sqrt(2)
    if len(B) % 2:
        T[-1] = U[half - 1].real
    return T
