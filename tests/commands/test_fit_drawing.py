"""``rift fit``: a scene.ply away from its folder is what it was in it."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.io.scenes.scene_drawing import SceneDrawing
from rift_cl.io.scenes.splat_scene import SplatScene

FIT = ["--steps", "20", "--splats", "60", "--hold-out", "4", "--quiet"]


@pytest.mark.full
def test_a_moved_scene_is_exported_as_from_its_folder(capture, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    how = ["--light", "linear", "--rendering.antialiased"]
    assert main(["fit", str(capture), "--out", "fit", *FIT, *how]) == 0
    (tmp_path / "fit" / "scene.ply").rename(tmp_path / "moved.ply")
    moved = SplatScene.load("moved.ply")
    assert SceneDrawing.of(moved) == SceneDrawing("linear", True, 0.1)
    opened = OpenedScene(SceneInput(tmp_path / "moved.ply"))
    assert opened.light == "linear" and opened.rendering.antialiased
    (tmp_path / "fit" / "scene.ply").write_bytes((tmp_path / "moved.ply").read_bytes())
    for name in ("moved.ply", "fit"):
        out = f"{name}.plain.ply"
        assert main(["export", name, "--to", "ply", "--out", out, "--quiet"]) == 0
    one, other = (SplatScene.load(f"{name}.plain.ply") for name in ("moved.ply", "fit"))
    np.testing.assert_array_equal(one.sh, other.sh)


def test_a_usual_fit_says_nothing(capture, tmp_path):
    assert main(["fit", str(capture), "--out", str(tmp_path / "fit"), *FIT]) == 0
    assert b"comment" not in (tmp_path / "fit" / "scene.ply").read_bytes().split(b"end_header")[0]
