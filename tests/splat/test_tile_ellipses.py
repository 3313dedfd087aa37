"""Lists leave out the tiles of a box that its ellipse does not reach, and no tile that it does."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from scenes import random_scene
from test_raster_blocks import needles

from rift_cl.geometry import Camera
from rift_cl.reference.tile_lists import reached_tiles
from rift_cl.reference.tile_lists import tile_lists as twin
from rift_cl.splat import Renderer, Splats, SplatSettings
from rift_cl.splat.tile_lists import Ellipses, Tiles, tile_lists

RASTER_PASS = importlib.import_module("rift_cl.splat.raster_pass")


def boxes_of(screen, tiles, edge):
    """As projection has them: extents rounded up to pixels, cut to the image."""
    reach, most = np.ceil(screen[:, 6:]), (tiles.across, tiles.rows)
    low = np.clip(np.floor((screen[:, :2] - reach) / edge), 0, most)
    high = np.clip(np.ceil((screen[:, :2] + reach) / edge), 0, most)
    return np.concatenate([low, high], axis=1).astype(np.int32)


def listed(device, screen, boxes, depths, tiles, edge):
    """The lists as arrays, and which tiles each splat has, (N, rows, across)."""
    given = (
        device.array(np.ascontiguousarray(a, t))
        for a, t in zip((boxes, depths), (np.int32, np.float32), strict=True)
    )
    ellipses = Ellipses(device.array(screen.astype(np.float32)), edge)
    lists = tile_lists(device, *given, tiles, ellipses=ellipses)
    slots, entries, starts = map(device.get, (lists.slots, lists.entries, lists.starts))
    touched = np.zeros((len(screen), tiles.count), bool)
    touched[entries[:, 0], np.repeat(np.arange(tiles.count), np.diff(starts))] = True
    assert touched.sum() == len(entries) == lists.n_entries == slots[-1]
    return (slots, entries, starts), touched.reshape(-1, tiles.rows, tiles.across)


def check(device, scene, edge, *, most_missed):
    """All tiles that are reached and few others; lists equal the twin's of the same tiles."""
    screen, tiles = scene.screen, Tiles.of(scene.size, edge)
    boxes = boxes_of(screen, tiles, edge)
    arrays, touched = listed(device, screen, boxes, scene.depths, tiles, edge)
    grid = {"tiles_x": tiles.across, "tiles_y": tiles.rows}
    for ours, right in zip(arrays, twin(boxes, scene.depths, touched=touched, **grid), strict=True):
        assert np.array_equal(ours, right)
    x0, y0, x1, y1 = boxes.T[:, :, None, None]
    rows, columns = np.arange(tiles.rows)[:, None], np.arange(tiles.across)
    box = (x0 <= columns) & (columns < x1) & (y0 <= rows) & (rows < y1)
    least = reached_tiles(screen, **grid, edge=edge) & box
    assert not (least & ~touched).any() and not (touched & ~box).any()
    assert (touched & ~least).sum() <= most_missed * (box & ~least).sum()


@pytest.mark.parametrize("edge", [8, 16, 32])
def test_tiles_are_those_that_ellipses_reach(device, edge):
    check(device, random_scene(300, (120, 90), scale=6.0), edge, most_missed=0.15)


def test_needles_are_listed_where_they_are(device):
    """1200 times as long as wide; boxes of more than 8 x 8 tiles by cells."""
    check(device, needles((96, 160), 200, 32, 0.3, seed=3), 32, most_missed=0.06)
    check(device, needles((96, 160), 200, 8, 0.3, seed=4), 8, most_missed=0.5)


def test_lists_are_the_same_in_every_band(device):
    """A gradient counts entries of lists that other bands made; cells begin with the image."""
    scene, edge = needles((400, 300), 150, 8, 0.3, seed=5), 8
    whole = Tiles.of(scene.size, edge)
    given = device, scene.screen, boxes_of(scene.screen, whole, edge), scene.depths
    _, everything = listed(*given, whole, edge)
    for first, rows in ((0, 7), (7, 1), (8, 29), (37, 13)):
        (*_,), part = listed(*given, Tiles(whole.across, rows, first), edge)
        assert np.array_equal(part, everything[:, first : first + rows])


def test_what_is_no_ellipse_has_its_box(device):
    """Not a number, infinite, flat, far off and huge: nothing is lost, and nothing is outside."""
    odd = [np.nan, np.inf, -np.inf, 0, 1e30, -1e30, 1e-38, 5]
    random = np.random.default_rng(0)
    screen = random.choice(odd, (4000, 8)).astype(np.float32)
    tiles, depths = Tiles(40, 30), np.ones(4000)
    boxes = np.tile(np.int32([[3, 2, 9, 7], [0, 0, 40, 30]]), (2000, 1))
    _, touched = listed(device, screen, boxes, depths, tiles, 16)
    assert not touched[0::2, 7:].any() and not touched[0::2, :, 9:].any()
    unknown = np.isnan(screen[:, :2]).all(axis=1) & (screen[:, 7] > 0)
    assert touched[unknown & (np.arange(4000) % 2 == 1)].all()


def test_pictures_and_gradients_have_the_bits_of_lists_by_boxes(device, monkeypatch):
    random, count = np.random.default_rng(1), 300
    given = {
        "means": random.uniform((-1, -1, 3), (1, 1, 5), (count, 3)),
        "quats": random.normal(size=(count, 4)),
        "scales": np.exp(random.uniform(-7, 0, (count, 3))),
        "opacities": random.uniform(0.01, 1, count),
        "colors": random.uniform(size=(count, 3)),
    }
    splats = Splats.upload(device, **given)
    camera = Camera((90, 120), [[100, 0, 60], [0, 100, 45], [0, 0, 1]], np.eye(4))
    grad = device.array(random.normal(size=(90, 120, 3)).astype(np.float32))

    def drawn():
        renderer = Renderer(SplatSettings(tile=8), device=device)
        frame = renderer.forward(splats, camera)
        entries, image = frame.lists.n_entries, device.get(frame.image)
        return entries, image, device.get(renderer.backward(frame, grad).splats.means)

    fewer, *exact = drawn()
    monkeypatch.setattr(RASTER_PASS, "Ellipses", lambda *_: None)
    more, *boxed = drawn()
    assert fewer < 0.8 * more
    for ours, right in zip(exact, boxed, strict=True):
        assert np.array_equal(ours, right)
