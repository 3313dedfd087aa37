"""The gate that projections pass before they are mended: real, finite, of the right axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.host_arrays import as_plain, as_real_array, check_finite
from rift_cl.errors import InputError, ShapeError

Floats = NDArray[np.float32]
# Squares and sums of larger numbers leave single precision.
_LARGEST = 1e18


def as_projections(values: Any, *, name: str, one_row: bool = True) -> Floats:
    """Read projections as float32 in C order.

    Args:
        values: anything NumPy reads as an array of real numbers, (angle, row, bin).
        name: what the caller calls it, for the error.
        one_row: whether (angle, bin) will do.

    Raises:
        ShapeError: the array has other axes.
        DTypeError: the values are not real numbers.
        NonFiniteError: a value is NaN or infinite.
        InputError: a value is beyond what a measurement can be.
    """
    stack: Floats = as_plain(as_real_array(values, name=name), np.float32)
    if stack.ndim != 3 and not (one_row and stack.ndim == 2):
        wanted = "(angle, bin) or (angle, row, bin)" if one_row else "(angle, row, bin)"
        raise ShapeError(f"{name} has shape {stack.shape}, wanted {wanted}")
    check_finite(stack, name=name)
    if stack.size and max(stack.max(), -stack.min()) > _LARGEST:
        raise InputError(
            f"{name} holds values beyond {_LARGEST:g}, which no measurement is: was it read with "
            "the right type and byte order?"
        )
    return stack
