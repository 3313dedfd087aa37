"""What blocks of pixels must not lose: needles, borders, single pixels, tiles without splats."""

import numpy as np
import pytest
from scenes import lists_of, numbers_of, random_scene
from test_raster import draw, gradient, twin

from rift_cl.splat.raster import raster_grad
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.tile_lists import Tiles

ASPECT = 1200


def needles(size, count, tile, dilation, seed):
    """Splats 1200 times as long as wide at every angle, with extents where they reach 1/255."""
    scene, random = random_scene(count, size, tile=tile, seed=seed), np.random.default_rng(seed)
    length = np.exp(random.uniform(np.log(5), np.log(200), count))
    turn, width = random.uniform(0, np.pi, count), length / ASPECT
    c, s = np.cos(turn), np.sin(turn)
    xx = (c * length) ** 2 + (s * width) ** 2 + dilation
    yy = (s * length) ** 2 + (c * width) ** 2 + dilation
    xy = c * s * (length**2 - width**2)
    screen = scene.screen.copy()
    determinant = (length * width) ** 2 + dilation * (length**2 + width**2) + dilation**2
    screen[:, 2:5] = np.stack([yy, -xy, xx], axis=1) / determinant[:, None]
    screen[:, 5] = random.uniform(0.01, 0.3, count)
    reach = np.sqrt(2 * np.log(255 * screen[:, 5]))
    screen[:, 6:] = reach[:, None] * np.sqrt(np.stack([xx, yy], axis=1))
    lists = lists_of(screen, scene.depths, scene.tiles, tile)
    return type(scene)(screen, scene.depths, scene.features, *lists, size)


@pytest.mark.parametrize("dilation", [0.1, 0.3])
def test_needles_lose_no_pixel(device, dilation):
    """A pixel that is lost lacks 1/255; rounding may decide the threshold in a few."""
    settings = SplatSettings(tile=32)
    scene = needles((96, 160), 400, 32, dilation, seed=3)
    _, _, result = draw(device, scene, settings)
    apart = np.abs(device.get(result.transmittance) - twin(scene, settings)[1])
    assert np.isfinite(device.get(result.image)).all()
    assert (apart > 1e-3).sum() <= 3


@pytest.mark.parametrize("size", [(1, 1), (1, 33), (37, 3)])
def test_images_of_any_size_equal_their_twin(device, size):
    scene = random_scene(40, size, weights=(0.05, 0.4))
    _, _, result = draw(device, scene, SplatSettings())
    image, transmittance = twin(scene, SplatSettings())
    np.testing.assert_allclose(device.get(result.image), image, atol=1e-5)
    np.testing.assert_allclose(device.get(result.transmittance), transmittance, atol=1e-5)
    sums = gradient(device, scene, SplatSettings(), np.ones((*size, 3), np.float32), np.ones(size))
    np.testing.assert_allclose(sums[:, 6:].sum(), 3 * (1 - transmittance).sum(), rtol=1e-4)


def test_what_is_hidden_leaves_nothing(device):
    """Behind opaque splats no slot is live, and beside a splat's ellipse neither."""
    if not device.traits.is_cpu:
        pytest.skip("tells of the CPU's blocks")
    scene = random_scene(300, (64, 64), scale=30.0, weights=(0.9, 0.99))
    splats, lists, result = draw(device, scene, SplatSettings())
    grad = device.array(np.ones((64, 64, 3), np.float32))
    records = raster_grad(device, splats, lists, result, grad, settings=SplatSettings())
    live = device.get(records.live).astype(bool)
    assert 0 < live.mean() < 0.5
    depth = np.repeat(scene.depths, np.diff(scene.slots))
    assert depth[live].mean() < depth[~live].mean()
    assert np.isfinite(numbers_of(device, records)).all()


def test_splats_that_are_no_numbers_are_not_drawn(device):
    if not device.traits.is_cpu:
        pytest.skip("tells of the CPU's blocks")
    scene = random_scene(60, (40, 48))
    screen = scene.screen.copy()
    screen[::5, 2:5] = np.nan
    screen[1::5, 3] = np.inf
    odd = type(scene)(screen, *list(vars(scene).values())[1:])
    kept = np.arange(60) % 5 > 1
    dim = scene.screen.copy()
    dim[~kept, 5] = 1e-9
    faint = type(scene)(dim, *list(vars(scene).values())[1:])
    found, expected = (
        device.get(draw(device, each, SplatSettings())[2].image) for each in (odd, faint)
    )
    np.testing.assert_array_equal(found, expected)


def test_tiles_are_chosen_by_the_image():
    large, small = (1080, 1920), (120, 160)
    assert SplatSettings().for_image(large, cpu=True).edge == 32
    assert SplatSettings().for_image(small, cpu=True).edge == 16
    assert SplatSettings().for_image(large, cpu=False).edge == 16
    assert SplatSettings(tile=8).for_image(large, cpu=True).edge == 8
    assert Tiles.of(large, 32).count >= 64
