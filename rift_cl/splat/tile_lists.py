"""Tile lists: which splats each tile of the image draws, front to back.

The N splats are sorted by depth once (a stable radix sort of their visible part), and their
(splat, tile) pairs are then placed by one stable counting sort over tiles. That is far less work
than sorting all M pairs by (tile, depth), and since every step counts chunk by chunk and places in
the order of the chunks, the lists are the same whatever the device and the number of work-items.

A chunk is a work-item's on a CPU and a group's on a GPU, where neighbours find each other's equal
keys in local memory (``kernels/include/vector/equal_keys.h``). What one work-item counts alone
(WHOLE), it sums up on the way. Integers are exact, so the result does not depend on how a list was
cut.

Only M, the number of entries, comes to the host on the way: it is needed to allocate them. All that
goes by splats is enqueued before it is waited for, so that the device works on meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_device_array, fetch
from rift_cl.errors import InputError, ResourceLimitError, ShapeError
from rift_cl.splat.prefix_sums import (
    Levels,
    exclusive_scan,
    for_kind,
    pieces,
    run_length,
    scan_levels,
)

_MOST = 2**31 - 1
# Ints that a drawn splat's span has room for; it needs four. Spans are gone when splats are packed,
# and records, which have as many numbers, take the same memory: less would be held beside it.
_SPAN_ROOM = 16
# Columns of tiles that the kernels can tell: see ``kernels/include/splat/tile_spans.h``.
_MOST_ACROSS = 2**24 - 1
_KEY_BITS = 32
# Groups of a GPU: keys of the depth sort, and pairs, that one goes through at least; its items.
_GPU_KEYS, _GPU_PAIRS, _GPU_GROUP = 2048, 512, 128
# Bits that one pass of the depth sort looks at.
_DIGIT = 8
# Rows of a GPU's table of chunks that one item sums up.
_BLOCK = 64
# The chunks' histograms over tiles may have so many numbers for each entry of the lists.
_TABLE_SHARE = 2


@dataclass(frozen=True)
class Tiles:
    """Rows of an image's tiles; tile t is in row ``first_row + t // across``.

    Args:
        across: tiles in a row.
        rows: rows of tiles.
        first_row: the image's row of tiles that they begin with.

    Raises:
        InputError: there are no tiles.
        ResourceLimitError: there are more than can be numbered.
    """

    across: int
    rows: int
    first_row: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.across < 1 or self.rows < 1 or self.first_row < 0:
            raise InputError(
                f"Tiles: across, rows, first_row are {self.across}, {self.rows}, "
                f"{self.first_row}, wanted at least one tile"
            )
        if self.across > _MOST_ACROSS or self.across * (self.first_row + self.rows) >= _MOST:
            raise ResourceLimitError(
                f"Tiles: {self.across} x {self.first_row + self.rows} are too many, wanted less "
                f"than {_MOST}, and {_MOST_ACROSS} in a row at most: use larger tiles"
            )

    @classmethod
    def of(cls, size: tuple[int, int], edge: int) -> Tiles:
        """All tiles of an image of (height, width) pixels."""
        return cls(-(-size[1] // edge), -(-size[0] // edge))

    @property
    def count(self) -> int:
        """How many tiles there are."""
        return self.across * self.rows


@dataclass(frozen=True, eq=False)
class Ellipses:
    """What splats draw of their boxes of tiles.

    Args:
        screen: (N, 8) device array, see ``ScreenSplats``.
        edge: pixels along a side of a tile.
    """

    screen: DeviceArray
    edge: int


@dataclass(frozen=True, eq=False)
class TileLists:
    """The lists of all tiles, on the device.

    Args:
        slots: (N + 1,) int32, where each splat's slots begin, in index order.
        entries: (M, 2) int32, the pairs (splat, slot), tile after tile, front to back within one.
            A slot is ``slots[splat]`` plus the row-major place of the tile among the splat's own.
        starts: (tiles + 1,) int32, where each tile's entries begin.
        n_entries: M.
        tiles: the tiles that were listed.
        n_slots: how many slots there are: M, or fewer after ``seen_slots``.
    """

    slots: DeviceArray
    entries: DeviceArray
    starts: DeviceArray
    n_entries: int
    tiles: Tiles
    n_slots: int = field(default=-1)

    def __post_init__(self) -> None:
        """Every entry has a slot where nothing else is said."""
        if self.n_slots < 0:
            object.__setattr__(self, "n_slots", self.n_entries)


@dataclass(frozen=True, eq=False)
class TileCounts:
    """The splats of the tile lists in their order, and how many entries each has.

    Args:
        slots: (N + 1,) int32, as in ``TileLists``.
        ranks: (N, 4) int32, the tiles of each splat, in the order of the lists: see
            ``kernels/include/splat/tile_spans.h``.
        owners: (N, 2) int32, where its slots begin, and its index.
        offsets: (N + 1,) int32, how many entries the ranks before have.
        tiles: the tiles that are to be listed.
        total: waits for M and gives it, (1,).
    """

    slots: DeviceArray
    ranks: DeviceArray
    owners: DeviceArray
    offsets: DeviceArray
    tiles: Tiles
    total: Callable[[], NDArray[np.int64]]

    @cached_property
    def n_entries(self) -> int:
        """M, which is waited for.

        Raises:
            ResourceLimitError: there are 2^31 entries or more.
        """
        entries = int(self.total()[0])
        if entries > _MOST:
            raise ResourceLimitError(
                f"the {len(self.ranks)} splats cover {entries} tiles in all, at most {_MOST} can "
                "be listed: use larger tiles, a smaller image, or fewer or smaller splats"
            )
        return entries


def tile_lists(
    device: Device,
    boxes: DeviceArray,
    depths: DeviceArray,
    tiles: Tiles,
    *,
    ellipses: Ellipses | None = None,
    sort: bool = True,
) -> TileLists:
    """List the splats of every tile: ``count_tiles`` and ``list_tiles``, which say more."""
    counts = count_tiles(device, boxes, depths, tiles, ellipses=ellipses, sort=sort)
    return list_tiles(device, counts)


def count_tiles(
    device: Device,
    boxes: DeviceArray,
    depths: DeviceArray,
    tiles: Tiles,
    *,
    ellipses: Ellipses | None = None,
    sort: bool = True,
) -> TileCounts:
    """Order the splats and count the tiles of each; nothing waits for the device.

    Args:
        device: where the arrays are.
        boxes: (N, 4) int32 device array, each splat's tiles [x0, y0, x1, y1). A splat whose box
            holds none of the tiles is culled; what lies outside of them is cut off.
        depths: (N,) float32 device array: any number, infinite ones and negative ones too. A
            splat whose depth is NaN is culled.
        tiles: which tiles to list.
        ellipses: what the splats draw of their boxes, all of it if not given. Tiles that an
            ellipse does not reach are left out; of boxes of more than 8 x 8 tiles as many cells.
        sort: front to back, equal depths by index; otherwise all in index order.

    Raises:
        ShapeError: an array has the wrong shape or is a strided view.
        DTypeError: an array has the wrong type.
        ResourceLimitError: not even counts fit the budget.
    """
    splats = _checked_splats(device, boxes, depths, ellipses)
    _check_room(device, splats, 0, tiles)
    slots, keys = device.empty(splats + 1, np.int32), device.empty(splats, np.uint32)
    levels = scan_levels(device, _longest_scan(device, splats))
    run = run_length(device, splats, gpu=1)
    spans = device.empty((splats, _SPAN_ROOM if ellipses else 4), np.int32)
    by_splat = {"spans": spans, "splats": splats, "run": run}
    runs = pieces(splats, run)
    total = device.empty(1, np.int64) if runs == 1 else None
    device.launch(
        "tile_count",
        (runs,),
        **by_splat,
        boxes=boxes,
        depths=depths,
        counts=slots,
        keys=keys,
        total=total,
        tiles_x=tiles.across,
        first_tile_row=tiles.first_row,
        tiles_y=tiles.rows,
        screen=ellipses.screen if ellipses else None,
        edge=ellipses.edge if ellipses else None,
        WHOLE=runs == 1,
        ELLIPSES=ellipses is not None,
    )
    if total is None:
        total = exclusive_scan(device, slots, splats + 1, levels)
    sent = fetch(device, total, 1)
    order, visible = _depth_order(device, keys, slots, levels) if sort else (None, None)
    ranks, owners = (device.empty((splats, numbers), np.int32) for numbers in (4, 2))
    offsets = device.empty(splats + 1, np.int32)
    device.launch(
        "tile_ranks",
        (runs,),
        **by_splat,
        slots=slots,
        order=order,
        visible=visible,
        ranks=ranks,
        owners=owners,
        counts=offsets,
        SORTED=sort,
        WHOLE=runs == 1,
    )
    if runs > 1:
        exclusive_scan(device, offsets, splats + 1, levels)
    return TileCounts(slots, ranks, owners, offsets, tiles, sent)


def list_tiles(device: Device, counts: TileCounts) -> TileLists:
    """Make the lists that were counted.

    Args:
        device: where the arrays are.
        counts: from ``count_tiles``.

    Raises:
        ResourceLimitError: there are 2^31 entries or more, or they do not fit the memory budget.
    """
    slots, entries, tiles = counts.slots, counts.n_entries, counts.tiles
    _check_room(device, len(counts.ranks), entries, tiles)
    if entries == 0:
        nothing = device.empty((0, 2), np.int32)
        return TileLists(slots, nothing, device.zeros(tiles.count + 1, np.int32), 0, tiles)
    listed, starts = _sort_by_tile(device, counts)
    return TileLists(slots, listed, starts, entries, tiles)


def seen_slots(
    device: Device, lists: TileLists, last: DeviceArray, size: tuple[int, int], edge: int
) -> TileLists:
    """Give slots to those entries alone that a gradient looks at, in the same order.

    Arrays of the lists are written over, so that these are no lists of all splats any more: slots
    of other entries mean nothing.

    Args:
        device: where the arrays are, a CPU: gradients on GPUs clear the slots of all entries.
        lists: of an image that was drawn.
        last: (height, width) int32, how many entries of its tile each pixel looks at.
        size: (height, width) in pixels.
        edge: pixels along a side of a tile.
    """
    tiles, pairs = lists.tiles, lists.n_slots + 1
    seen = device.zeros(pairs, np.int32)
    device.launch(
        "slot_seen",
        (tiles.count,),
        entries=lists.entries,
        starts=lists.starts,
        last=last,
        seen=seen,
        height=size[0],
        width=size[1],
        tiles_x=tiles.across,
        first_tile_row=tiles.first_row,
        tiles=tiles.count,
        TILE=edge,
    )
    total = exclusive_scan(device, seen, pairs, scan_levels(device, pairs))
    count = fetch(device, total, 1)
    for numbers, stride in ((lists.entries, 2), (lists.slots, 1)):
        length = len(numbers)
        run = run_length(device, length, gpu=1)
        work = {"numbers": numbers, "before": seen, "count": length, "run": run}
        device.launch("slot_number", (pieces(length, run),), **work, STRIDE=stride)
    return replace(lists, n_slots=int(count()[0]))


def tile_lists_bytes(n: int, m: int, *, tiles: int = 0) -> int:
    """Most bytes that ``tile_lists`` takes on the device at a time, its result included.

    Args:
        n: splats.
        m: entries of all lists.
        tiles: tiles of the image; they may be left out where they are far fewer than entries.
    """
    # Splats: slots, offsets, keys and order twice, spans, ranks and owners (64), digits (1), sums
    # of scans. Entries: the lists (8) and the chunks' histograms, which have a row of all tiles at
    # least, and on GPUs the sums of blocks of them.
    table = 4 * max(_TABLE_SHARE * m, tiles)
    return 66 * n + 8 * m + table + table // _BLOCK + 9 * tiles + (1 << 14)


def _checked_splats(
    device: Device, boxes: DeviceArray, depths: DeviceArray, ellipses: Ellipses | None
) -> int:
    if len(boxes.shape) != 2 or boxes.shape[1] != 4:
        raise ShapeError(f"boxes has shape {boxes.shape}, wanted (splats, 4)")
    as_device_array(device, boxes, boxes.shape, name="boxes", dtype=np.int32)
    as_device_array(device, depths, (boxes.shape[0],), name="depths")
    if ellipses:
        as_device_array(device, ellipses.screen, (boxes.shape[0], 8), name="screen")
    return int(boxes.shape[0])


def _check_room(device: Device, splats: int, entries: int, tiles: Tiles) -> None:
    need = tile_lists_bytes(splats, entries, tiles=tiles.count)
    what = f"set of tile lists ({splats} splats, {entries} entries, {tiles.count} tiles)"
    plan_chunks(1, need, 0, device.budget, what=what)


def _longest_scan(device: Device, splats: int) -> int:
    """Most numbers of any scan by splats: of these, or of the digits of a radix pass."""
    return max(splats + 1, _radix_chunks(device, splats) << _DIGIT)


def _depth_order(
    device: Device, keys: DeviceArray, slots: DeviceArray, levels: Levels
) -> tuple[DeviceArray, DeviceArray | None]:
    """Sort the splats that have slots by key: their order (N, visible in front) and number."""
    splats, chunks = keys.size, _radix_chunks(device, keys.size)
    here = keys, device.empty(splats, np.int32)
    there = device.empty(splats, np.uint32), device.empty(splats, np.int32)
    if device.traits.is_cpu and chunks == 1:
        return _sorted_at_once(device, here, there, slots)
    table = device.empty(chunks << _DIGIT, np.int32)
    group = _group(device)
    items = (chunks * group.get("GROUP", 1),)
    # The first pass finds out how many are visible, and all later ones find the same.
    visible = None
    for shift in range(0, _KEY_BITS, _DIGIT):
        sizes = {"splats": splats, "chunks": chunks, "shift": shift}
        macros = {"DIGIT_BITS": _DIGIT, "FIRST": shift == 0, **group}
        device.launch(
            for_kind(device, "radix_count"),
            items,
            keys=here[0],
            slots=slots,
            visible=visible,
            table=table,
            **sizes,
            **macros,
        )
        visible = exclusive_scan(device, table, table.size, levels)
        device.launch(
            for_kind(device, "radix_scatter"),
            items,
            keys=here[0],
            order=here[1],
            moved_keys=there[0],
            moved_order=there[1],
            slots=slots,
            visible=visible,
            table=table,
            **sizes,
            **macros,
        )
        here, there = there, here
    return here[1], visible


def _sorted_at_once(
    device: Device,
    here: tuple[DeviceArray, DeviceArray],
    there: tuple[DeviceArray, DeviceArray],
    slots: DeviceArray,
) -> tuple[DeviceArray, DeviceArray]:
    """The same by one work-item, which a list of one chunk keeps busy anyway."""
    visible = device.empty(1, np.int64)
    device.launch(
        "radix_sort_cpu",
        (1,),
        keys=here[0],
        order=here[1],
        other_keys=there[0],
        other_order=there[1],
        slots=slots,
        visible=visible,
        splats=here[0].size,
    )
    return here[1], visible


def _radix_chunks(device: Device, splats: int) -> int:
    """Chunks that the depth sort cuts the list of splats into."""
    return pieces(splats, run_length(device, splats, gpu=_GPU_KEYS))


def _group(device: Device) -> dict[str, int]:
    """The items of a group that shares a chunk; on a CPU one item has it."""
    return {} if device.traits.is_cpu else {"GROUP": _GPU_GROUP}


def _sort_by_tile(device: Device, counts: TileCounts) -> tuple[DeviceArray, DeviceArray]:
    """Place the pairs of all ranks by tile: entries and starts."""
    pairs, across, tiles = counts.n_entries, counts.tiles.across, counts.tiles.count
    chunks = pieces(pairs, run_length(device, pairs, gpu=_GPU_PAIRS))
    chunks = min(chunks, max(1, _TABLE_SHARE * pairs // tiles))
    chunks = min(chunks, max(1, device.traits.allocation // (4 * tiles)))
    table = device.empty((chunks, tiles), np.int32)
    starts = device.empty(tiles + 1, np.int32)
    entries = device.empty((pairs, 2), np.int32)
    walk = {
        "ranks": counts.ranks,
        "offsets": counts.offsets,
        "splats": len(counts.ranks),
        "pairs": pairs,
        "tiles_x": across,
        "first_tile_row": counts.tiles.first_row,
        "table": table,
        "chunks": chunks,
        "tiles": tiles,
    }
    group, owners = _group(device), {"owners": counts.owners}
    items = (chunks * group.get("GROUP", 1),)
    # On a CPU both kernels walk alike, and are given alike.
    counted = owners if device.traits.is_cpu else {}
    device.launch(for_kind(device, "tile_histogram"), items, **walk, **counted, **group)
    _column_offsets(device, table, starts)
    lists = {**owners, "starts": starts, "entries": entries}
    device.launch(for_kind(device, "tile_scatter"), items, **walk, **lists, **group)
    return entries, starts


def _column_offsets(device: Device, table: DeviceArray, starts: DeviceArray) -> None:
    """Replace a table's columns by the sums of the rows before; ``starts`` by those of all."""
    chunks, tiles = table.shape
    blocks = pieces(chunks, _BLOCK)
    rows, by_block = table, {"table": table, "chunks": chunks, "tiles": tiles, "rows": _BLOCK}
    if not device.traits.is_cpu and blocks > 1:
        rows = device.empty((blocks, tiles), np.int32)
        device.launch("tile_sums_gpu", (tiles, blocks), **by_block, sums=rows)
    run = run_length(device, tiles, gpu=1)
    runs = pieces(tiles, run)
    by_tile = {"counts": starts, "chunks": len(rows), "tiles": tiles, "run": run}
    device.launch("tile_offsets", (runs,), table=rows, **by_tile, WHOLE=runs == 1)
    if rows is not table:
        device.launch("tile_places_gpu", (tiles, blocks), **by_block, sums=rows)
    if runs > 1:
        exclusive_scan(device, starts, tiles + 1, scan_levels(device, tiles + 1))
