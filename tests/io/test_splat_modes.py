"""Scenes with Hermite modes and lobes in files: every bit is kept, and what lies is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import splat_files as made
from plyfile import PlyData

import rift_cl as rift
from rift_cl.errors import (
    FileFormatError,
    InputError,
    NonFiniteError,
    ResourceLimitError,
    RiftError,
    ShapeError,
)
from rift_cl.io.scenes.splat_scene import XrayScene
from rift_cl.splat.orders import count_of
from rift_cl.splat.splats import Splats

MORE = ("shape_modes", "color_modes", "lobes")
# (order of shapes, of colours, activation, kind of lobes, coefficients, numbers of geometry)
KINDS = [
    (1, 0, "clamp", "sh", 4, 0),
    (0, 2, "clamp", "sh", 16, 0),
    (2, 1, "exp", "sh", 1, 0),
    (8, 8, "square", "sh", 9, 0),
    (0, 0, "exp", "sh", 4, 0),
    (0, 0, "clamp", "hg", 7, 6),
    (0, 0, "clamp", "lg", 9, 5),
    (0, 1, "exp", "sg", 4, 12),
    (1, 0, "clamp", "asg", 3, 12),
]


def scene(kind: tuple[int, int, str, str, int, int], count: int = 7) -> rift.SplatScene:
    shape, color, activation, angular, linear, geometry = kind
    random = np.random.default_rng(3)
    plain = {name: getattr(made.scene(count, 0), name) for name in made.ARRAYS}
    modes = {
        "shape_modes": random.normal(size=(count, count_of(shape) - 1)) if shape else None,
        "color_modes": random.normal(size=(count, count_of(color) - 1, 3)) if color else None,
        "lobes": random.normal(size=(count, geometry)) if geometry else None,
    }
    sh = random.normal(size=(count, linear, 3))
    return rift.SplatScene(**(plain | modes | {"sh": sh}), activation=activation, angular=angular)


def assert_same(found: rift.SplatScene, wanted: rift.SplatScene) -> None:
    made.assert_same(found, wanted)
    assert (found.activation, found.angular) == (wanted.activation, wanted.angular)
    for name in MORE:
        a, b = getattr(found, name), getattr(wanted, name)
        assert (a is None) == (b is None), name
        assert a is None or (a.tobytes() == b.tobytes() and a.shape == b.shape), name


@pytest.mark.parametrize("kind", KINDS)
def test_a_ply_keeps_every_bit_of_modes_and_lobes(tmp_path: Path, kind) -> None:
    wanted = scene(kind)
    wanted.save(tmp_path / "a.ply")
    assert_same(rift.SplatScene.load(tmp_path / "a.ply"), wanted)


@pytest.mark.parametrize("kind", KINDS)
def test_another_program_finds_the_plain_scene(tmp_path: Path, kind) -> None:
    """Whatever it knows by name is there, and its constants are the splats' own."""
    wanted = scene(kind)
    wanted.save(tmp_path / "a.ply")
    read = PlyData.read(str(tmp_path / "a.ply"))
    vertex = read["vertex"]
    names = [entry.name for entry in vertex.properties]
    degree = wanted.degree
    assert names[: len(made.names(degree))] == made.names(degree)
    np.testing.assert_array_equal(vertex["f_dc_1"], wanted.sh[:, 0, 1])
    np.testing.assert_array_equal(vertex["opacity"], wanted.logit_opacities)
    assert sum(name.startswith("f_rest_") for name in names) == 3 * ((degree + 1) ** 2 - 1)
    assert len(read.comments) == 1 and read.comments[0].startswith("rift-cl basis: ")
    if wanted.color_modes is not None:
        modes = wanted.color_modes.shape[1]
        np.testing.assert_array_equal(vertex[f"tint_{modes}"], wanted.color_modes[:, 0, 1])


def test_plain_scenes_say_nothing_of_it(tmp_path: Path) -> None:
    made.scene().save(tmp_path / "a.ply")
    assert b"comment" not in (tmp_path / "a.ply").read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_splat_files_refuse_what_they_cannot_hold_by_name(tmp_path: Path, kind) -> None:
    with pytest.raises(InputError, match=r"\.splat file.*order|activation|angular"):
        scene(kind).save(tmp_path / "a.splat")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_uploaded_comes_back(device, kind) -> None:
    wanted = scene(kind, 20)
    splats = wanted.upload(device)
    assert isinstance(splats, Splats)
    for name in MORE:
        array, ours = getattr(splats, name), getattr(wanted, name)
        assert (array is None) == (ours is None)
        assert array is None or np.array_equal(device.get(array), ours)
    found = rift.SplatScene.of(splats, device, activation=wanted.activation, angular=wanted.angular)
    np.testing.assert_array_equal(found.sh, wanted.sh)
    peaks = 1 / (1 + np.exp(-wanted.logit_opacities.astype(float)))
    if wanted.activation != "clamp":
        drawn = device.get(splats.opacities).astype(float)
        np.testing.assert_allclose(1 - np.exp(-drawn), peaks, rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(found.logit_opacities, wanted.logit_opacities, atol=1e-5)


def test_x_ray_splats_have_shapes_alone(tmp_path: Path) -> None:
    plain = scene((2, 0, "clamp", "sh", 1, 0))
    given = {name: getattr(plain, name) for name in (*made.ARRAYS, "shape_modes")}
    wanted = XrayScene(**given)
    wanted.save(tmp_path / "a.ply")
    found = rift.SplatScene.load(tmp_path / "a.ply")
    assert found.mode == "xray"
    assert_same(found, wanted)
    for more in ({"color_modes": np.zeros((7, 3, 3))}, {"activation": "exp"}):
        with pytest.raises(InputError, match=r"X-rays.*colours"):
            XrayScene(**given, **more)


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"shape_modes": np.zeros((7, 4))}, ShapeError, "shape_modes: 5 modes"),
        ({"shape_modes": np.zeros((6, 3))}, ShapeError, "shape_modes has shape .* wants"),
        ({"shape_modes": np.zeros(7)}, ShapeError, r"shape_modes has shape \(7,\)"),
        ({"color_modes": np.zeros((7, 3))}, ShapeError, "color_modes has shape"),
        ({"color_modes": np.zeros((7, 3, 4))}, ShapeError, r"wants \(7, 3, 3\)"),
        ({"shape_modes": np.full((7, 3), np.nan)}, NonFiniteError, "shape_modes holds NaN"),
        ({"activation": "gate"}, InputError, "activation is 'gate'"),
        ({"angular": "fourier"}, InputError, "angular is 'fourier'"),
        ({"angular": "lg"}, ShapeError, "angular is 'lg' without lobes"),
        ({"lobes": np.zeros((7, 5))}, ShapeError, "angular is 'sh' with lobes"),
        ({"angular": "lg", "lobes": np.zeros((7, 6))}, ShapeError, r"lobes .* wants \(7, 5\)"),
        ({"angular": "lg", "lobes": np.zeros((7, 5)), "sh": np.zeros((7, 37, 3))}, InputError,
         "37"),
    ],
)  # fmt: skip
def test_arrays_that_make_no_scene(changes, kind, words) -> None:
    plain = {name: getattr(made.scene(7, 1), name) for name in made.ARRAYS}
    with pytest.raises(kind, match=words):
        rift.SplatScene(**(plain | changes))


def edited(path: Path, old: str, new: str) -> Path:
    content = path.read_bytes()
    assert content.count(old.encode()) >= 1
    path.write_bytes(content.replace(old.encode(), new.encode(), 1))
    return path


def saved(folder: Path, kind=KINDS[8]) -> Path:
    """Order 1, asg: shape_0 to 2, lobe_0 to 11, angular_0 to 5."""
    path = folder / "a.ply"
    scene(kind).save(path)
    return path


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("shape order 1", "shape order 2", r"has 3 properties shape_0\.\."),
        ("shape order 1", "shape order 9", "has no meaning"),
        ("shape order 1", "shape order 99999999999", "has no meaning"),
        ("shape order 1, ", "", r"has 3 properties shape_0"),
        ("angular asg", "angular lg", r"has 12 properties lobe_0\.\."),
        ("angular asg", "angular xx", "angular basis is .xx."),
        ("angular asg", "angular asg, angular asg", "has no meaning"),
        ("rift-cl basis", "rift_cl basis", "no comment 'rift-cl basis:' that says"),
        ("rift-cl basis:", "rift-cl basis: exp\ncomment rift-cl basis:", "has 2 comments"),
        ("property float shape_2", "property float shapes2", r"has 2 properties shape_0"),
        ("property float shape_2", "property float shape_7", "lacks shape_2"),
        ("property float lobe_11", "property float lobes11", "has 11 properties lobe_0"),
        ("property float angular_0\n", "property float f_rest_0\n", "which has 6"),
        ("property float f_dc_2", "property float f_dc_3", "lacks f_dc_2"),
        ("vertex 7", "vertex 9", "claims 9 records"),
    ],
)
def test_files_that_contradict_themselves(tmp_path: Path, old, new, words) -> None:
    path = edited(saved(tmp_path), old, new)
    with pytest.raises(FileFormatError, match=words) as caught:
        rift.SplatScene.load(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_numbers_that_are_none_are_named(tmp_path: Path) -> None:
    path = saved(tmp_path)
    content = bytearray(path.read_bytes())
    # The last property of the last splat is one of its lobes' coefficients.
    content[-4:] = np.array([np.nan], "<f4").tobytes()
    path.write_bytes(content)
    with pytest.warns(UserWarning, match=r"1 of 7 .*\(sh\)"):
        assert len(rift.SplatScene.load(path)) == 6


def test_modes_count_before_anything_is_allocated(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    scene((8, 8, "clamp", "sh", 1, 0)).save(path)
    each = 11 + 3 + 4 * (count_of(8) - 1)
    with pytest.raises(ResourceLimitError, match="the scene claims"):
        rift.SplatScene.load(path, budget=7 * 4 * each - 1)
    rift.SplatScene.load(path, budget=7 * 4 * each)


def test_damage_by_chance_is_an_error_or_a_scene(tmp_path: Path) -> None:
    path = saved(tmp_path)
    intact = np.fromfile(path, np.uint8)
    random = np.random.default_rng(11)
    errors = 0
    for _ in range(300):
        content = intact.copy()
        where = random.integers(0, 900, random.integers(1, 4))
        content[where] = random.integers(32, 127, where.size)
        content.tofile(path)
        try:
            found = rift.SplatScene.load(path, budget=1 << 26)
        except RiftError as error:
            assert str(error).startswith(f"{path}: ")
            errors += 1
        else:
            assert len(found) == 7
    assert 40 < errors < 300
