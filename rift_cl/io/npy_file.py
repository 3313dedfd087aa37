"""NumPy's NPY format, of files and of the members of an NPZ archive; nothing is ever unpickled.

The header is read first, so that what it claims is compared with what there is before anything is
allocated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, ShapeError
from rift_cl.io.boundary import check_claim, check_numeric

SUFFIX = ".npy"
SIGNATURE = b"\x93NUMPY"


@dataclass(frozen=True)
class ArrayHeader:
    """What an array claims to be.

    Args:
        shape: its shape.
        dtype: its type.
        offset: bytes of the header before the values.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    offset: int

    @property
    def size(self) -> int:
        """Bytes of the values."""
        return math.prod(self.shape) * self.dtype.itemsize

    def check(self, path: Path, name: str) -> None:
        """Refuse an array that holds nothing, or no real numbers.

        Args:
            path: the file, for the error.
            name: of the array.

        Raises:
            DTypeError: it does not hold real numbers.
            ShapeError: it is empty.
        """
        check_numeric(path, name, self.dtype)
        if min(self.shape, default=1) < 1:
            raise ShapeError(f"{path}: {name!r} has shape {self.shape}, it holds nothing")


def read_header(file: IO[bytes]) -> ArrayHeader:
    """Read the header that a file begins with.

    Raises:
        ValueError: it is none, or of a version that is not known.
    """
    version = npy.read_magic(file)
    readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    if version not in readers:
        raise ValueError(f"NPY version {version} is not known")
    shape, _, dtype = readers[version](file)
    return ArrayHeader(tuple(int(n) for n in shape), dtype, file.tell())


def npy_header(path: Path, what: str = "", most: int | None = None) -> ArrayHeader:
    """What the array in a file of its own claims to be, held against the file.

    Args:
        path: the file.
        what: what the array is, in a sentence, such as "the list of angles".
        most: bytes that it may take as float64, where it is to be loaded whole.

    Raises:
        ValueError: the file does not begin as an NPY file does.
        DTypeError: it does not hold real numbers.
        ShapeError: it holds nothing.
        ResourceLimitError: it claims more than ``most``.
        FileFormatError: the file is shorter than its header claims.
    """
    with path.open("rb") as file:
        header = read_header(file)
    header.check(path, path.name)
    if most is not None:
        check_claim(path, what, 8 * math.prod(header.shape), most)
    claimed, stored = header.offset + header.size, path.stat().st_size
    if claimed > stored:
        raise FileFormatError(
            f"{path}: the header claims {claimed} bytes, the file has {stored}; it is damaged or "
            "was cut short"
        )
    return header


def map_npy(path: Path) -> NDArray[Any]:
    """The array in a file, mapped into memory: what is not looked at is not read."""
    npy_header(path)
    values: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return values


def load_npy(path: Path, what: str, most: int) -> NDArray[np.float64]:
    """The array in a file, loaded whole; arguments and errors as ``npy_header``."""
    npy_header(path, what, most)
    return np.asarray(np.load(path, allow_pickle=False), np.float64)
