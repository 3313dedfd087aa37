"""Numbers that a caller gives: read as float64, or not at all."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def real_numbers(value: Any) -> NDArray[np.float64] | None:
    """Read real numbers as a new C-ordered array.

    Args:
        value: one number, or an array of them in any form that NumPy reads.

    Returns:
        The numbers with ``-0`` as ``0``, so that what is equal has equal bytes; None if the value
        is anything else, as text, complex numbers and masked arrays are.
    """
    if isinstance(value, np.ma.MaskedArray):
        return None
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if array.dtype.kind not in "fiub":
        return None
    with np.errstate(all="ignore"):
        numbers: NDArray[np.float64] = np.array(array, dtype=np.float64, order="C") + 0.0
    return numbers


def one_number(value: Any) -> float:
    """Read one finite real number; NaN if the value is anything else."""
    numbers = real_numbers(value)
    if numbers is None or np.ndim(numbers) > 0 or not np.isfinite(numbers):
        return float("nan")
    return float(numbers)


def positive_or_infinite(value: Any) -> float:
    """Read one positive number, or infinity; NaN if the value is anything else."""
    number = real_numbers(value)
    if number is None or np.ndim(number) > 0 or not number > 0:
        return float("nan")
    return float(number)
