"""What the package, and an operator of one's own, uses of an array on a device.

Such an array is a ``pyopencl.array.Array``, a package without types. This protocol says what of it
is used, so that a type checker tells a device array from one on the host, from a table that may be
missing, and from a list of them; nothing is made or checked when the program runs.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray


class DeviceArray(Protocol):
    """Numbers on an OpenCL device, in C order from the begin of a buffer unless it is a view."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Its length along each axis."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of its numbers."""

    @property
    def size(self) -> int:
        """How many numbers it has."""

    @property
    def nbytes(self) -> int:
        """Bytes that its numbers take."""

    @property
    def flags(self) -> Any:
        """``flags.c_contiguous``: whether the numbers stand in C order without gaps."""

    @property
    def base_data(self) -> Any:
        """The ``pyopencl.Buffer`` that holds it, or None where it is empty."""

    @property
    def offset(self) -> int:
        """Bytes of the buffer before its first number: 0 unless it is a view."""

    @property
    def context(self) -> Any:
        """The ``pyopencl.Context`` that it lives in."""

    @property
    def queue(self) -> Any:
        """The ``pyopencl.CommandQueue`` that works on it, or None."""

    @property
    def events(self) -> list[Any]:
        """Each ``pyopencl.Event`` that pyopencl's own arithmetic on it waits for."""

    def __len__(self) -> int:
        """Its length along the first axis."""

    def __getitem__(self, index: Any) -> DeviceArray:
        """A view of a part."""

    def __setitem__(self, index: Any, values: Any) -> None:
        """Write into a part, by the device."""

    def __add__(self, other: Any) -> DeviceArray:
        """The sum with an array on the device or a number, by pyopencl's own arithmetic."""

    def __sub__(self, other: Any) -> DeviceArray:
        """The difference."""

    def __mul__(self, other: Any) -> DeviceArray:
        """The product, number by number."""

    def __truediv__(self, other: Any) -> DeviceArray:
        """The quotient, number by number."""

    def __neg__(self) -> DeviceArray:
        """Every number with the other sign."""

    def reshape(self, shape: tuple[int, ...]) -> DeviceArray:
        """The same numbers in another shape."""

    def view(self, dtype: DTypeLike) -> DeviceArray:
        """The same bits taken for numbers of another type."""


# An array that the device holds, or one on the host, parts of which pass through it.
AnyArray = DeviceArray | NDArray[Any]
