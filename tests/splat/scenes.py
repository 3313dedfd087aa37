"""Random splats on a screen, with their tile lists, without the stages that come before."""

from dataclasses import dataclass

import numpy as np

from rift_cl.splat.raster import ScreenSplats
from rift_cl.splat.tile_lists import TileLists

FARTHEST = 3.33


@dataclass(frozen=True)
class ScreenScene:
    """Host arrays of a scene on the screen."""

    screen: np.ndarray
    radii: np.ndarray
    features: np.ndarray
    slots: np.ndarray
    entries: np.ndarray
    starts: np.ndarray
    tiles: tuple[int, int]
    size: tuple[int, int]

    def upload(self, device):
        """The scene as the raster driver takes it."""
        splats = ScreenSplats(*map(device.array, (self.screen, self.radii, self.features)))
        arrays = map(device.array, (self.slots, self.entries, self.starts))
        return splats, TileLists(*arrays, len(self.entries), self.tiles[1], self.tiles[0])


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
    screen[:, 6] = random.uniform(1, 2, count)
    radii = np.ceil(FARTHEST * np.sqrt(np.stack([xx, yy], axis=1))).astype(np.int32)
    features = random.uniform(0, 1, (count, channels)).astype(np.float32)
    return ScreenScene(screen, radii, features, *_lists(screen, radii, size, tile), size)


def _lists(screen, radii, size, tile):
    tiles = np.array([-(-size[1] // tile), -(-size[0] // tile)])
    low = np.clip(np.floor((screen[:, :2] - radii) / tile), 0, tiles).astype(int)
    high = np.clip(np.ceil((screen[:, :2] + radii) / tile), 0, tiles).astype(int)
    counts = np.prod(np.maximum(high - low, 0), axis=1)
    slots = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    splat = np.repeat(np.arange(len(screen)), counts)
    place = np.arange(len(splat)) - slots[splat]
    across = np.maximum(high - low, 1)[splat, 0]
    tile_id = (low[splat, 1] + place // across) * tiles[0] + low[splat, 0] + place % across
    rank = np.empty(len(screen), int)
    rank[np.argsort(screen[:, 6], kind="stable")] = np.arange(len(screen))
    order = np.lexsort((rank[splat], tile_id))
    entries = np.stack([splat, slots[splat] + place], axis=1)[order].astype(np.int32)
    starts = np.searchsorted(tile_id[order], np.arange(tiles.prod() + 1)).astype(np.int32)
    return slots, entries, starts, (int(tiles[1]), int(tiles[0]))
