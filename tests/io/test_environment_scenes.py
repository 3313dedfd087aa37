"""Scenes that reflect a light, and the light as a picture: kept to the bit, and found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import splat_files as made
from PIL import Image
from plyfile import PlyData

import rift_cl as rift
from rift_cl.basis.angular.environment import (
    blunted,
    environment_of,
    lattice_sharpness,
    light_from,
    picture_lobes,
    reflected_light,
)
from rift_cl.basis.angular.environment import (
    environment_axes as light_axes,
)
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.errors import FileFormatError, InputError, NonFiniteError, ShapeError
from rift_cl.io.images.display_light import to_linear
from rift_cl.io.images.environment_map import read_environment_map, write_environment_map
from rift_cl.io.images.image import read_image, write_png
from rift_cl.io.images.pixels import write_pixels

LIGHT = ("normals", "reflectance", "environment")


def scene(count=7, lobes=9):
    random, plain = np.random.default_rng(8), made.scene(count, 1)
    return replace(
        plain,
        normals=random.normal(size=(count, 3)),
        reflectance=random.normal(size=(count, 7)),
        environment=random.normal(size=(lobes, 3)),
    )


def test_a_ply_keeps_every_bit_and_others_find_normals_and_the_plain_scene(tmp_path):
    wanted = scene()
    wanted.save(tmp_path / "a.ply")
    found = rift.SplatScene.load(tmp_path / "a.ply")
    made.assert_same(found, wanted)
    for name in LIGHT:
        assert getattr(found, name).tobytes() == getattr(wanted, name).tobytes(), name
    read = PlyData.read(str(tmp_path / "a.ply"))
    names = [entry.name for entry in read["vertex"].properties]
    assert names[: len(made.names(1))] == made.names(1)
    np.testing.assert_array_equal(read["vertex"]["ny"], wanted.normals[:, 1])


def test_what_is_uploaded_comes_back(device):
    wanted = scene()
    splats = wanted.upload(device)
    found = rift.SplatScene.of(splats, device)
    for name in LIGHT:
        assert getattr(found, name).tobytes() == getattr(wanted, name).tobytes(), name


def test_what_lies_about_its_light_is_refused(tmp_path):
    scene().save(tmp_path / "a.ply")
    whole = (tmp_path / "a.ply").read_bytes()
    line = next(row for row in whole.split(b"\n") if row.startswith(b"comment rift-cl light"))
    changes = [
        (b"environment 9", b"environment 8", "8 lobes"),
        (b"environment 9", b"environment 0", "reflectance_0"),
        (b"environment 9", b"environment 99999", "no meaning"),
        (line, b"comment rift-cl light: 1 2", "9 lobes"),
        (line, b"comment rift-cl light: 1 2 red", "9 lobes"),
        (line, b"comment", "9 lobes"),
        (b"comment rift-cl basis", b"comment other basis", "no comment"),
    ]
    for old, new, words in changes:
        (tmp_path / "b.ply").write_bytes(whole.replace(old, new, 1))
        with pytest.raises(FileFormatError, match=words):
            rift.SplatScene.load(tmp_path / "b.ply")
    (tmp_path / "b.ply").write_bytes(whole.replace(line, b"comment rift-cl light: 1 2 nan", 1))
    with pytest.raises(NonFiniteError, match="environment"):
        rift.SplatScene.load(tmp_path / "b.ply")


def test_arrays_that_make_no_reflecting_scene():
    with pytest.raises(ShapeError, match="normals and environment without the rest"):
        replace(scene(), reflectance=None)
    with pytest.raises(ShapeError, match="reflectance"):
        replace(scene(), reflectance=np.zeros((7, 6)))
    with pytest.raises(ShapeError, match="environment"):
        replace(scene(), environment=np.zeros((3, 4)))
    with pytest.raises(ShapeError, match="4097 lobes"):
        replace(scene(), environment=np.zeros((4097, 3)))


def test_a_splat_file_holds_no_light(tmp_path):
    with pytest.raises(InputError, match="environment"):
        scene().save(tmp_path / "a.splat")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("display", [False, True])
def test_a_light_comes_back_from_its_picture(tmp_path, display):
    light = np.random.default_rng(2).normal(-2, 1, (32, 3)).astype(np.float32)
    write_environment_map(tmp_path / "a.exr", light, display=display)
    found = read_environment_map(tmp_path / "a.exr", 32, display=display)
    assert len(found) == len(light)
    directions = np.random.default_rng(3).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    given, again = (light_from(a.astype(float), directions) for a in (light, found))
    assert np.abs(again - given).max() < 0.01 * given.max()


@pytest.mark.full
def test_up_is_at_the_top_x_in_the_middle_and_y_left_of_it(tmp_path):
    picture = np.zeros((32, 64, 3), np.float32)
    picture[:4, :, 0] = 1
    picture[14:18, 30:34, 1] = 1
    picture[14:18, 14:18, 2] = 1
    write_png(tmp_path / "a.png", picture)
    found = read_environment_map(tmp_path / "a.png", 64, display=True)
    light = light_from(found.astype(float), np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]))
    np.testing.assert_array_equal(light.argmax(axis=1), [0, 1, 2])
    write_environment_map(tmp_path / "b.exr", found, display=True)
    again = read_image(tmp_path / "b.exr")
    assert again[2, :, 0].min() > 2 * again[-3:, :, 0].max()
    assert again[64, 128, 1] == again[..., 1].max() or again[64, 128, 1] > again[64, 64, 1]


@pytest.mark.full
def test_what_its_lobes_would_ripple_over_is_a_denser_light(tmp_path):
    write_png(tmp_path / "a.png", np.full((32, 64, 3), 0.5))
    assert len(read_environment_map(tmp_path / "a.png", 32, display=True)) == 128


@pytest.mark.full
def test_a_small_lamp_does_not_fall_between_pixels(tmp_path):
    picture = np.zeros((256, 512, 3), np.float32)
    picture[131, 77] = 1
    write_png(tmp_path / "a.png", picture)
    found = read_environment_map(tmp_path / "a.png", 32, display=False)
    assert np.exp(found).max() > 1e-4


@pytest.mark.full
def test_a_dark_picture_is_a_dark_light_of_finite_numbers(tmp_path):
    write_png(tmp_path / "a.png", np.zeros((8, 16, 3)))
    found = read_environment_map(tmp_path / "a.png", 16, display=True)
    assert np.isfinite(found).all() and np.exp(found).max() < 1e-6


def test_pictures_of_another_shape_are_refused(tmp_path):
    write_png(tmp_path / "a.png", np.zeros((8, 8, 3)))
    with pytest.raises(InputError, match="twice as wide as high"):
        read_environment_map(tmp_path / "a.png", 16, display=True)
    Image.new("LA", (16, 8)).save(tmp_path / "two.png")
    with pytest.raises(InputError, match="has 2 channels"):
        read_environment_map(tmp_path / "two.png", 16, display=True)
    with pytest.raises(InputError):
        read_environment_map(tmp_path / "none.png", 16, display=True)


@pytest.mark.full
def test_negative_light_is_refused_but_for_what_filters_leave(tmp_path):
    for level, refused in ((-1.0, True), (-0.02, True), (-0.001, False)):
        light = np.full((8, 16, 3), level, np.float32)
        light[:4] = 0 if level == -1 else 1
        write_pixels(tmp_path / "a.exr", light, format="openexr", attributes={})
        if refused:
            with pytest.raises(InputError, match="negative light"):
                read_environment_map(tmp_path / "a.exr", 16, display=True)
        else:
            assert np.isfinite(read_environment_map(tmp_path / "a.exr", 16, display=True)).all()


def directions_of(count, seed=4):
    found = np.random.default_rng(seed).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def pixels_of(rows):
    """Directions and solid angles, to a factor, of the pixels of a picture."""
    polar, azimuth = np.pi * (np.arange(rows) + 0.5) / rows, np.arange(2 * rows) + 0.5
    azimuth = np.pi * (1 - azimuth / rows)
    ring = np.sin(polar)[:, None]
    ways = [ring * np.cos(azimuth), ring * np.sin(azimuth), np.cos(polar)[:, None] + 0 * azimuth]
    return np.stack(ways, -1).reshape(-1, 3), np.repeat(np.sin(polar), 2 * rows)


def relit(tmp_path, picture, log_sharpness, lobes=128):
    """What a splat of tint 1 shows under a picture, (D, 3), as the commands light it."""
    write_png(tmp_path / "light.png", picture)
    given = scene(1, lobes)
    reflectance = np.array([[50.0] * 3 + [-50.0] * 3 + [log_sharpness]])
    given = replace(given, normals=[[0, 0, 1]], reflectance=reflectance)
    given.save(tmp_path / "a.ply")
    how = SceneInput(tmp_path / "a.ply", environment=tmp_path / "light.png")
    lit = OpenedScene(how).splats
    return reflected_light(lit.normals, lit.reflectance, lit.environment, directions_of(4000))[0]


@pytest.mark.full
@pytest.mark.parametrize("log_sharpness", [3.4, 9.0])
def test_a_constant_picture_is_constant_light(tmp_path, log_sharpness):
    shown = relit(tmp_path, np.full((32, 64, 3), 0.6), log_sharpness)
    np.testing.assert_allclose(shown, 0.6, rtol=0.02)


@pytest.mark.full
def test_a_soft_sky_beside_a_sharp_sun_is_soft(tmp_path):
    """Ripples of the lattice were 10 % of the sky, and the sun lost or won up to half its light."""
    picture = np.broadcast_to(np.linspace(0.5, 0.3, 64)[:, None, None], (64, 128, 3)).copy()
    picture[14:17, 40:46] = 1
    shown = relit(tmp_path, picture, 9.0)[:, 0]
    mirrored = directions_of(4000) * [1, 1, -1]
    ways, weights = pixels_of(64)
    kernel = np.exp(lattice_sharpness(128) * (mirrored @ ways.T - 1)) * weights
    blurred = kernel @ picture[..., 0].ravel() / kernel.sum(1)
    sun = ways[15 * 128 + 43]
    sky = mirrored @ sun < 0.7
    assert np.sqrt(np.square(shown[sky] / blurred[sky] - 1).mean()) < 0.02
    mean = weights @ picture[..., 0].ravel() / weights.sum()
    assert shown.mean() == pytest.approx(mean, rel=0.02)


@pytest.mark.full
def test_small_lamps_keep_their_light():
    """By least squares, a lamp far smaller than a lobe had up to twice of it."""
    ways, count = directions_of(3000, 7), 256
    for place in range(0, 3000, 500):
        lamp = np.zeros((3000, 3))
        lamp[place] = 100
        found = environment_of(lamp, ways, np.ones(3000), count, 64)
        seen = np.exp(lattice_sharpness(64) * (ways @ light_axes(count).T - 1))
        shown = seen @ np.exp(found) * lattice_sharpness(64) / lattice_sharpness(count)
        np.testing.assert_allclose(shown.mean(0), lamp.mean(0), rtol=1e-3)


@pytest.mark.full
@pytest.mark.parametrize("display", [True, False])
@pytest.mark.parametrize("rows", [64, 150])
@pytest.mark.parametrize("place", [[0.6, 0.3, 0.74], [0.0, 0.0, 1.0]])
def test_a_lamp_keeps_its_power_whatever_light_the_fit_is_in(tmp_path, display, rows, place):
    """The curve of display light came before the blur: a lamp lost half of its power and more."""
    ways, weights = pixels_of(rows)
    picture = np.full((len(ways), 3), 0.1, np.float32)
    lamp = (ways @ place).argmax()
    picture[lamp] += 0.6 * weights.sum() / weights[lamp]
    write_pixels(tmp_path / "a.exr", picture.reshape(rows, -1, 3), format="openexr", attributes={})
    found = read_environment_map(tmp_path / "a.exr", 32, display=display)
    ways, weights = pixels_of(64)
    shown = light_from(found.astype(float), ways, 32).astype(np.float32)
    if display:
        to_linear(shown)
    np.testing.assert_allclose(weights @ shown / weights.sum(), 0.7, rtol=0.02)


def test_denser_lights_are_seen_as_blurred_as_those_of_fits():
    reflectance = np.random.default_rng(9).normal(size=(20, 7))
    reflectance[0, 6] = 30
    for count in (16, 1024, 2048, 4096):
        dense = picture_lobes(count)
        other = blunted(reflectance, count, dense)
        np.testing.assert_array_equal(other[:, :6], reflectance[:, :6])
        kappa = np.minimum(np.exp(reflectance[:, 6]), 1e4)
        wanted = 1 / kappa + 1 / lattice_sharpness(count)
        np.testing.assert_allclose(np.exp(-other[:, 6]) + 1 / lattice_sharpness(dense), wanted)
    assert picture_lobes(4096) == 4096
