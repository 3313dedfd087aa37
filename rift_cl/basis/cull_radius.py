"""How far out a splat has to be drawn: where nothing of it is larger than a threshold any more.

The modes of one total order are turned into each other by an orthogonal matrix when space is
turned, so that the sum of their squares, b_N(|x|)^2, depends on the distance alone. By the
inequality of Cauchy and Schwarz |f(x)| <= sum_N |c_N| b_N(|x|), with |c_N| the length of the
coefficients of order N: a bound that one mode along its own axis nearly attains.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.hermite_functions import Form, functions
from rift_cl.basis.numbers import numbers
from rift_cl.errors import InputError, ShapeError

# Radii are found on this grid, in whitened units; at its end a Gaussian is no float64 any more.
_STEP, _FARTHEST = 1 / 256, 40.0


def threshold(eps: Any) -> float:
    """Read a threshold.

    Raises:
        InputError: it is no positive number.
    """
    value = numbers(eps, "eps")
    if value.shape != ():
        raise ShapeError(f"eps has shape {value.shape}, wanted one number")
    if not value > 0:
        raise InputError(f"eps is {eps!r}, wanted a positive threshold, as 1/255 of the peak")
    return float(value)


def radius(lengths: NDArray[np.float64], eps: float, dim: int, form: Form) -> NDArray[np.float64]:
    """The smallest radius beyond which the bound stays below ``eps``.

    Args:
        lengths: (..., order + 1) lengths |c_N| of the coefficients of each total order.
        eps: threshold, positive.
        dim: of the space.
        form: of the modes.

    Returns:
        (...) radii in whitened units, up to 1/256 too large; 0 where the bound is never reached.
    """
    hull = _hull(lengths.shape[-1] - 1, dim, form)
    inside = np.full(lengths.shape[:-1], -1)
    outside = np.full(lengths.shape[:-1], len(hull) - 1)
    for _ in range(len(hull).bit_length()):
        middle = (inside + outside + 1) // 2
        below = np.einsum("...n,...n->...", hull[middle], lengths) < eps
        outside = np.where(below, middle, outside)
        inside = np.where(below, inside, middle)
    return np.asarray(outside * _STEP)


def envelopes(r: NDArray[np.float64], order: int, dim: int, form: Form) -> NDArray[np.float64]:
    """b_N at distances, (..., order + 1): modes along one axis, those across it at their centre."""
    squares = functions(r, order, form) ** 2
    centre = functions(np.zeros(()), order, form) ** 2
    across = np.eye(1, order + 1)[0]
    for _ in range(dim - 1):
        across = np.convolve(across, centre)[: order + 1]
    sums = [squares[..., : n + 1] @ across[n::-1] for n in range(order + 1)]
    return np.asarray(np.sqrt(np.stack(sums, -1)))


@cache
def _hull(order: int, dim: int, form: Form) -> NDArray[np.float64]:
    """The largest b_N from each radius on, (radii, order + 1): it falls with the radius."""
    r = np.arange(0.0, _FARTHEST, _STEP)
    table = envelopes(r, order, dim, form)
    return np.asarray(np.maximum.accumulate(table[::-1])[::-1])
