"""Linear changes of the variable: what projecting, blurring or turning does to coefficients.

A function in derivative form is f(x) = p(-d/dx) g(x), with g = exp(-|x|^2 / 2) and the polynomial
p(s) = sum_n c_n s^n / sqrt(n!). Seen through u = A x, which sends the Gaussian to a Gaussian, its
derivatives become d/dx = A^T d/du, so that its symbol becomes p(A^T t): every total order is mapped
into itself, by the symmetric power Gamma_N(A) of A. Gamma(A) Gamma(B) = Gamma(A B), Gamma(A^T) =
Gamma(A)^T, and A A^T <= I makes it a contraction: it never amplifies an error. Blurring by a wider
Gaussian is such an A, and so is a rotation, and (complex) the step from Hermite to Laguerre.

The symmetric power is made from ladders, a_i+ of the rows and a_i of the columns:

    d Gamma_N / d A_ai = a_a+ Gamma_(N-1) a_i,    Gamma_N = (1 / N) sum_ai A_ai d Gamma_N / d A_ai,

the latter being Euler's theorem on homogeneous polynomials. For A = [[1, 1], [1, -1]] / sqrt(2) it
is the mean of the two ladder routes that keeps the matrix between Hermite and Laguerre accurate.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis.indices import n_coeff, of_order, order_slices, place_in_order
from rift_cl.basis.numbers import numbers, together, vectors
from rift_cl.errors import ShapeError


def gamma(A: ArrayLike, order: int) -> list[NDArray[Any]]:
    """The symmetric powers of a matrix: how each total order of coefficients is mapped.

    Args:
        A: (..., out, in), out and in from 1 to 3, real or complex.
        order: up to which.

    Returns:
        For N = 0..order an array (..., K_N(out), K_N(in)), K_N(dim) the modes of total order N,
        graded, in the normalised derivative basis.

    Raises:
        InputError: A has another shape or holds no finite numbers, or the order is out of range.
    """
    A = _matrix(A)
    rows, columns = A.shape[-2:]
    of_order(order, rows)
    blocks = [np.ones((*A.shape[:-2], 1, 1), A.dtype)]
    for n in range(1, order + 1):
        up, weight_up = _lowered(n, rows)
        down, weight_down = _lowered(n, columns)
        block = np.zeros((*A.shape[:-2], len(up), len(down)), A.dtype)
        for a in range(rows):
            for i in range(columns):
                weight = np.outer(weight_up[:, a], weight_down[:, i]) / n
                step = blocks[-1][..., up[:, a, None], down[None, :, i]]
                block += A[..., a, i, None, None] * weight * step
        blocks.append(block)
    return blocks


def gamma_matrix(A: ArrayLike, order: int) -> NDArray[Any]:
    """``gamma`` of one matrix (out, in) as one block-diagonal matrix, (K(out), K(in)).

    Raises:
        InputError: as ``gamma`` does, or there is more than one matrix.
    """
    A = _matrix(A)
    if A.ndim != 2:
        raise ShapeError(f"A has shape {A.shape}, wanted one matrix (out, in)")
    return np.asarray(scipy.linalg.block_diag(*gamma(A, order)))


def project(coeff: ArrayLike, A: ArrayLike, order: int) -> NDArray[Any]:
    """Gamma(A) c.

    Args:
        coeff: (..., K(in)), up to total order ``order``, normalised derivative form.
        A: (..., out, in).
        order: of the coefficients.

    Returns:
        (..., K(out)) coefficients.

    Raises:
        InputError: shapes do not fit, or a number is not finite.
    """
    A = _matrix(A)
    columns = A.shape[-1]
    coeff = vectors(coeff, "coeff", n_coeff(order, columns), allow_complex=True)
    together(coeff, A, "A", 2)
    parts = [
        np.einsum("...mn,...n->...m", block, coeff[..., part])
        for block, part in zip(gamma(A, order), order_slices(order, columns), strict=True)
    ]
    return np.concatenate(parts, -1)


def project_vjp(
    coeff: ArrayLike, A: ArrayLike, order: int, cotangent: ArrayLike
) -> tuple[NDArray[Any], NDArray[Any]]:
    """How a loss changes with the coefficients and with A, real all of them.

    Args:
        coeff: (..., K(in)).
        A: (..., out, in).
        order: of the coefficients.
        cotangent: (..., K(out)) derivative of the loss by what ``project`` returns.

    Returns:
        Derivatives by ``coeff``, (..., K(in)), and by A, (..., out, in); where one array was
        spread over another's leading axes, the sum over these is left to the caller.

    Raises:
        InputError: shapes do not fit, or a number is not finite.
    """
    A = numbers(A, "A")
    blocks = gamma(A, order)
    rows, columns = A.shape[-2:]
    coeff = vectors(coeff, "coeff", n_coeff(order, columns))
    cotangent = vectors(cotangent, "cotangent", n_coeff(order, rows))
    together(coeff, A, "A", 2)
    together(cotangent, A, "A", 2)
    ins, outs = order_slices(order, columns), order_slices(order, rows)
    by_coeff = [
        np.einsum("...mn,...m->...n", block, cotangent[..., part])
        for block, part in zip(blocks, outs, strict=True)
    ]
    by_matrix: NDArray[Any] = np.zeros(A.shape)
    for n in range(1, order + 1):
        lower_out = lowered_coefficients(cotangent[..., outs[n]], n, rows)
        lower_in = lowered_coefficients(coeff[..., ins[n]], n, columns)
        terms = np.einsum("...am,...mn,...in->...ai", lower_out, blocks[n - 1], lower_in)
        by_matrix = by_matrix + terms
    return np.concatenate(by_coeff, -1), by_matrix


def lowered_coefficients(coeff: NDArray[Any], order: int, dim: int) -> NDArray[Any]:
    """a_i c for every i: (..., K_N) of one order to (..., dim, K_(N-1)) of the order below."""
    raised = of_order(order - 1, dim)[:, None, :] + np.eye(dim, dtype=np.intp)
    weights = np.sqrt(np.einsum("kii->ki", raised))
    return np.moveaxis(coeff[..., place_in_order(raised)] * weights, -1, -2)


@cache
def _lowered(order: int, dim: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Where n - e_i stands in the order below, and sqrt(n_i), which is 0 where there is none."""
    modes = of_order(order, dim)
    below = modes[:, None, :] - np.eye(dim, dtype=np.intp)
    exists = np.einsum("kii->ki", below) >= 0
    return np.where(exists, place_in_order(below), 0), np.sqrt(modes)


def _matrix(A: ArrayLike) -> NDArray[Any]:
    array = numbers(A, "A", allow_complex=True)
    if array.ndim < 2 or not set(array.shape[-2:]) <= {1, 2, 3}:
        raise ShapeError(f"A has shape {array.shape}, wanted (..., out, in) of 1 to 3 dimensions")
    return array
