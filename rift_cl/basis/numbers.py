"""What a caller gives to a basis: numbers of the right shape, or one sentence that refuses them."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError

# The highest total order: to here the recursions hold what their tests demand of them.
MAX_ORDER = 64


def whole(value: Any, name: str, least: int, most: int, hint: str = "") -> int:
    """Read a whole number within bounds.

    Args:
        value: what came.
        name: of the argument, for the error.
        least: smallest number that is taken.
        most: largest one.
        hint: what to do instead, for the error.

    Raises:
        InputError: it is no whole number, or out of bounds.
    """
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if isinstance(value, (bool, np.bool_)) or not least <= number <= most:
        raise InputError(f"{name} is {value!r}, wanted a whole number from {least} to {most}{hint}")
    return number


def numbers(value: Any, name: str, *, allow_complex: bool = False) -> NDArray[Any]:
    """Read finite numbers as float64, or as complex128 where that is allowed.

    Raises:
        DTypeError: they are no numbers, or complex where real ones are wanted.
        NonFiniteError: one of them is NaN or infinite.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        raise DTypeError(f"{name} cannot be read as an array of numbers") from None
    if array.dtype.kind not in ("fiubc" if allow_complex else "fiub"):
        kind = "numbers" if allow_complex else "real numbers"
        raise DTypeError(f"{name} has type {array.dtype}, wanted {kind}")
    array = array.astype(np.complex128 if array.dtype.kind == "c" else np.float64)
    if not np.isfinite(array).all():
        raise NonFiniteError(f"{name} holds NaN or infinity, wanted finite numbers")
    return array


def vectors(value: Any, name: str, length: int, *, allow_complex: bool = False) -> NDArray[Any]:
    """Read numbers whose last axis has a given length.

    Args:
        value: (..., length).
        name: of the argument, for the error.
        length: wanted of the last axis.
        allow_complex: take complex numbers as well.

    Raises:
        InputError: as ``numbers`` does, or the last axis has another length.
    """
    array = numbers(value, name, allow_complex=allow_complex)
    if array.ndim == 0 or array.shape[-1] != length:
        raise ShapeError(f"{name} has shape {array.shape}, wanted (..., {length})")
    return array


def together(coeff: NDArray[Any], other: NDArray[Any], name: str, own: int = 1) -> None:
    """See that the leading axes of coefficients (..., K) and of another array go together.

    Args:
        coeff: (..., K).
        other: (..., and ``own`` axes of its own).
        name: of the other array, for the error.
        own: how many.

    Raises:
        ShapeError: they do not broadcast.
    """
    try:
        np.broadcast_shapes(coeff.shape[:-1], other.shape[: other.ndim - own])
    except ValueError:
        raise ShapeError(
            f"coeff and {name} have shapes {coeff.shape} and {other.shape}, wanted leading axes "
            "that are equal or 1"
        ) from None
