"""What the readers of MAT files of both kinds have in common: a table of arrays by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import DTypeError, FileFormatError
from rift_cl.io.boundary import HOW_TO_NAME

_LISTED = 8


class MatArray(Protocol):
    """An array of a MAT file."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Its shape as MATLAB has it."""

    @property
    def dtype(self) -> str:
        """Type of the numbers as they are stored."""

    @property
    def real(self) -> bool:
        """It holds real numbers."""


class MatFile(Protocol):
    """The arrays of a MAT file by name; those inside structures as ``structure.field``."""

    path: Path

    @property
    def arrays(self) -> Mapping[str, MatArray]:
        """What there is."""

    def vector(self, name: str) -> NDArray[np.float64]:
        """The numbers of an array that has them in a row; ShapeError if it has not."""

    def text(self, name: str) -> str:
        """A short text, or nothing where the array is none."""


def contents(file: MatFile) -> str:
    """A phrase that lists the first arrays of numbers, the largest first, and how to name one."""
    found = [(name, array.shape) for name, array in file.arrays.items() if array.real]
    if not found:
        return "it holds no array of real numbers at all"
    found.sort(key=lambda one: -np.prod(one[1], dtype=float))
    listed = ", ".join(f"{name!r} {shape}" for name, shape in found[:_LISTED])
    more = ", ..." if len(found) > _LISTED else ""
    return f"it holds {listed}{more}: {HOW_TO_NAME}"


def array_of(file: MatFile, name: str) -> MatArray:
    """An array of real numbers.

    Raises:
        FileFormatError: there is no such array; the error lists those that there are.
        DTypeError: it does not hold real numbers.
    """
    array = file.arrays.get(name)
    if array is None:
        raise FileFormatError(f"{file.path}: has no array {name!r}; {contents(file)}")
    if not array.real:
        raise DTypeError(f"{file.path}: {name!r} does not hold real numbers")
    return array
