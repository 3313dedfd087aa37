"""Tile lists: which splats each tile of the image draws, front to back.

The N splats are sorted by depth once (a stable radix sort of their visible part), and their
(splat, tile) pairs are then placed by one stable counting sort over tiles. That is far less work
than sorting all M pairs by (tile, depth), and since every step counts chunk by chunk and places in
the order of the chunks, the lists are the same whatever the device and the number of work-items.

Only M, the number of entries, comes to the host on the way: it is needed to allocate them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.memory import as_device_array
from rift_cl.errors import DTypeError, InputError, ResourceLimitError, ShapeError

_MOST = 2**31 - 1
_KEY_BITS = 32
# A CPU's cores take so many chunks each, which evens their loads, of at least so many elements,
# below which starting a kernel costs more than running it.
_CPU_CHUNKS, _CPU_LEAST = 4, 4096
# A GPU's work-items are many: each takes so few elements of a list, and of the pairs.
_GPU_RUN, _GPU_PAIRS = 64, 256
# Bits that one pass of the depth sort looks at; a GPU's items have less local memory for counters.
_CPU_DIGIT, _GPU_DIGIT = 8, 4
# The chunks' histograms over tiles may have so many numbers for each entry of the lists.
_TABLE_SHARE = 2

# A scan goes up and down a pyramid of sums: the run that each level sums up, and its sums.
_Levels = list[tuple[int, Any]]


@dataclass(frozen=True, eq=False)
class TileLists:
    """The lists of all tiles, on the device.

    Args:
        slots: (N + 1,) int32, where each splat's slots begin, in index order.
        entries: (M, 2) int32, the pairs (splat, slot), tile after tile, front to back within one.
            A slot is ``slots[splat]`` plus the row-major place of the tile in the splat's box.
        starts: (tiles + 1,) int32, where each tile's entries begin; tile ``ty * tiles_x + tx``.
        n_entries: M.
        tiles_x: tiles in a row.
        tiles_y: rows of tiles.
    """

    slots: Any
    entries: Any
    starts: Any
    n_entries: int
    tiles_x: int
    tiles_y: int


def tile_lists(
    device: Device, boxes: Any, screen: Any, *, tiles_x: int, tiles_y: int, sort: bool = True
) -> TileLists:
    """List the splats of every tile.

    Args:
        device: where the arrays are.
        boxes: (N, 4) int32 device array, each splat's tiles [x0, y0, x1, y1). A splat whose box
            holds no tile of the image is culled; what lies outside the image is cut off.
        screen: (N, 8) float32 device array with the depth in column 6: any number, infinite ones
            and negative ones too. A splat whose depth is NaN is culled.
        tiles_x: tiles in a row.
        tiles_y: rows of tiles.
        sort: front to back, equal depths by index; otherwise all in index order.

    Raises:
        ShapeError: an array has the wrong shape or is a strided view.
        DTypeError: an array has the wrong type.
        InputError: there are no tiles.
        ResourceLimitError: the lists have 2^31 entries or more, or do not fit the memory budget.
    """
    splats = _checked_splats(device, boxes, screen)
    tiles = _checked_tiles(tiles_x, tiles_y)
    _check_room(device, splats, 0, tiles)
    levels = _scan_levels(device, _longest_scan(device, splats, tiles))
    grid = (tiles_x, tiles_y)
    slots, keys, entries = _count_tiles(device, boxes, screen, grid, levels)
    _check_room(device, splats, entries, tiles)
    if entries == 0:
        nothing = device.empty((0, 2), np.int32)
        return TileLists(slots, nothing, device.zeros(tiles + 1, np.int32), 0, *grid)
    order, visible = _depth_order(device, keys, slots, levels) if sort else (None, None)
    ranks, offsets = device.empty((splats, 4), np.int32), device.empty(splats + 1, np.int32)
    run = _run(device, splats, gpu=1)
    gathering = (boxes, slots, order, visible, ranks, offsets, splats, run, *grid)
    device.launch("tile_ranks", (_pieces(splats, run),), *gathering, SORTED=sort)
    _exclusive_scan(device, offsets, splats + 1, levels)
    listed, starts = _sort_by_tile(device, ranks, offsets, entries, grid, levels)
    return TileLists(slots, listed, starts, entries, *grid)


def tile_lists_bytes(n: int, m: int, *, tiles: int = 0) -> int:
    """Most bytes that ``tile_lists`` takes on the device at a time, its result included.

    Args:
        n: splats.
        m: entries of all lists.
        tiles: tiles of the image; they may be left out where they are far fewer than entries.
    """
    # Splats: slots, offsets, keys and order twice, ranks (40), digits (1), sums of scans. Entries:
    # the lists (8) and the chunks' histograms, which have a row of all tiles at least.
    return 42 * n + 8 * m + 4 * max(_TABLE_SHARE * m, tiles) + 5 * tiles + (1 << 14)


def _checked_splats(device: Device, boxes: Any, screen: Any) -> int:
    if len(boxes.shape) != 2 or boxes.shape[1] != 4:
        raise ShapeError(f"boxes has shape {boxes.shape}, wanted (splats, 4)")
    if boxes.dtype != np.int32:
        raise DTypeError(f"boxes has type {boxes.dtype} on the device, wanted int32")
    # The gate wants float32; what else it looks at is the same for any type of four bytes.
    as_device_array(device, boxes.view(np.float32), boxes.shape, name="boxes")
    as_device_array(device, screen, (boxes.shape[0], 8), name="screen")
    return int(boxes.shape[0])


def _checked_tiles(tiles_x: int, tiles_y: int) -> int:
    if tiles_x < 1 or tiles_y < 1:
        raise InputError(f"tiles_x, tiles_y are {tiles_x}, {tiles_y}, wanted at least one tile")
    if tiles_x * tiles_y >= _MOST:
        raise ResourceLimitError(
            f"tiles_x * tiles_y is {tiles_x * tiles_y}, wanted less than {_MOST}: use larger tiles"
        )
    return tiles_x * tiles_y


def _check_room(device: Device, splats: int, entries: int, tiles: int) -> None:
    need = tile_lists_bytes(splats, entries, tiles=tiles)
    what = f"set of tile lists ({splats} splats, {entries} entries, {tiles} tiles)"
    plan_chunks(1, need, 0, device.budget, what=what)


def _run(device: Device, count: int, *, gpu: int) -> int:
    """Elements that one work-item goes through: a core's share on a CPU, ``gpu`` on a GPU."""
    if not device.traits.is_cpu:
        return gpu
    return max(_CPU_LEAST, _pieces(count, _CPU_CHUNKS * device.traits.compute_units))


def _pieces(count: int, size: int) -> int:
    """Pieces of this size that hold so many elements; one piece where there are none."""
    return max(1, -(-count // size))


def _longest_scan(device: Device, splats: int, tiles: int) -> int:
    """Most numbers of any scan: over splats, tiles, or the digits of a radix pass."""
    bits, chunks = _radix(device, splats)
    return max(splats + 1, tiles + 1, chunks << bits)


def _scan_levels(device: Device, most: int) -> _Levels:
    """For scans of at most so many numbers: each level's run and room for the sums of its runs."""
    run = _run(device, most, gpu=_GPU_RUN)
    sums = device.empty(_pieces(most, run), np.int64)
    return [(run, sums), *(_scan_levels(device, sums.size) if sums.size > 1 else [])]


def _exclusive_scan(
    device: Device, values: Any, count: int, levels: _Levels, *, wide: bool = False
) -> Any:
    """Replace int32 numbers (``wide``: int64) by the sum of all before; (1,) int64, the total."""
    (run, sums), *above = levels
    runs = _pieces(count, run)
    total = sums[:1]
    if runs > 1:
        device.launch("scan_sum", (runs,), values, sums, count, run, WIDE=wide)
        total = _exclusive_scan(device, sums, runs, above, wide=True)
    scanning = (values, sums, count, run)
    device.launch("scan_place", (runs,), *scanning, WIDE=wide, WHOLE=runs == 1)
    return total


def _count_tiles(
    device: Device, boxes: Any, screen: Any, grid: tuple[int, int], levels: _Levels
) -> tuple[Any, Any, int]:
    """The splats' slots (N + 1), their keys by depth (N), and the number of entries."""
    splats = boxes.shape[0]
    slots, keys = device.empty(splats + 1, np.int32), device.empty(splats, np.uint32)
    run = _run(device, splats, gpu=1)
    counting = (boxes, screen, slots, keys, splats, run, *grid)
    device.launch("tile_count", (_pieces(splats, run),), *counting)
    entries = int(device.get(_exclusive_scan(device, slots, splats + 1, levels))[0])
    if entries > _MOST:
        raise ResourceLimitError(
            f"the {splats} splats cover {entries} tiles in all, at most {_MOST} can be listed: "
            "use larger tiles, a smaller image, or fewer or smaller splats"
        )
    return slots, keys, entries


def _depth_order(device: Device, keys: Any, slots: Any, levels: _Levels) -> tuple[Any, Any]:
    """Sort the splats that have slots by key: their order (N, visible in front) and number."""
    splats = keys.size
    bits, chunks = _radix(device, splats)
    table = device.empty(chunks << bits, np.int32)
    here = keys, device.empty(splats, np.int32)
    there = device.empty(splats, np.uint32), device.empty(splats, np.int32)
    # The first pass finds out how many are visible, and all later ones find the same.
    visible = None
    for shift in range(0, _KEY_BITS, bits):
        macros = {"DIGIT_BITS": bits, "FIRST": shift == 0}
        sizes = (splats, chunks, shift)
        device.launch("radix_count", (chunks,), here[0], slots, visible, table, *sizes, **macros)
        visible = _exclusive_scan(device, table, table.size, levels)
        moving = (*here, *there, slots, visible, table, *sizes)
        device.launch("radix_scatter", (chunks,), *moving, **macros)
        here, there = there, here
    return here[1], visible


def _radix(device: Device, splats: int) -> tuple[int, int]:
    """Bits of a digit, and chunks of the list."""
    bits = _CPU_DIGIT if device.traits.is_cpu else _GPU_DIGIT
    return bits, _pieces(splats, _run(device, splats, gpu=_GPU_RUN))


def _sort_by_tile(
    device: Device, ranks: Any, offsets: Any, pairs: int, grid: tuple[int, int], levels: _Levels
) -> tuple[Any, Any]:
    """Place the pairs of all ranks by tile: entries and starts."""
    tiles = grid[0] * grid[1]
    chunks = _pieces(pairs, _run(device, pairs, gpu=_GPU_PAIRS))
    chunks = min(chunks, max(1, _TABLE_SHARE * pairs // tiles))
    table = device.empty((chunks, tiles), np.int32)
    starts = device.empty(tiles + 1, np.int32)
    entries = device.empty((pairs, 2), np.int32)
    walk, sizes = (ranks, offsets, table), (len(ranks), pairs, chunks, tiles, grid[0])
    run = _run(device, tiles, gpu=1)
    device.launch("tile_histogram", (chunks,), *walk, *sizes)
    device.launch("tile_offsets", (_pieces(tiles, run),), table, starts, chunks, tiles, run)
    _exclusive_scan(device, starts, tiles + 1, levels)
    device.launch("tile_scatter", (chunks,), *walk, starts, entries, *sizes)
    return entries, starts
