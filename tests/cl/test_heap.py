"""The heap for large arrays: blocks lie apart, and come back once nobody has them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rift_cl.cl import Device
from rift_cl.cl.heap import Heap

PAGE = 4096


class Buffer:
    """What the heap knows of a buffer: which segment it is of, and where it begins and ends."""

    def __init__(self, segment, begin, size):
        self.segment, self.begin, self.end = segment, begin, begin + size

    def get_sub_region(self, begin, size):
        assert 0 <= begin <= begin + size <= self.end
        return Buffer(self, begin, size)


def heap():
    return Heap(lambda size: Buffer(None, 0, size))


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(st.integers(1, 40 * PAGE), st.integers(0, 12)), max_size=40))
def test_blocks_in_use_never_share_a_byte(steps):
    ours, held = heap(), []
    for size, leave in steps:
        held.append(ours(size))
        assert held[-1].end - held[-1].begin >= size
        places = sorted((id(b.segment), b.begin, b.end) for b in held)
        for (one, _, end), (other, begin, _) in pairwise(places):
            assert one != other or end <= begin
        assert sum(b.end - b.begin for b in held) <= ours.managed_bytes
        del held[leave:]
    held.clear()
    ours.free_held()
    assert ours.managed_bytes == 0


def test_what_an_array_left_serves_arrays_of_other_sizes():
    ours = heap()
    large = ours(100 * PAGE)
    del large
    parts = [ours(size * PAGE) for size in (30, 50, 20)]
    assert len({id(part.segment) for part in parts}) == 1
    assert ours.managed_bytes == 100 * PAGE


def test_a_small_array_is_no_lodger_of_a_large_segment():
    ours = heap()
    large = ours(100 * PAGE)
    del large
    small, large = ours(PAGE), ours(100 * PAGE)
    assert small.segment is not large.segment
    assert ours.managed_bytes == 101 * PAGE


def test_arrays_lie_beside_others_rather_than_in_segments_of_their_own():
    """The smaller segment stays whole for an array of its size."""
    ours = heap()
    large, small = ours(90 * PAGE), ours(30 * PAGE)
    before = ours.managed_bytes
    del large, small
    lodgers = [ours(size * PAGE) for size in (40, 25)]
    assert len({id(one.segment) for one in lodgers}) == 1
    assert ours(30 * PAGE).begin == 0
    assert ours.managed_bytes == before


def test_a_segment_takes_the_place_of_empty_ones():
    """As much is held as was in use at a time, whatever the sizes were."""
    ours = heap()
    for size in (60, 100, 80, 144, 90):
        block = ours(size * PAGE)
        del block
        assert ours.managed_bytes <= 144 * PAGE
    assert ours.managed_bytes == 144 * PAGE


def test_what_was_used_lately_stays():
    ours = heap()
    idle, lately = ours(144 * PAGE), ours(48 * PAGE)
    segment = lately.segment
    del idle, lately
    lately = ours(48 * PAGE)
    del lately
    small = ours(7 * PAGE)
    assert small.end == 7 * PAGE
    assert ours.managed_bytes == 55 * PAGE
    assert ours(48 * PAGE).segment is segment


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.integers(1, 200), st.integers(0, 12)), min_size=1, max_size=12))
def test_a_loop_finds_all_its_memory_again(turn):
    """Arrays of a turn live to its end or shorter, or until the same array of the next one."""
    taken = []

    def make(size):
        taken.append(size)
        return Buffer(None, 0, size)

    ours, lasting = Heap(make), {}
    for k in range(40):
        if k == 30:
            taken.clear()
        held = []
        for number, (size, life) in enumerate(turn):
            block = ours(size * PAGE)
            if life == 12:
                lasting[number] = block
            held = [(one, left - 1) for one, left in [*held, (block, life)] if left]
            del block
    assert not taken


def test_an_array_that_is_a_little_larger_than_before_finds_its_place():
    ours = heap()
    block = ours(1001 * PAGE)
    del block
    before = ours.managed_bytes
    assert before <= 1.07 * 1001 * PAGE
    assert ours(1020 * PAGE).end == 1020 * PAGE
    assert ours.managed_bytes == before


def test_a_driver_without_memory_gets_back_what_is_kept():
    room = 100 * PAGE

    def make(size):
        if size + ours.managed_bytes > room:
            raise MemoryError
        return Buffer(None, 0, size)

    ours = Heap(make)
    first, second = ours(40 * PAGE), ours(50 * PAGE)
    del first
    with pytest.raises(MemoryError):
        ours(60 * PAGE)
    del second
    assert ours(60 * PAGE).end >= 60 * PAGE


def test_views_keep_their_memory(device):
    """Whatever refers to a buffer has it: an array, a part of one, or the same in another shape."""
    count = 1 << 19
    numbers = device.array(np.arange(count, dtype=np.float32))
    whole = numbers.reshape((2, count // 2))
    del numbers
    others = [device.zeros(count) for _ in range(3)]
    assert np.array_equal(device.get(whole).ravel(), np.arange(count, dtype=np.float32))
    assert not any(device.get(other).any() for other in others)


def test_large_arrays_are_given_back(device):
    small = Device(device._handle, device.selector, traits=device.traits)
    kept = [small.empty(size) for size in (1 << 19, 1 << 18)]
    assert 6 << 19 <= small.taken <= 7 << 19
    kept.clear()
    small.release()
    assert small.taken == 0
