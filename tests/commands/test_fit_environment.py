"""``rift fit photos --environment shared``: drawn, scored, lit anew, exported by the commands."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.basis.angular import SphericalHarmonics
from rift_cl.basis.angular.environment import reflected_light
from rift_cl.commands.cameras.fit_cameras import open_fit_cameras
from rift_cl.commands.cli import main
from rift_cl.commands.export.plain_scene import plain_scene
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.view.browser_splats import browser_can
from rift_cl.errors import InputError
from rift_cl.io.images.image import read_image, write_png

FIT = ["--steps", "20", "--splats", "60", "--hold-out", "4", "--quiet"]
SHARED = ["--environment", "shared", "--environment-lobes", "16"]


@pytest.fixture(scope="module")
def fitted(capture, tmp_path_factory):
    out = tmp_path_factory.mktemp("lit") / "fit"
    assert main(["fit", str(capture), "--out", str(out), *FIT, *SHARED]) == 0
    return out


def test_a_fit_keeps_its_light_and_says_so(fitted):
    scene = rift.SplatScene.load(fitted / "scene.ply")
    assert scene.environment.shape == (16, 3) and scene.sh.shape[1] == 4
    config = json.loads((fitted / "config.json").read_text())["settings"]["training"]
    assert config["environment"] == {"kind": "shared", "lobes": 16, "own_degree": 1}
    assert "shared light" in json.loads((fitted / "metrics.json").read_text())["basis"]
    assert read_image(fitted / "environment.exr").shape == (128, 256, 3)
    assert not browser_can(scene)


def test_eval_scores_what_the_fit_scored(capture, fitted, tmp_path):
    scored = ["eval", str(fitted), str(capture), "--hold-out", "4", "--out", str(tmp_path / "e")]
    assert main([*scored, "--train", str(capture), "--quiet"]) == 0
    (found,) = json.loads((tmp_path / "e" / "metrics.json").read_text())["scores"].values()
    scores = json.loads((fitted / "metrics.json").read_text())["scores"]["held out"]
    assert found["fit_psnr"] == pytest.approx(scores["fit_psnr"], abs=2e-3)


@pytest.mark.full
def test_a_rendering_takes_another_light(fitted, tmp_path):
    frames = []
    write_png(tmp_path / "red.png", np.broadcast_to([1.0, 0, 0], (8, 16, 3)))
    for name, more in {"own": [], "red": ["--environment", str(tmp_path / "red.png")]}.items():
        out = tmp_path / name
        given = ["render", str(fitted), "--out", str(out), "--frames", "1", "--size", "32", "24"]
        assert main([*given, "--quiet", *more]) == 0
        (frame,) = (out / "frames").glob("*.png")
        frames.append(read_image(frame)[..., :3].mean(axis=(0, 1)))
    assert frames[1][0] > frames[0][0] + 0.02 and frames[1][1] <= frames[0][1]


def test_other_viewers_get_harmonics(fitted, tmp_path):
    scene = rift.SplatScene.load(fitted / "scene.ply")
    plain, notes = plain_scene(scene)
    assert plain.environment is None and plain.sh.shape == (len(scene), 16, 3)
    assert any("shared light becomes harmonics" in note for note in notes)
    out = tmp_path / "plain.ply"
    assert main(["export", str(fitted), "--to", "ply", "--out", str(out), "--quiet"]) == 0
    assert rift.SplatScene.load(out).environment is None


def test_harmonics_are_right_where_the_photographs_were_taken(fitted):
    """Seen from a camera of the fit, what is exported is nearer than what all directions give."""
    scene = rift.SplatScene.load(fitted / "scene.ply")
    # Of a gloss that harmonics cannot hold for all directions.
    scene.reflectance[:, 6], scene.environment[::3] = 5, 1
    cameras = [view.camera for view in open_fit_cameras(fitted).training_views]
    ways = scene.means - cameras[0].center
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    basis = SphericalHarmonics(1)
    light = (scene.normals, scene.reflectance, scene.environment, ways[:, None])
    right = basis.evaluate(scene.sh, None, ways) + 0.5 + reflected_light(*light)[:, 0]
    errors = []
    for given in ((), cameras):
        plain, _ = plain_scene(scene, given)
        found = SphericalHarmonics(3).evaluate(plain.sh, None, ways) + 0.5
        errors.append(np.abs(found - np.maximum(right, 0)).mean())
    assert errors[1] < 0.3 * errors[0]


def test_scenes_without_a_light_cannot_be_lit(capture, fitted, tmp_path, capsys):
    scene = rift.SplatScene.load(fitted / "scene.ply")
    plain_scene(scene)[0].save(tmp_path / "plain.ply")
    light = ["--environment", str(fitted / "environment.exr"), "--out", str(tmp_path / "r")]
    assert main(["render", str(tmp_path / "plain.ply"), *light]) != 0
    assert "reflect no light" in capsys.readouterr().err


@pytest.mark.parametrize(
    "given, words",
    [
        ({"environment-lobes": 32}, "add --environment shared"),
        ({"own-degree": 0}, "add --environment shared"),
        ({"environment": "shared", "sh-degree": 2}, "--own-degree"),
        ({"environment": "shared", "angular": "sg", "own-degree": 0}, "--angular sg"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(capture, tmp_path, given, words):
    settings = {name.replace("-", "_"): value for name, value in given.items()}
    with pytest.raises(InputError, match=words):
        FitPhotosSettings.of(capture, tmp_path / "fit", **settings).check()
