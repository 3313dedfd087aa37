"""Compositing of splats with Hermite modes: against its twin, the Gaussian kernel, and laws."""

import dataclasses
import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from hermite_scenes import draw, draw_twin, hermite_scene, whitening
from scenes import random_scene

from rift_cl.errors import InputError, ShapeError
from rift_cl.reference.hermite_raster import EDGES, hermite_modes
from rift_cl.splat.raster import ScreenModes, rasterize
from rift_cl.splat.settings import SplatSettings

SIZE = (50, 70)
# Two alphas of 0.99 leave just what ends a pixel, 1e-4, and rounding decides: caps are others here.
KINDS = {
    "clamp": SplatSettings(alpha_cap=0.98),
    "exp": SplatSettings(alpha_cap=0.98, activation="exp"),
    "square": SplatSettings(alpha_cap=0.98, activation="square"),
    "xray": SplatSettings(mode="xray"),
    "smooth": SplatSettings(smooth_cutoff=True, activation="exp"),
    "small tiles": SplatSettings(alpha_cap=0.98, tile=8),
    "large tiles": SplatSettings(alpha_cap=0.98, tile=32),
    "low cap": SplatSettings(alpha_cap=0.5, activation="square"),
    "no cap counts": SplatSettings(alpha_cap=0.003),
}
ORDERS = [
    ("clamp", (1, 0)),
    ("clamp", (0, 1)),
    ("clamp", (3, 4)),
    ("xray", (1, 0)),
    ("xray", (3, 4)),
]
# What most tests draw, so that few kernels are built.
USUAL = (2, 1)


def assert_like_the_twin(device, given, settings, channels):
    background = np.linspace(0.1, 0.9, channels).astype(np.float32)
    _, _, result = draw(device, given, settings, background)
    image, transmittance = draw_twin(given, settings, background)
    np.testing.assert_allclose(device.get(result.image), image, atol=5e-6 * np.abs(image).max())
    np.testing.assert_allclose(device.get(result.transmittance), transmittance, atol=3e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_every_way_to_draw_equals_its_twin(device, kind):
    settings = KINDS[kind]
    given = hermite_scene(100, SIZE, USUAL, channels=4, tile=settings.tile or 16)
    assert_like_the_twin(device, given, settings, 4)


@pytest.mark.parametrize(("kind", "orders"), ORDERS)
def test_every_order_equals_its_twin(device, kind, orders):
    assert_like_the_twin(device, hermite_scene(60, SIZE, orders), KINDS[kind], 3)


@pytest.mark.parametrize("kind", ["square", "xray"])
def test_the_highest_order_equals_its_twin(device, kind):
    given = hermite_scene(15, SIZE, (8, 8), colored=1, strength=0.1, farthest=9)
    assert_like_the_twin(device, given, KINDS[kind], 3)


@pytest.mark.full
@pytest.mark.parametrize("channels", [1, 32])
def test_any_number_of_channels_equals_its_twin(device, channels):
    given = hermite_scene(40, SIZE, (1, 1), channels=channels, colored=channels)
    assert_like_the_twin(device, given, KINDS["clamp"], channels)


@pytest.mark.parametrize("kind", ["clamp", "xray"])
def test_order_zero_is_the_gaussian(device, kind):
    scene, settings = random_scene(200, SIZE), KINDS[kind]
    splats, lists = scene.upload(device)
    plain = rasterize(device, splats, lists, SIZE, settings=settings)
    table = device.array(whitening(scene.screen).astype(np.float32))
    modal = dataclasses.replace(splats, modes=ScreenModes(table, 0))
    found = rasterize(device, modal, lists, SIZE, settings=settings)
    scale = np.abs(device.get(plain.image)).max()
    np.testing.assert_allclose(
        device.get(found.image), device.get(plain.image), atol=2e-6 * scale, rtol=0
    )
    np.testing.assert_allclose(
        device.get(found.transmittance), device.get(plain.transmittance), atol=2e-6
    )


@pytest.mark.parametrize("kind", ["clamp", "exp", "square"])
def test_modes_of_no_size_change_nothing(device, kind):
    given = hermite_scene(60, SIZE, USUAL, strength=0, channels=4)
    plain = hermite_scene(60, SIZE, (0, 0), strength=0, channels=4)
    found, expected = (draw(device, scene, KINDS[kind])[2] for scene in (given, plain))
    # The exponential of plain splats is right to 2.6e-6.
    np.testing.assert_allclose(device.get(found.image), device.get(expected.image), atol=4e-6)


def test_an_integral_is_linear_in_its_modes(device):
    given = hermite_scene(60, SIZE, USUAL, channels=4)
    table, shape, random = given.table, slice(3, 8), np.random.default_rng(7)
    more, none, both = table.copy(), table.copy(), table.copy()
    more[:, shape], none[:, shape] = random.normal(size=(60, 5)), 0
    both[:, shape] += more[:, shape]
    drawn = []
    for modes in (table, more, none, both):
        scene = dataclasses.replace(given, table=modes)
        drawn.append(device.get(draw(device, scene, KINDS["xray"])[2].image).astype(float))
    scale = max(np.abs(image).max() for image in drawn)
    np.testing.assert_allclose(drawn[0] + drawn[1] - drawn[2], drawn[3], atol=1e-5 * scale)


def test_the_order_of_splats_changes_no_integral(device):
    given = hermite_scene(80, SIZE, USUAL, channels=4)
    entries, starts = given.scene.entries.copy(), given.scene.starts
    for first, last in itertools.pairwise(starts):
        entries[first:last] = entries[first:last][::-1]
    turned = dataclasses.replace(given, scene=dataclasses.replace(given.scene, entries=entries))
    images = [device.get(draw(device, scene, KINDS["xray"])[2].image) for scene in (given, turned)]
    assert not np.array_equal(*images)
    np.testing.assert_allclose(*images, atol=1e-5 * np.abs(images[0]).max())


def test_integrals_end_where_their_order_falls_below_the_gaussians_end():
    """The kernels' table and the twin's are one, and say what they are said to."""
    header = Path(__file__).parents[2] / "kernels" / "include" / "raster" / "hermite_edge.h"
    listed = re.findall(r"(\d\.\d+)f", header.read_text().split("#define")[1])
    assert tuple(map(float, listed)) == EDGES
    for order, edge in enumerate(EDGES):
        x = np.linspace(edge - 0.01, edge + 5, 5011)
        mode = np.abs(hermite_modes(x, 0 * x, order)[order * (order + 1) // 2])
        beyond = mode * np.exp(-(x**2) / 2) > np.exp(-8)
        assert beyond[:8].all() and not beyond[12:].any()


@pytest.mark.parametrize("kind", ["clamp", "exp", "square", "xray"])
def test_two_runs_give_the_same_bits(device, kind):
    given = hermite_scene(150, SIZE, USUAL, channels=4)
    runs = [draw(device, given, KINDS[kind])[2] for _ in range(3)]
    images = [device.get(run.image) for run in runs]
    assert all(np.array_equal(images[0], image) for image in images)


@pytest.mark.parametrize("tile", [8, 32])
def test_tile_size_changes_nothing(device, tile):
    here, there = (
        draw(
            device,
            hermite_scene(60, SIZE, USUAL, channels=4, tile=edge),
            SplatSettings(tile=edge),
        )[2]
        for edge in (tile, 16)
    )
    np.testing.assert_allclose(device.get(here.image), device.get(there.image), atol=2e-6)


def test_channels_without_a_polynomial_keep_their_color(device):
    tinted = hermite_scene(60, SIZE, USUAL, channels=4)
    plain = tinted.table.copy()
    plain[:, 8:] = 0
    scenes = tinted, dataclasses.replace(tinted, table=plain)
    found, expected = (device.get(draw(device, scene, KINDS["clamp"])[2].image) for scene in scenes)
    np.testing.assert_array_equal(found[..., 3], expected[..., 3])
    assert (np.abs(found - expected)[..., :3].max(axis=(0, 1)) > 0.1).all()


def test_where_density_is_negative_nothing_is_hidden(device):
    given = hermite_scene(1, (32, 32), (1, 0), scale=8.0)
    given.scene.screen[0, :6] = [16, 16, 0.01, 0, 0.01, 0.9]
    given.table[0] = [0.1, 0, 0.1, 50.0, 0]
    left = device.get(draw(device, given, KINDS["clamp"])[2].transmittance)
    assert (left[:, :15] == 1).all() and (left[8:24, 18:] < 0.02).all()


def test_nothing_to_draw_shows_the_background(device):
    background = np.float32([0.2, 0.4, 0.6])
    result = draw(device, hermite_scene(0, SIZE, (1, 0)), KINDS["clamp"], background)[2]
    image = device.get(result.image)
    np.testing.assert_array_equal(image, np.broadcast_to(background, image.shape))


@pytest.mark.parametrize("kind", ["clamp", "exp", "square"])
def test_a_shape_that_is_no_number_hides_nothing(device, kind):
    given = hermite_scene(40, SIZE, USUAL, channels=4)
    broken, without = given.table.copy(), given.scene.screen.copy()
    broken[7, 4], without[7, 5] = np.nan, 0
    scenes = [
        dataclasses.replace(given, table=broken),
        dataclasses.replace(given, scene=dataclasses.replace(given.scene, screen=without)),
    ]
    found, expected = (device.get(draw(device, scene, KINDS[kind])[2].image) for scene in scenes)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("kind", ["square", "xray"])
def test_a_needle_without_width_leaves_the_image_finite(device, kind):
    given = hermite_scene(40, SIZE, (8, 8), colored=1, strength=0.01)
    given.table[5, :3] = [1e18, -1e18, 1e18]
    given.table[6, :3] = [1e-18, 0, 1e18]
    result = draw(device, given, KINDS[kind])[2]
    assert np.isfinite(device.get(result.image)).all()
    assert np.isfinite(device.get(result.transmittance)).all()


def test_what_does_not_fit_is_told(device):
    given = hermite_scene(5, SIZE, (1, 1))
    splats, lists = given.upload(device)
    table = splats.modes.table

    def drawn(features, modes):
        return rasterize(
            device,
            dataclasses.replace(splats, features=features, modes=modes),
            *(lists, SIZE),
            settings=SplatSettings(),
        )

    with pytest.raises(InputError, match="shape_order is 9"):
        ScreenModes(table, 9)
    with pytest.raises(InputError, match="color_order is -1"):
        ScreenModes(table, 1, -1, 3)
    with pytest.raises(InputError, match=r"channels is 1\.5"):
        ScreenModes(table, 1, 1, 1.5)
    with pytest.raises(ShapeError, match=r"table has shape \(5, 11\)"):
        ScreenModes(table, 2, 1, 3)
    with pytest.raises(InputError, match="features have 33 channels"):
        drawn(device.zeros((5, 33)), splats.modes)
    with pytest.raises(ShapeError, match="2 features"):
        drawn(device.zeros((5, 2)), splats.modes)
    with pytest.raises(ShapeError, match="table has 4 rows"):
        drawn(splats.features, ScreenModes(table[:4], 1, 1, 3))
