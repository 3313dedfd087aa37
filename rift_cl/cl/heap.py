"""Memory for the large arrays of a CPU.

A pool that keeps what arrays leave for arrays of the same size has, after a while, as much memory
for every size as was ever needed of it: a third more than all arrays together take at any time. A
heap gives what one array leaves to arrays of other sizes too. It has segments from the driver, each
as large as the array that it was made for, and blocks of them are sub-buffers.

Memory from the driver is dear: the system clears each page of it when it is first touched, which
may take longer than what a kernel does there. A loop that makes the same arrays in every turn must
find all of them in the segments that it had before. So a new segment takes the place of those that
got no array for the longest time, and a size that was given back and is wanted again was given back
wrongly: from then on more may be held than arrays ever had at a time.
"""

from __future__ import annotations

import sys
import threading
from bisect import insort
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from rift_cl.cl.failures import driver_errors

# Blocks begin at multiples of so many bytes: what drivers ask of sub-buffers, and a page.
_STEP = 4096
# A block lies in no segment of more than so many times its size: a small array would keep a large
# one from the place that was made for it, and that one would get a second place.
_LARGER = 5
# Segments are made a little larger than what is asked for, by up to a sixteenth: the next array of
# the kind may need a few more bytes, where one has as many as some splats are seen.
_FINENESS = 4
# The part of a segment by which more is held where it was given back wrongly, and how many segments
# that were given back are remembered.
_SHARE, _REMEMBERED = 4, 64


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
        self._most = self._spare = self._requests = 0
        self._gone: deque[int] = deque(maxlen=_REMEMBERED)
        self._turn = threading.Lock()

    @property
    def managed_bytes(self) -> int:
        """Bytes that it has from the driver."""
        return sum(segment.size for segment in self._segments)

    def free_held(self) -> None:
        """Give segments that no array uses any more back to the driver."""
        with self._turn:
            self._sweep()
            self._give_back(down_to=0)
            self._most, self._spare = self._in_use, 0
            self._gone.clear()

    def fits(self, size: int, largest: int) -> bool:
        """Whether the segment of a block of ``size`` bytes has ``largest`` bytes at most."""
        return _roomy(_rounded(size)) <= largest

    @property
    def _in_use(self) -> int:
        return sum(segment.in_use for segment in self._segments)

    def __call__(self, size: int) -> Any:
        """A buffer of at least ``size`` bytes, which is free again once nothing refers to it."""
        size = _rounded(size)
        with self._turn:
            self._sweep()
            self._most = max(self._most, self._in_use + size)
            self._requests += 1
            # Beside others first: segments that stay empty serve large arrays, or are given back.
            holes = [
                (not segment.blocks, length, number, begin)
                for number, segment in enumerate(self._segments)
                if segment.size <= _LARGER * size
                for begin, length in segment.holes()
                if length >= size
            ]
            if holes:
                *_, number, begin = min(holes)
                return self._segments[number].cut(begin, size, self._requests)
            return self._new_segment(size).cut(0, size, self._requests)

    def _new_segment(self, size: int) -> _Segment:
        """A segment in place of others that nothing is in, where there is memory enough in them."""
        size = _roomy(size)
        if size in self._gone:
            self._gone.remove(size)
            self._spare += size // _SHARE
        self._give_back(down_to=self._most + self._spare - size)
        try:
            buffer = self._make(size)
        except driver_errors():
            self._give_back(down_to=0)
            buffer = self._make(size)
        self._segments.append(_Segment(buffer, size))
        return self._segments[-1]

    def _sweep(self) -> None:
        for segment in self._segments:
            segment.sweep()

    def _give_back(self, *, down_to: int) -> None:
        """Give empty segments back until so many bytes are held, the longest unused first."""
        held = self.managed_bytes
        for segment in sorted(self._segments, key=lambda segment: segment.last_use):
            if held <= down_to:
                return
            if not segment.blocks:
                self._segments.remove(segment)
                self._gone.append(segment.size)
                held -= segment.size


def _rounded(size: int) -> int:
    return -(-size // _STEP) * _STEP


def _roomy(size: int) -> int:
    """The size of a segment for a block of ``size`` bytes."""
    unit = max(_STEP, 1 << max(size.bit_length() - 1 - _FINENESS, 0))
    return -(-size // unit) * unit


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
        self.last_use = 0

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

    def cut(self, begin: int, size: int, request: int) -> Any:
        """The buffer of a new block in a hole, for the request of that number."""
        self.last_use = request
        buffer = self._buffer.get_sub_region(begin, size)
        # In one step: an interrupt between two would leave the blocks out of order.
        insort(self.blocks, _Block(buffer, begin, begin + size), key=lambda block: block.begin)
        return buffer
