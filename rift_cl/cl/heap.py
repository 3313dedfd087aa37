"""Memory for the large arrays of a CPU.

A pool that keeps what arrays leave for arrays of the same size has, after a while, as much memory
for every size as was ever needed of it: a third more than all arrays together take at any time. A
heap gives what one array leaves to arrays of other sizes too. It has segments from the driver, each
as large as the array that it was made for, and blocks of them are sub-buffers.
"""

from __future__ import annotations

import sys
import threading
from bisect import insort
from collections.abc import Callable, Iterator
from typing import Any

from rift_cl.cl.failures import driver_errors

# Blocks begin at multiples of so many bytes: what drivers ask of sub-buffers, and a page.
_STEP = 4096
# A block lies in no segment of more than so many times its size: a small array would keep a large
# one from the place that was made for it, and that one would get a second place.
_LARGER = 6


class Heap:
    """Segments of memory, and the blocks in them.

    Whatever is enqueued later than an array's last use may have its memory, so this is for devices
    with one in-order queue.

    Args:
        make: a buffer of so many bytes from the driver.
    """

    def __init__(self, make: Callable[[int], Any]) -> None:
        self._make = make
        self._segments: list[_Segment] = []
        self._most = 0
        self._turn = threading.Lock()

    @property
    def managed_bytes(self) -> int:
        """Bytes that it has from the driver."""
        return sum(segment.size for segment in self._segments)

    def free_held(self) -> None:
        """Give segments that no array uses any more back to the driver."""
        with self._turn:
            self._sweep()
            self._give_back(self.managed_bytes)
            self._most = self._in_use

    def fits(self, size: int, largest: int) -> bool:
        """Whether a block of ``size`` bytes lies in a buffer of ``largest`` bytes."""
        return _rounded(size) <= largest

    @property
    def _in_use(self) -> int:
        return sum(segment.in_use for segment in self._segments)

    def __call__(self, size: int) -> Any:
        """A buffer of at least ``size`` bytes, which is free again once nothing refers to it."""
        size = _rounded(size)
        with self._turn:
            self._sweep()
            self._most = max(self._most, self._in_use + size)
            holes = [
                (length, number, begin)
                for number, segment in enumerate(self._segments)
                if segment.size <= _LARGER * size
                for begin, length in segment.holes()
                if length >= size
            ]
            if holes:
                _, number, begin = min(holes)
                return self._segments[number].cut(begin, size)
            return self._new_segment(size).cut(0, size)

    def _new_segment(self, size: int) -> _Segment:
        """A segment in place of others that nothing is in, where there is memory enough in them."""
        self._give_back(self.managed_bytes + size - self._most)
        try:
            buffer = self._make(size)
        except driver_errors():
            self._give_back(self.managed_bytes)
            buffer = self._make(size)
        self._segments.append(_Segment(buffer, size))
        return self._segments[-1]

    def _sweep(self) -> None:
        for segment in self._segments:
            segment.sweep()

    def _give_back(self, amount: int) -> None:
        """Give so many bytes of empty segments back, the smallest first, or what there is."""
        for segment in sorted(self._segments, key=lambda segment: segment.size):
            if amount <= 0:
                return
            if not segment.blocks:
                self._segments.remove(segment)
                amount -= segment.size


def _rounded(size: int) -> int:
    return -(-size // _STEP) * _STEP


class _Block:
    """A part of a segment that an array has.

    Args:
        buffer: the sub-buffer.
        begin: its first byte.
        end: the byte behind it.
    """

    def __init__(self, buffer: Any, begin: int, end: int) -> None:
        self.buffer, self.begin, self.end = buffer, begin, end

    def references(self) -> int:
        """What refers to the buffer: buffers of pyopencl take no weak references."""
        return sys.getrefcount(self.buffer)


# References of a buffer that nothing but its block knows.
_ALONE = _Block(object(), 0, 0).references()


class _Segment:
    """Memory from the driver in one piece.

    Args:
        buffer: the buffer.
        size: its bytes.
    """

    def __init__(self, buffer: Any, size: int) -> None:
        self._buffer, self.size = buffer, size
        self.blocks: list[_Block] = []

    @property
    def in_use(self) -> int:
        """Bytes of its blocks."""
        return sum(block.end - block.begin for block in self.blocks)

    def sweep(self) -> None:
        """Forget the blocks that no array has any more."""
        self.blocks = [block for block in self.blocks if block.references() > _ALONE]

    def holes(self) -> Iterator[tuple[int, int]]:
        """Where bytes are free, and how many."""
        begin = 0
        for block in self.blocks:
            if block.begin > begin:
                yield begin, block.begin - begin
            begin = block.end
        if self.size > begin:
            yield begin, self.size - begin

    def cut(self, begin: int, size: int) -> Any:
        """The buffer of a new block in a hole."""
        buffer = self._buffer.get_sub_region(begin, size)
        # In one step: an interrupt between two would leave the blocks out of order.
        insort(self.blocks, _Block(buffer, begin, begin + size), key=lambda block: block.begin)
        return buffer
