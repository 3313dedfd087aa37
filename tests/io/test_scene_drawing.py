"""What a file says of how its splats were fitted: read back, carried on, or refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import splat_files as made

import rift_cl as rift
from rift_cl.commands.export.plain_scene import plain_scene
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.scenes.formats.formats import FORMATS
from rift_cl.io.scenes.scene_drawing import SceneDrawing
from rift_cl.io.scenes.splat_scene import XrayScene

SAID = [
    (SceneDrawing(light="linear"), b"light linear"),
    (SceneDrawing(antialiased=True, eps2d=0.1), b"antialiased, eps2d 0.1"),
    (SceneDrawing("linear", True, 1 / 3), b"light linear, antialiased, eps2d 0.3333333333333333"),
]


def scene(drawing: SceneDrawing) -> rift.SplatScene:
    return replace(made.scene(), **vars(drawing))


def drawing_of(path: Path) -> SceneDrawing:
    return SceneDrawing.of(rift.SplatScene.load(path))


@pytest.mark.parametrize(("drawing", "words"), SAID)
def test_a_ply_says_how_its_splats_are_drawn(tmp_path, drawing, words) -> None:
    scene(drawing).save(tmp_path / "a.ply")
    content = (tmp_path / "a.ply").read_bytes()
    assert b"\ncomment rift-cl drawing: " + words + b"\n" in content
    assert drawing_of(tmp_path / "a.ply") == drawing
    made.scene().save(tmp_path / "b.ply")
    without = content.replace(b"comment rift-cl drawing: " + words + b"\n", b"")
    assert without == (tmp_path / "b.ply").read_bytes()
    (tmp_path / "c.ply").write_bytes(without)
    assert drawing_of(tmp_path / "c.ply") == SceneDrawing()


@pytest.mark.parametrize(("drawing", "words"), SAID)
def test_splats_that_cannot_be_drawn_are_left_out_and_the_rest_stays(
    tmp_path, drawing, words
) -> None:
    scene(drawing).save(tmp_path / "a.ply")
    raw = bytearray((tmp_path / "a.ply").read_bytes())
    raw[-4:] = np.array([np.nan], "<f4").tobytes()
    (tmp_path / "a.ply").write_bytes(raw)
    with pytest.warns(UserWarning, match="1 of 7"):
        found = rift.SplatScene.load(tmp_path / "a.ply")
    assert len(found) == 6 and SceneDrawing.of(found) == drawing


@pytest.mark.parametrize(("drawing", "words"), SAID)
def test_a_moved_file_is_opened_as_it_was_fitted(tmp_path, drawing, words) -> None:
    scene(drawing).save(tmp_path / "moved.ply")
    opened = OpenedScene(SceneInput(tmp_path / "moved.ply"))
    assert opened.light == opened.splats.light == drawing.light
    assert opened.rendering.antialiased == drawing.antialiased
    assert opened.rendering.eps2d == (0.3 if drawing.eps2d is None else drawing.eps2d)
    other = OpenedScene(SceneInput(tmp_path / "moved.ply", eps2d=0.2))
    assert other.rendering.eps2d == 0.2
    assert other.splats.eps2d == (0.2 if drawing.antialiased else None)


@pytest.mark.parametrize("light", ["display", "linear"])
def test_the_folder_of_an_older_fit_says_what_its_file_does_not(tmp_path, light) -> None:
    made.scene().save(tmp_path / "scene.ply")
    rendering = {"eps2d": 0.05, "antialiased": light == "linear"}
    settings = {"light": light, "rendering": rendering}
    (tmp_path / "config.json").write_text(json.dumps({"settings": settings}))
    opened = OpenedScene(SceneInput(tmp_path))
    eps2d = 0.05 if light == "linear" else None
    assert SceneDrawing.of(opened.splats) == SceneDrawing(light, light == "linear", eps2d)
    assert opened.rendering.eps2d == 0.05
    assert SceneDrawing.of(OpenedScene(SceneInput(tmp_path / "scene.ply")).splats).usual


def test_what_a_device_held_is_told_how_it_is_drawn(device) -> None:
    drawing = SceneDrawing("linear", True, 0.1)
    found = rift.SplatScene.of(made.scene().upload(device), device, drawing=drawing)
    assert SceneDrawing.of(found) == drawing
    assert SceneDrawing.of(rift.SplatScene.of(made.scene().upload(device), device)).usual


def test_plain_splats_of_linear_light_are_in_display_light(tmp_path) -> None:
    given = scene(SceneDrawing("linear", True, 0.1))
    plain, notes = plain_scene(given)
    assert any("linear light becomes display light" in note for note in notes)
    assert SceneDrawing.of(plain) == SceneDrawing("display", True, 0.1)
    (tmp_path / "a.ply").write_bytes(FORMATS["ply"].encode(plain))
    assert drawing_of(tmp_path / "a.ply") == SceneDrawing("display", True, 0.1)


@pytest.mark.parametrize("name", list(FORMATS))
def test_no_format_of_others_takes_linear_light_for_display_light(name) -> None:
    with pytest.raises(InputError, match="light linear"):
        FORMATS[name].encode(scene(SceneDrawing("linear")))


@pytest.mark.parametrize(("drawing", "words"), SAID)
def test_a_splat_file_cannot_say_it(tmp_path, drawing, words) -> None:
    with pytest.raises(InputError, match=f"cannot say '{words.decode()}"):
        scene(drawing).save(tmp_path / "a.splat")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("light blue", "no meaning"),
        ("light linear, light display", "no meaning"),
        ("antialiased, antialiased", "no meaning"),
        ("eps2d -1", "no meaning"),
        ("eps2d 1e999", "no meaning"),
        ("eps2d 1-1", "no meaning"),
        ("", "no meaning"),
        ("fog", "no meaning"),
        ("antialiased\ncomment rift-cl drawing: antialiased", "has 2 comments"),
    ],
)
def test_comments_without_a_meaning_are_refused(tmp_path, said, words) -> None:
    scene(SceneDrawing(antialiased=True)).save(tmp_path / "a.ply")
    content = (tmp_path / "a.ply").read_bytes()
    other = content.replace(b"drawing: antialiased", f"drawing: {said}".encode())
    (tmp_path / "a.ply").write_bytes(other)
    with pytest.raises(FileFormatError, match=words):
        rift.SplatScene.load(tmp_path / "a.ply")


def test_x_rays_know_their_blur_alone(tmp_path) -> None:
    arrays = {name: getattr(made.scene(7, 0), name) for name in made.ARRAYS}
    with pytest.raises(InputError, match="antialiased"):
        XrayScene(**arrays, antialiased=True)
    XrayScene(**arrays, eps2d=0.0).save(tmp_path / "a.ply")
    assert rift.SplatScene.load(tmp_path / "a.ply").eps2d == 0
    opened = SceneInput(scene=tmp_path / "a.ply").open_scene(densities=True)
    assert opened.rendering.eps2d == 0
    XrayScene(**arrays).save(tmp_path / "a.ply")
    content = (tmp_path / "a.ply").read_bytes()
    line = b"comment rift-cl drawing: light linear\nelement vertex"
    (tmp_path / "a.ply").write_bytes(content.replace(b"element vertex", line))
    with pytest.raises(FileFormatError, match="X-rays"):
        rift.SplatScene.load(tmp_path / "a.ply")


@pytest.mark.parametrize(
    "changes", [{"light": "blue"}, {"eps2d": -1}, {"eps2d": np.nan}, {"eps2d": "wide"}]
)
def test_values_that_there_are_not(changes) -> None:
    with pytest.raises(InputError, match=next(iter(changes))):
        replace(made.scene(), **changes)
