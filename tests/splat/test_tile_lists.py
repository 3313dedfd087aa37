"""Tile lists equal their twin bit for bit on every driver, whatever splats a camera may see."""

from __future__ import annotations

import importlib
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ResourceLimitError, ShapeError
from rift_cl.reference.tile_lists import tile_lists as twin
from rift_cl.splat.prefix_sums import exclusive_scan, scan_levels
from rift_cl.splat.tile_lists import Tiles, seen_slots, tile_lists, tile_lists_bytes

MODULE = importlib.import_module("rift_cl.splat.tile_lists")
SUMS = importlib.import_module("rift_cl.splat.prefix_sums")
FIELDS = ("slots", "entries", "starts")
BITS = st.integers(0, 2**32 - 1)
TELLING = np.array(
    [0.0, -0.0, 1e-45, -1e-45, 1e-38, 1, 1 + 2**-23, -1, 2, -2, 3e38, -3e38, np.inf, -np.inf],
    np.float32,
)


def _lists(device, boxes, depth, *, tiles_x, tiles_y, first_row=0, sort=True):
    boxes = np.asarray(boxes, np.int32).reshape(-1, 4)
    depths = device.array(np.asarray(depth, np.float32))
    tiles = Tiles(tiles_x, tiles_y, first_row)
    lists = tile_lists(device, device.array(boxes), depths, tiles, sort=sort)
    assert lists.tiles == tiles
    assert lists.n_entries == lists.entries.shape[0]
    return [device.get(getattr(lists, field)) for field in FIELDS]


def _check(device, boxes, depth, **sizes):
    boxes = np.asarray(boxes, np.int32).reshape(-1, 4)
    expected = twin(boxes, depth, **sizes)
    for field, ours, right in zip(
        FIELDS, _lists(device, boxes, depth, **sizes), expected, strict=True
    ):
        assert ours.dtype == np.int32
        assert np.array_equal(ours, right), field


def _scene(splats, *, tiles_x, tiles_y, seed=0, largest=4):
    random = np.random.default_rng(seed)
    low = random.integers([-3, -3], [tiles_x + 3, tiles_y + 3], (splats, 2))
    boxes = np.concatenate([low, low + random.integers(0, largest, (splats, 2))], axis=1)
    return boxes, random.uniform(0.1, 9, splats).astype(np.float32)


@pytest.mark.parametrize("sort", [True, False])
def test_twin_is_the_list_made_pair_by_pair(sort):
    grid = {"tiles_x": 3, "tiles_y": 2}
    boxes, depth = _scene(30, **grid)
    depth = np.round(depth)
    depth[3] = np.nan
    pairs, slots = {tile: [] for tile in range(6)}, [0]
    for i, (x0, y0, x1, y1) in enumerate(np.clip(boxes, 0, [3, 2, 3, 2])):
        tiles = [y * 3 + x for y in range(y0, y1) for x in range(x0, x1)] if i != 3 else []
        for number, tile in enumerate(tiles):
            pairs[tile].append((depth[i] if sort else 0, i, slots[i] + number))
        slots.append(slots[i] + len(tiles))
    expected = [(i, slot) for tile in range(6) for _, i, slot in sorted(pairs[tile])]
    ours = twin(boxes, depth, sort=sort, **grid)
    assert ours.slots.tolist() == slots
    assert ours.entries.tolist() == [list(entry) for entry in expected]
    assert np.diff(ours.starts).tolist() == [len(pairs[tile]) for tile in range(6)]


@pytest.mark.parametrize("sort", [True, False])
@pytest.mark.parametrize("splats", [1, 63, 64, 65, 4097, 30000])
def test_random_splats(device, splats, sort):
    boxes, depth = _scene(splats, tiles_x=17, tiles_y=11, seed=splats)
    _check(device, boxes, depth, tiles_x=17, tiles_y=11, sort=sort)


@pytest.mark.full
@pytest.mark.parametrize("sort", [True, False])
@pytest.mark.parametrize("least", [2, 3])
def test_every_way_of_cutting_the_work(device, monkeypatch, least, sort):
    for name in ("_GPU_KEYS", "_GPU_PAIRS", "_BLOCK"):
        monkeypatch.setattr(MODULE, name, least)
    for name in ("_CPU_LEAST", "_GPU_RUN", "_GPU_ALONE"):
        monkeypatch.setattr(SUMS, name, least)
    for splats in (1, 2, 5, 8, 9, 33, 70):
        boxes, depth = _scene(splats, tiles_x=4, tiles_y=3, seed=splats)
        _check(device, boxes, np.round(depth), tiles_x=4, tiles_y=3, sort=sort)


def test_lists_of_several_chunks_on_the_device_as_it_is(monkeypatch):
    """The tests of this file may all run on a CPU taken for a GPU, which has kernels of its own."""
    monkeypatch.setattr(SUMS, "_CPU_LEAST", 16)
    boxes, depth = _scene(100, tiles_x=6, tiles_y=5)
    _check(rift.default_device(), boxes, depth, tiles_x=6, tiles_y=5)


@pytest.mark.parametrize("count", [1, 255, 256, 257, 4096, 4097, 16384, 16385, 70000])
@pytest.mark.parametrize("wide", [False, True])
def test_prefix_sums(device, count, wide):
    numbers = np.random.default_rng(count).integers(-5, 9, count)
    values = device.array(numbers.astype(np.int64 if wide else np.int32))
    total = exclusive_scan(device, values, count, scan_levels(device, count), wide=wide)
    assert device.get(total)[0] == numbers.sum()
    assert np.array_equal(device.get(values), np.cumsum(numbers) - numbers)


@pytest.mark.parametrize("sort", [True, False])
def test_no_splats(device, sort):
    _check(device, [], np.empty(0, np.float32), tiles_x=3, tiles_y=2, sort=sort)


@pytest.mark.parametrize("sort", [True, False])
@pytest.mark.parametrize("box", [(1, 1, 1, 3), (2, 1, 1, 2), (5, 0, 9, 2), (-4, 0, 0, 2)])
def test_no_splat_that_touches_the_image(device, box, sort):
    _check(device, [box] * 5, np.ones(5), tiles_x=3, tiles_y=2, sort=sort)


def test_culled_splats_between_visible_ones(device):
    boxes, depth = _scene(9000, tiles_x=5, tiles_y=5)
    boxes[np.random.default_rng(1).random(9000) < 0.9] = 0
    boxes[:300] = boxes[-300:] = 0
    for sort in (True, False):
        _check(device, boxes, depth, tiles_x=5, tiles_y=5, sort=sort)


def test_culled_splats_are_left_out_of_the_sort(device):
    keys, slots = np.array([7, 5, 9, 1], np.uint32), np.array([0, 3, 3, 4, 6], np.int32)
    levels = scan_levels(device, 1 << 12)
    order, visible = MODULE._depth_order(device, device.array(keys), device.array(slots), levels)
    assert device.get(visible)[0] == 3
    assert device.get(order)[:3].tolist() == [3, 0, 2]


def test_equal_depths_go_by_index(device):
    boxes, _ = _scene(10000, tiles_x=6, tiles_y=5)
    _check(device, boxes, np.full(10000, 2.5), tiles_x=6, tiles_y=5)
    _check(device, boxes, np.arange(10000) * 7 % 3, tiles_x=6, tiles_y=5)


def test_all_splats_in_one_tile(device):
    _, depth = _scene(9000, tiles_x=1, tiles_y=1)
    _check(device, [(2, 1, 3, 2)] * 9000, depth, tiles_x=5, tiles_y=3)
    _check(device, [(0, 0, 1, 1)] * 9000, depth, tiles_x=1, tiles_y=1)


def test_splats_over_the_whole_image(device):
    _check(device, [(0, 0, 90, 70)], np.ones(1), tiles_x=90, tiles_y=70)
    _, depth = _scene(150, tiles_x=1, tiles_y=1)
    boxes = [(-(2**31), -(2**31), 2**31 - 1, 2**31 - 1)] * 150
    _check(device, boxes, depth, tiles_x=30, tiles_y=20)
    hostile = [(2**31 - 1, 0, -(2**31), 5), (-(2**31), 2**31 - 1, 2**31 - 1, -(2**31))]
    _check(device, hostile + boxes[:3], depth[:5], tiles_x=30, tiles_y=20)


@pytest.mark.parametrize("shape", [(1, 500), (500, 1)])
def test_images_of_one_row_or_column_of_tiles(device, shape):
    tiles_y, tiles_x = shape
    boxes, depth = _scene(3000, tiles_x=tiles_x, tiles_y=tiles_y, largest=6)
    _check(device, boxes, depth, tiles_x=tiles_x, tiles_y=tiles_y)


def test_depths_of_every_kind_sort_as_numbers(device):
    depth = np.random.default_rng(3).permutation(np.tile(TELLING, 40))
    _check(device, [(0, 0, 2, 1)] * len(depth), depth, tiles_x=2, tiles_y=1)


def test_zeros_of_either_sign_are_equal(device):
    _, entries, _ = _lists(device, [(0, 0, 1, 1)] * 4, [0.0, -0.0] * 2, tiles_x=1, tiles_y=1)
    assert entries[:, 0].tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("sort", [True, False])
@pytest.mark.parametrize("bits", [0x7FC00000, 0xFFC00000, 0x7F800001, 0xFFFFFFFF])
def test_nan_is_never_visible(device, bits, sort):
    depth = np.array([3, 0, 1], np.float32)
    depth.view(np.uint32)[1] = bits
    boxes, grid = [(0, 0, 2, 2)] * 3, {"tiles_x": 2, "tiles_y": 2, "sort": sort}
    _check(device, boxes, depth, **grid)
    slots, entries, _ = _lists(device, boxes, depth, **grid)
    assert slots.tolist() == [0, 4, 4, 8]
    assert 1 not in entries[:, 0]


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_any_splats(device, data):
    grid = {"tiles_x": data.draw(st.integers(1, 9)), "tiles_y": data.draw(st.integers(1, 9))}
    corner = st.integers(-2, 11)
    splat = st.tuples(st.tuples(corner, corner, corner, corner), BITS)
    splats = data.draw(st.lists(splat, max_size=150))
    depth = np.array([bits for _, bits in splats], np.uint32).view(np.float32)
    _check(device, [box for box, _ in splats], depth, sort=data.draw(st.booleans()), **grid)


def test_slots_are_a_permutation_and_lists_go_from_front_to_back(device):
    grid = {"tiles_x": 13, "tiles_y": 7}
    boxes, depth = _scene(20000, **grid)
    slots, entries, starts = _lists(device, boxes, depth, **grid)
    assert np.array_equal(np.sort(entries[:, 1]), np.arange(len(entries)))
    splat, slot = entries.T
    assert ((slots[splat] <= slot) & (slot < slots[splat + 1])).all()
    forward = np.diff(depth[splat]) >= 0
    forward[starts[1:-1] - 1] = True
    assert forward.all()


@pytest.mark.parametrize("size", [(37, 50), (8, 8)])
def test_slots_of_what_is_seen_keep_their_order(device, size):
    edge, first_row = 8, 1
    tiles = Tiles(-(-size[1] // edge), -(-size[0] // edge), first_row)
    boxes, depth = _scene(300, tiles_x=tiles.across, tiles_y=tiles.rows + 1)
    arrays = device.array(boxes.astype(np.int32)), device.array(depth)
    lists = tile_lists(device, *arrays, tiles)
    slots, entries, starts = (device.get(getattr(lists, field)) for field in FIELDS)
    last = np.zeros(((first_row + tiles.rows) * edge, tiles.across * edge), np.int32)
    random, seen = np.random.default_rng(0), np.zeros(len(entries), bool)
    for tile, (begin, end) in enumerate(pairwise(starts)):
        y, x = tile // tiles.across + first_row, tile % tiles.across
        deepest = random.integers(0, end - begin + 1)
        last[y * edge + random.integers(edge) % max(1, size[0] % edge), x * edge] = deepest
        seen[begin : begin + deepest] = True
    image = first_row * edge + size[0], size[1]
    last = np.ascontiguousarray(last[: image[0], : image[1]])
    ours = seen_slots(device, lists, device.array(last), image, edge)
    number = np.cumsum(np.bincount(entries[seen, 1], minlength=len(entries)))
    assert ours.n_slots == seen.sum() and ours.n_entries == len(entries)
    assert np.array_equal(device.get(ours.slots), np.concatenate([[0], number])[slots])
    found = device.get(ours.entries)
    assert np.array_equal(found[:, 0], entries[:, 0])
    assert np.array_equal(found[seen, 1], number[entries[seen, 1]] - 1)


def test_runs_repeat_bit_for_bit(device):
    grid = {"tiles_x": 40, "tiles_y": 30}
    boxes, depth = _scene(20000, **grid)
    first = _lists(device, boxes, np.round(depth), **grid)
    for _ in range(4):
        for ours, before in zip(_lists(device, boxes, np.round(depth), **grid), first, strict=True):
            assert np.array_equal(ours, before)


@pytest.mark.parametrize("splats", [2048, 5000])
def test_more_entries_than_can_be_numbered(device, splats):
    grid = {"tiles_x": 1024, "tiles_y": 1024}
    entries = splats << 20
    with pytest.raises(ResourceLimitError, match=f"cover {entries} tiles") as caught:
        _lists(device, [(0, 0, 1024, 1024)] * splats, np.ones(splats), **grid)
    assert "larger tiles" in str(caught.value)


def test_lists_larger_than_the_memory_budget(device):
    small = rift.Device(device._handle, device.selector, traits=device.traits, memory=1 << 20)
    with pytest.raises(ResourceLimitError, match="100 splats, 120000 entries, 1200 tiles"):
        _lists(small, [(0, 0, 40, 30)] * 100, np.ones(100), tiles_x=40, tiles_y=30)
    _check(small, [(0, 0, 40, 30)] * 10, np.ones(10), tiles_x=40, tiles_y=30)


@pytest.mark.parametrize("splats, side", [(0, 200), (1, 1), (3, 90), (5000, 3), (40000, 30)])
def test_the_estimate_covers_every_allocation(device, monkeypatch, splats, side):
    boxes, depth = _scene(splats, tiles_x=side, tiles_y=side)
    arrays = device.array(boxes.astype(np.int32)), device.array(depth)
    taken = []
    allocate = device.empty

    def counting(*arguments):
        taken.append(allocate(*arguments))
        return taken[-1]

    monkeypatch.setattr(device, "empty", counting)
    lists = tile_lists(device, *arrays, Tiles(side, side))
    total = sum(array.nbytes for array in taken)
    assert 0 < total <= tile_lists_bytes(splats, lists.n_entries, tiles=side * side)


def test_unusable_arguments(device):
    boxes, depths, tiles = device.zeros((5, 4), np.int32), device.zeros(5), Tiles(2, 2)
    with pytest.raises(ShapeError, match="boxes has shape"):
        tile_lists(device, device.zeros((5, 3), np.int32), depths, tiles)
    with pytest.raises(DTypeError, match="boxes has type"):
        tile_lists(device, device.zeros((5, 4)), depths, tiles)
    with pytest.raises(ShapeError, match="boxes is a view"):
        tile_lists(device, device.zeros((7, 4), np.int32)[2:], depths, tiles)
    with pytest.raises(ShapeError, match="depths has shape"):
        tile_lists(device, boxes, device.zeros(4), tiles)
    with pytest.raises(InputError, match="one tile"):
        Tiles(0, 2)
    with pytest.raises(ResourceLimitError, match="larger tiles"):
        Tiles(1 << 16, 1 << 16)
