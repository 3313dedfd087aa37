"""Which numbers a device is asked to compute in."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.errors import DeviceError, DTypeError

if TYPE_CHECKING:
    from rift_cl.cl.device import Device


def real_type(device: Device, dtype: DTypeLike) -> np.dtype[Any]:
    """The type of the numbers that an operator works in: float32, or float64 if asked for.

    Raises:
        DTypeError: it is another type.
        DeviceError: the device cannot compute in float64.
    """
    wanted = None
    with suppress(TypeError):
        wanted = np.dtype(dtype)
    if wanted is None or wanted not in (np.float32, np.float64):
        raise DTypeError(f"dtype is {dtype!r}, wanted 'float32' or 'float64'")
    if wanted == np.float64 and not device.traits.fp64:
        raise DeviceError(f"{device.name} cannot compute in float64 (no cl_khr_fp64): use float32")
    return wanted


def working_type(dtype: DTypeLike, *, name: str) -> np.dtype[Any]:
    """The type to work in for another package's operator: float64 for float64, else float32.

    Args:
        dtype: of the other operator's numbers.
        name: what the caller calls that operator, for the error.

    Raises:
        DTypeError: its numbers are complex.
    """
    own = np.dtype(dtype)
    if own.kind == "c":
        raise DTypeError(f"{name} is of type {own}, wanted a real operator")
    return np.dtype(np.float64 if own == np.float64 else np.float32)
