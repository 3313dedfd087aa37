"""Random splats on a screen, with their tile lists, without the stages that come before."""

from dataclasses import dataclass

import numpy as np

from rift_cl.splat.raster import ScreenSplats
from rift_cl.splat.tile_lists import TileLists, Tiles

FARTHEST = 4.0


@dataclass(frozen=True)
class ScreenScene:
    """Host arrays of a scene on the screen."""

    screen: np.ndarray
    depths: np.ndarray
    features: np.ndarray
    slots: np.ndarray
    entries: np.ndarray
    starts: np.ndarray
    tiles: Tiles
    size: tuple[int, int]

    def upload(self, device):
        """The scene as the raster driver takes it."""
        splats = ScreenSplats(*map(device.array, (self.screen, self.features)))
        arrays = map(device.array, (self.slots, self.entries, self.starts))
        return splats, TileLists(*arrays, len(self.entries), self.tiles)


def random_scene(count, size, *, seed=0, channels=3, scale=4.0, tile=16, weights=(0.05, 0.99)):
    """Splats of random place, shape, weight, depth and colour."""
    random = np.random.default_rng(seed)
    height, width = size
    screen = np.zeros((count, 8), np.float32)
    screen[:, :2] = random.uniform(-0.1, 1.1, (count, 2)) * (width, height)
    spread = np.exp(random.normal(np.log(scale), 0.5, (count, 2))) ** 2
    turn = random.uniform(0, np.pi, count)
    c, s = np.cos(turn), np.sin(turn)
    xx = c**2 * spread[:, 0] + s**2 * spread[:, 1] + 0.3
    yy = s**2 * spread[:, 0] + c**2 * spread[:, 1] + 0.3
    xy = c * s * (spread[:, 0] - spread[:, 1])
    screen[:, 2:5] = np.stack([yy, -xy, xx], axis=1) / (xx * yy - xy**2)[:, None]
    screen[:, 5] = random.uniform(*weights, count)
    depths = random.uniform(1, 2, count)
    screen[:, 6:] = FARTHEST * np.sqrt(np.stack([xx, yy], axis=1))
    features = random.uniform(0, 1, (count, channels)).astype(np.float32)
    return ScreenScene(
        screen, depths, features, *lists_of(screen, depths, Tiles.of(size, tile), tile), size
    )


def lists_of(screen, depths, tiles, edge):
    """Slots, entries and starts of the tile lists, and the tiles."""
    most = (tiles.across, tiles.rows)
    low = np.clip(np.floor((screen[:, :2] - screen[:, 6:]) / edge), 0, most).astype(int)
    high = np.clip(np.ceil((screen[:, :2] + screen[:, 6:]) / edge), 0, most).astype(int)
    counts = np.prod(np.maximum(high - low, 0), axis=1)
    slots = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    splat = np.repeat(np.arange(len(screen)), counts)
    place = np.arange(len(splat)) - slots[splat]
    across = np.maximum(high - low, 1)[splat, 0]
    tile_id = (low[splat, 1] + place // across) * tiles.across + low[splat, 0] + place % across
    rank = np.empty(len(screen), int)
    rank[np.argsort(depths, kind="stable")] = np.arange(len(screen))
    order = np.lexsort((rank[splat], tile_id))
    entries = np.stack([splat, slots[splat] + place], axis=1)[order].astype(np.int32)
    starts = np.searchsorted(tile_id[order], np.arange(tiles.count + 1)).astype(np.int32)
    return slots, entries, starts, tiles


def numbers_of(device, records):
    """What the raster's gradient left in each slot, in float64; zero where nothing is."""
    live = device.get(records.live).astype(bool)
    return np.where(live[:, None], device.get(records.numbers), np.float32(0)).astype(float)
