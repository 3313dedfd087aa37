"""Is an operator's adjoint its adjoint? The question that solvers stand or fall with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import check_type
from rift_cl.operators.linear import LinearOperator, Shape


def dot_test(A: LinearOperator, seed: int = 0) -> float:
    """How far an operator and its adjoint are from being a matched pair.

    Args:
        A: the operator.
        seed: of the random arrays.

    Returns:
        The largest of ``|<Ax, y> - <x, A'y>| / (|Ax| |y|)`` over three pairs: white x with
        y = Ax, white with white, positive with positive. Inner products are taken in float64. Of a
        matched pair in float32 rounding is left, up to some 1e-6 over the root of the number of
        values that the smaller side has: less than 1e-8 from ten thousand values on. With float64
        the same pair tells whether it is rounding.
    """
    check_type("dot_test", "A", A, LinearOperator)
    random = np.random.default_rng(seed)

    def white(shape: Shape) -> NDArray[Any]:
        return random.standard_normal(shape).astype(A.dtype)

    x = white(A.domain)
    pairs = [(x, A(x)), (white(A.domain), white(A.range))]
    pairs.append((np.abs(white(A.domain)), np.abs(white(A.range))))
    return max(_mismatch(A, x, y) for x, y in pairs)


def _mismatch(A: LinearOperator, x: NDArray[Any], y: NDArray[Any]) -> float:
    image, back = A(x).ravel().astype(np.float64), A.T(y).ravel().astype(np.float64)
    x, y = x.ravel().astype(np.float64), y.ravel().astype(np.float64)
    scale = float(np.linalg.norm(image) * np.linalg.norm(y))
    difference = abs(float(image @ y) - float(x @ back))
    return difference / scale if scale > 0 else difference
