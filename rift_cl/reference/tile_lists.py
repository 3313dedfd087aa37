"""Which splats each tile of an image must draw, and in which order, from the definition.

Every splat has a box of tiles; every (splat, tile) pair of a box becomes an entry of that tile's
list. Within a list nearer splats come first, and splats of equal depth by index.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Ints = NDArray[np.int32]


class TileListArrays(NamedTuple):
    """Tile lists on the host.

    Args:
        slots: (N + 1,) where each splat's slots begin, in index order.
        entries: (M, 2) the pairs (splat, slot), tile after tile.
        starts: (tiles + 1,) where each tile's entries begin.
    """

    slots: Ints
    entries: Ints
    starts: Ints


def tile_lists(
    boxes: ArrayLike,
    depth: ArrayLike,
    *,
    tiles_x: int,
    tiles_y: int,
    first_row: int = 0,
    sort: bool = True,
) -> TileListArrays:
    """The tile lists of N splats.

    Args:
        boxes: (N, 4) rectangles of tiles [x0, y0, x1, y1), cut to the image; empty is culled.
        depth: (N,) distances from the camera; a splat at NaN is culled.
        tiles_x: tiles in a row.
        tiles_y: rows of tiles.
        first_row: the row of tiles that they begin with, and are counted from.
        sort: front to back; otherwise in index order.
    """
    depths: NDArray[np.float32] = np.asarray(depth, dtype=np.float32)
    down = np.array([0, first_row, 0, first_row])
    moved = np.asarray(boxes, np.int64).reshape(-1, 4) - down
    clipped: NDArray[Any] = np.clip(moved, 0, [tiles_x, tiles_y, tiles_x, tiles_y])
    sides = np.maximum(clipped[:, 2:].astype(np.int64) - clipped[:, :2], 0)
    areas = np.where(np.isnan(depths), 0, sides.prod(axis=1))
    slots = np.concatenate([[0], np.cumsum(areas)])
    order = np.flatnonzero(areas)
    if sort:
        order = order[np.argsort(depths[order], kind="stable")]
    splats = np.repeat(order, areas[order])
    numbers = np.concatenate([np.arange(0), *(np.arange(area) for area in areas[order])])
    rows, columns = np.divmod(numbers, np.maximum(sides[splats, 0], 1))
    tiles = (clipped[splats, 1] + rows) * tiles_x + clipped[splats, 0] + columns
    by_tile = np.argsort(tiles, kind="stable")
    entries = np.stack([splats, slots[splats] + numbers], axis=1)[by_tile]
    starts = np.searchsorted(tiles[by_tile], np.arange(tiles_x * tiles_y + 1))
    return TileListArrays(*(array.astype(np.int32) for array in (slots, entries, starts)))
