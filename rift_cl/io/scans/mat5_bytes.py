"""The bytes of one element of a MAT file, plain or packed, read once from front to back.

Packed bytes are unpacked as they are asked for and never beyond, so that a kilobyte that claims
gigabytes costs nothing until somebody wants them.
"""

from __future__ import annotations

import zlib
from typing import IO, Protocol

_PIECE = 1 << 20


class ElementBytes(Protocol):
    """Bytes that are read in order."""

    place: int

    @property
    def left(self) -> int:
        """Bytes that are left, as claimed."""

    def read(self, size: int) -> bytes:
        """The next bytes; an error if there are fewer."""

    def skip(self, size: int) -> None:
        """Pass over some bytes."""

    def finish(self) -> None:
        """Go to the end, where packed bytes have a sum that tells whether they are whole."""


class PlainBytes:
    """Bytes as they are in the file.

    Args:
        file: the file, open.
        start: where they begin.
        size: how many they are; the file was found to hold them.
    """

    def __init__(self, file: IO[bytes], start: int, size: int) -> None:
        self.place = 0
        self._file = file
        self._start = start
        self._size = size

    @property
    def left(self) -> int:
        """Bytes that are left."""
        return self._size - self.place

    def read(self, size: int) -> bytes:
        """The next bytes."""
        start = self._start + self.place
        self.skip(size)
        self._file.seek(start)
        data = self._file.read(size)
        if len(data) < size:
            raise EOFError("the file ends within an element")
        return data

    def skip(self, size: int) -> None:
        """Pass over some bytes."""
        if not 0 <= size <= self.left:
            raise EOFError(f"an element claims {size} bytes where {self.left} are left")
        self.place += size

    def finish(self) -> None:
        """There is nothing at the end."""


class PackedBytes:
    """Bytes that are packed by deflate.

    Args:
        file: the file, open.
        start: where they begin in it.
        size: how many they are there; the file was found to hold them.
    """

    def __init__(self, file: IO[bytes], start: int, size: int) -> None:
        self.place = 0
        self._end = 8
        self._file = file
        self._packed = size
        self._stream = zlib.decompressobj()
        file.seek(start)

    def limit(self, size: int) -> None:
        """Say how many there are from here on, and count from here."""
        self.place, self._end = 0, size

    @property
    def left(self) -> int:
        """Bytes that are left, as claimed; there may be fewer."""
        return self._end - self.place

    def read(self, size: int) -> bytes:
        """The next bytes."""
        self._demand(size)
        pieces = []
        while size:
            piece = self._unpacked(min(size, _PIECE))
            pieces.append(piece)
            size -= len(piece)
        return b"".join(pieces)

    def skip(self, size: int) -> None:
        """Pass over some bytes."""
        self._demand(size)
        while size:
            size -= len(self._unpacked(min(size, _PIECE)))

    def finish(self) -> None:
        """Unpack the rest, so that zlib compares the sum."""
        self.skip(self.left)
        while not self._stream.eof:
            if self._next(1):
                raise ValueError("a packed element holds more than it claims")

    def _demand(self, size: int) -> None:
        if not 0 <= size <= self.left:
            raise EOFError(f"an element claims {size} bytes where {self.left} are left")
        self.place += size

    def _unpacked(self, most: int) -> bytes:
        while not self._stream.eof:
            piece = self._next(most)
            if piece:
                return piece
        raise EOFError("a packed element ends early")

    def _next(self, most: int) -> bytes:
        """What comes next, or nothing where more has to be read for that."""
        packed = self._stream.unconsumed_tail
        if not packed:
            packed = self._file.read(min(_PIECE, self._packed))
            self._packed -= len(packed)
        piece = self._stream.decompress(packed, most)
        if not piece and not packed:
            raise EOFError("a packed element ends early")
        return piece
