"""Which splats each tile of an image must draw, and in which order, from the definition.

Every splat has a box of tiles, and every (splat, tile) pair of a box, or of those of its tiles that
its ellipse reaches, becomes an entry of that tile's list. Within a list nearer splats come first,
and splats of equal depth by index.
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
    touched: NDArray[np.bool_] | None = None,
    sort: bool = True,
) -> TileListArrays:
    """The tile lists of N splats.

    Args:
        boxes: (N, 4) rectangles of tiles [x0, y0, x1, y1), cut to the image; empty is culled.
        depth: (N,) distances from the camera; a splat at NaN is culled.
        tiles_x: tiles in a row.
        tiles_y: rows of tiles.
        first_row: the row of tiles that they begin with, and are counted from.
        touched: (N, tiles_y, tiles_x) which tiles count of those in a box; all if not given.
        sort: front to back; otherwise in index order.
    """
    depths: NDArray[np.float32] = np.asarray(depth, dtype=np.float32)
    down = np.array([0, first_row, 0, first_row])
    moved = np.asarray(boxes, np.int64).reshape(-1, 4) - down
    x0, y0, x1, y1 = np.clip(moved, 0, [tiles_x, tiles_y, tiles_x, tiles_y]).T[:, :, None]
    columns, rows = np.arange(tiles_x), np.arange(tiles_y)
    within: NDArray[Any] = ((y0 <= rows) & (rows < y1))[:, :, None]
    within = within & ((x0 <= columns) & (columns < x1))[:, None] & ~np.isnan(depths)[:, None, None]
    if touched is not None:
        within &= touched
    slots = np.concatenate([[0], np.cumsum(within.sum(axis=(1, 2)))])
    owners, tiles = np.nonzero(within.reshape(len(depths), tiles_x * tiles_y))
    places = np.arange(len(owners))
    order = np.argsort(depths[owners], kind="stable") if sort else places
    order = order[np.argsort(tiles[order], kind="stable")]
    entries = np.stack([owners, places], axis=1)[order]
    starts = np.searchsorted(tiles[order], np.arange(tiles_x * tiles_y + 1))
    return TileListArrays(*(array.astype(np.int32) for array in (slots, entries, starts)))


def reached_tiles(
    screen: ArrayLike,
    *,
    tiles_x: int,
    tiles_y: int,
    edge: int,
    first_row: int = 0,
    grown: float = 0,
) -> NDArray[np.bool_]:
    """(N, tiles_y, tiles_x) whether a pixel centre of a tile lies in a splat's ellipse.

    Args:
        screen: (N, 8): mean, conic a, b, c, weight, half sides of the ellipse's box.
        tiles_x: tiles in a row.
        tiles_y: rows of tiles.
        edge: pixels along a side of a tile.
        first_row: the row of tiles that they begin with.
        grown: pixels by which the half sides are larger.
    """
    x, y, a, b, c, _, ex, ey = np.asarray(screen, float).T[:, :, None, None]
    ex, ey, slant = ex + grown, ey + grown, -b / np.sqrt(a * c)
    u = (np.arange(tiles_x * edge) + 0.5 - x) / ex
    v = (np.arange(tiles_y * edge)[:, None] + first_row * edge + 0.5 - y) / ey
    inside = u * u - 2 * slant * u * v + v * v <= 1 - slant * slant
    reached: NDArray[np.bool_] = inside.reshape(-1, tiles_y, edge, tiles_x, edge).any(axis=(2, 4))
    return reached
