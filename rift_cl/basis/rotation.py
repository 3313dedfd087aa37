"""Turning functions about the origin: orthogonal for Hermite modes, diagonal for Laguerre ones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis.numbers import numbers
from rift_cl.errors import InputError, ShapeError


def rotation_matrix(theta: ArrayLike, dim: int) -> NDArray[np.float64]:
    """The matrix of a turn.

    Args:
        theta: in the plane an angle in radians, counter-clockwise (the first axis towards the
            second); in space the orthogonal (3, 3) matrix itself.
        dim: 2 or 3.

    Raises:
        InputError: there is nothing to turn in one dimension, or theta is something else.
    """
    turn = numbers(theta, "theta")
    if dim == 1:
        raise InputError("rotate: dim is 1, wanted 2 or 3: a line cannot be turned")
    if turn.shape != (() if dim == 2 else (3, 3)):
        wanted = "one angle in radians" if dim == 2 else "an orthogonal matrix of shape (3, 3)"
        raise ShapeError(f"theta has shape {turn.shape}, wanted {wanted}")
    if dim == 2:
        cos, sin = math.cos(turn), math.sin(turn)
        return np.array([[cos, -sin], [sin, cos]])
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-9:
        raise InputError("theta is no orthogonal matrix, wanted one with theta theta^T = 1")
    return turn


def turned(coeff: NDArray[Any], modes: NDArray[np.intp], theta: float) -> NDArray[Any]:
    """Laguerre coefficients after a turn: exp(-i l theta) each, or a pair (cosine, sine) turned.

    Args:
        coeff: (..., K).
        modes: (K, 2) of p and l, or (K, 3) of p, l and 0 or 1 with each sine after its cosine.
        theta: angle in radians, counter-clockwise.
    """
    turns = modes[:, 1] * theta
    if modes.shape[1] == 2:
        return np.asarray(coeff * np.exp(-1j * turns))
    result = coeff * np.cos(turns)
    sines = np.flatnonzero(modes[:, 2])
    result[..., sines] += coeff[..., sines - 1] * np.sin(turns[sines])
    result[..., sines - 1] -= coeff[..., sines] * np.sin(turns[sines])
    return np.asarray(result)
