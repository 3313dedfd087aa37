"""MATLAB's files of version 5 to 7: a table of arrays, and those of them that are asked for.

The file is a row of tagged elements, packed by deflate or not, and elements inside elements. Tags
are walked here one by one, with every claimed size held against the bytes there are, and nothing
but numbers and short texts is ever made of them: objects and functions are passed over. SciPy 1.17
reads these files as well, but of those that were damaged by chance one in a hundred ended the
process. Source: "MAT-File Format" (The MathWorks).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.scans.mat5_bytes import ElementBytes, PackedBytes, PlainBytes

_HEADER = 128
_INT8, _INT32, _UINT32, _MATRIX, _PACKED = 1, 5, 6, 14, 15
# Types of stored numbers; those of text are read as numbers as well.
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"}
_STORED |= {12: "i8", 13: "u8", 16: "u1", 17: "u2", 18: "u4"}
_STRUCT, _TEXT, _NUMBERS = 2, 4, range(6, 16)
_COMPLEX, _LOGICAL = 0x08, 0x02
_DEEPEST = 8
_MOST_ARRAYS = 4096
_MOST_AXES = 32
_LONGEST_TEXT = 1 << 16
# Eight million angles: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST_VECTOR = 64 << 20


@dataclass(frozen=True)
class Mat5Array:
    """An array in the file.

    Args:
        shape: its shape as MATLAB has it.
        dtype: type of the numbers as they are stored, codes of a text among them; the empty string
            if it holds anything else, as truth values or complex numbers.
        text: it holds text.
        element: where in the file the element is that holds it.
        offset: where in that element, unpacked, its numbers are.
    """

    shape: tuple[int, ...]
    dtype: str
    text: bool
    element: int
    offset: int

    @property
    def real(self) -> bool:
        """It holds real numbers."""
        return bool(self.dtype) and not self.text

    @property
    def size(self) -> int:
        """Bytes of the numbers."""
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize


class Mat5File:
    """The arrays of a file by name; those inside structures as ``structure.field``.

    Args:
        path: the file.
        budget: bytes that one structure or array may take; 60 % of the free memory when None.

    Raises:
        FileFormatError: the file is damaged.
        ResourceLimitError: a structure claims more than the budget.
    """

    def __init__(self, path: Path, budget: int | None) -> None:
        self.path = path
        self.budget = budget
        self.arrays: dict[str, Mat5Array] = {}
        with reading(path, "the MAT file"):
            self._order = "<" if self._bytes(126, 2) == b"IM" else ">"
            place, end = _HEADER, path.stat().st_size
            while place < end:
                with self._element(place) as (source, size):
                    self._matrix(source, "", place, 0)
                place += size
                if len(self.arrays) > _MOST_ARRAYS:
                    raise ValueError(f"it holds more than {_MOST_ARRAYS} arrays")

    def load(self, name: str) -> NDArray[np.generic]:
        """Load an array of real numbers whole, in MATLAB's shape.

        Raises:
            FileFormatError: the file is damaged.
            ResourceLimitError: it is larger than the budget; nothing was allocated.
        """
        array = self.arrays[name]
        # Twice, because the pieces of a packed array are joined.
        check_claim(self.path, f"{name!r}", 2 * array.size, self.budget)
        with reading(self.path, "the MAT file"), self._element(array.element) as (source, _):
            source.skip(array.offset - source.place)
            data = source.read(array.size)
            source.finish()
        return np.frombuffer(data, array.dtype).reshape(array.shape, order="F")

    def vector(self, name: str) -> NDArray[np.float64]:
        """Read numbers that stand in a row.

        Raises:
            ShapeError: they do not.
            FileFormatError: the file is damaged.
            ResourceLimitError: there are far more than any scan has angles.
        """
        array = self.arrays[name]
        size = math.prod(array.shape)
        check_claim(self.path, f"{name!r}", 8 * size, _LONGEST_VECTOR)
        if size != max(array.shape, default=1) or not size:
            raise ShapeError(f"{self.path}: {name!r} has shape {array.shape}, wanted a vector")
        return self.load(name).astype(np.float64).reshape(size)

    def text(self, name: str) -> str:
        """A short text, or nothing where the array is none."""
        array = self.arrays.get(name)
        if array is None or not (array.text and array.dtype and 0 < array.size < _LONGEST_TEXT):
            return ""
        with reading(self.path, "the MAT file"), self._element(array.element) as (source, _):
            source.skip(array.offset - source.place)
            codes = np.frombuffer(source.read(array.size), array.dtype)
        return "".join(map(chr, codes[codes < 0xD800]))

    @contextmanager
    def _element(self, place: int) -> Iterator[tuple[ElementBytes, int]]:
        """The inside of an element of the file, unpacked, and the bytes it takes there."""
        kind, size = struct.unpack(self._order + "II", self._bytes(place, 8))
        if kind not in (_MATRIX, _PACKED):
            raise ValueError(f"an element at {place} is of type {kind}, which holds no array")
        if place + 8 + size > self.path.stat().st_size:
            raise ValueError(f"an element at {place} claims {size} bytes, more than there are")
        with self.path.open("rb") as file:
            if kind == _MATRIX:
                yield PlainBytes(file, place + 8, size), 8 + -(-size // 8) * 8
                return
            packed = PackedBytes(file, place + 8, size)
            inner, claimed = struct.unpack(self._order + "II", packed.read(8))
            if inner != _MATRIX:
                raise ValueError(f"a packed element at {place} holds no array")
            packed.limit(claimed)
            yield packed, 8 + size

    def _bytes(self, place: int, size: int) -> bytes:
        with self.path.open("rb") as file:
            file.seek(place)
            return file.read(size)

    def _matrix(self, source: ElementBytes, outer: str, element: int, depth: int) -> None:
        """Note the array that begins here and, in a structure, those inside it."""
        flags = struct.unpack(self._order + "II", self._small(source, _UINT32, 8))[0]
        kind = flags & 0xFF
        dims = self._small(source, _INT32, 4 * _MOST_AXES)
        shape = struct.unpack(f"{self._order}{len(dims) // 4}i", dims)
        if min(shape, default=-1) < 0:
            raise ValueError(f"an array has the shape {shape}")
        name = outer + self._small(source, _INT8, 1 << 10).decode("latin-1")
        if kind == _STRUCT and math.prod(shape) == 1 and depth < _DEEPEST:
            self._fields(source, name, element, depth)
        elif kind in _NUMBERS or kind == _TEXT:
            self._numbers(source, name, element, shape, flags)

    def _fields(self, source: ElementBytes, name: str, element: int, depth: int) -> None:
        (length,) = struct.unpack(self._order + "i", self._small(source, _INT32, 4))
        names = self._small(source, _INT8, 1 << 20)
        if not 0 < length <= 1 << 10 or len(names) % length:
            raise ValueError(f"the fields of {name!r} have names of {length} bytes")
        check_claim(self.path, f"{name!r}", source.left, self.budget)
        for start in range(0, len(names), length):
            field = names[start : start + length].split(b"\0")[0].decode("latin-1")
            kind, size, _ = self._tag(source)
            if kind != _MATRIX:
                raise ValueError(f"the field {field!r} of {name!r} holds no array")
            end = source.place + -(-size // 8) * 8
            # The names of arrays in fields are empty; the field's own comes in their place.
            if size and len(self.arrays) <= _MOST_ARRAYS:
                self._matrix(source, f"{name}.{field}" if name else field, element, depth + 1)
            source.skip(end - source.place)

    def _numbers(
        self, source: ElementBytes, name: str, element: int, shape: tuple[int, ...], flags: int
    ) -> None:
        kind, size, _ = self._tag(source)
        dtype = _STORED.get(kind, "")
        if dtype and size != math.prod(shape) * np.dtype(dtype).itemsize:
            raise FileFormatError(
                f"{self.path}: {name!r} claims the shape {shape} and stores {size} bytes of "
                f"{np.dtype(dtype)}; the file is damaged"
            )
        real = dtype and not flags >> 8 & (_COMPLEX | _LOGICAL)
        text = flags & 0xFF == _TEXT
        if name in self.arrays:
            raise ValueError(f"it holds {name!r} twice")
        stored = self._order + dtype if real else ""
        self.arrays[name] = Mat5Array(shape, stored, text, element, source.place)

    def _small(self, source: ElementBytes, wanted: int, most: int) -> bytes:
        kind, size, padding = self._tag(source)
        if kind != wanted or size > most:
            raise ValueError(f"an element of type {kind} with {size} bytes is out of place")
        data = source.read(size)
        source.skip(padding)
        return data

    def _tag(self, source: ElementBytes) -> tuple[int, int, int]:
        """Type and size of the element that begins here, and the bytes that fill it up."""
        first = source.read(4)
        (word,) = struct.unpack(self._order + "I", first)
        if word >> 16:
            size = word >> 16
            if size > 4:
                raise ValueError(f"a short element claims {size} bytes")
            return word & 0xFFFF, size, 4 - size
        (size,) = struct.unpack(self._order + "I", source.read(4))
        return word, size, -size % 8
