"""Commands take the cameras from the fit: no capture has to be named, no photograph to be there."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from test_start import MIDDLE_OF_RING, ring

from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.cli import main
from rift_cl.commands.render.settings import RenderSettings
from rift_cl.geometry import Camera
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import write_json

FIT = ("--steps", "30", "--splats", "150", "--hold-out", "4", "--quiet")


@pytest.fixture(scope="module")
def home(capture, tmp_path_factory):
    """A folder with photographs and a fit of them."""
    home = tmp_path_factory.mktemp("home")
    shutil.copytree(capture, home / "photographs")
    assert main(["fit", str(home / "photographs"), "--out", str(home / "fit"), *FIT]) == 0
    return home


@pytest.fixture
def alone(home, tmp_path):
    """The fit without its photographs, as somebody gets it who has them not."""
    shutil.copytree(home / "fit", tmp_path / "alone")
    config = json.loads((tmp_path / "alone" / "config.json").read_text())
    config["photographs"] |= {"folder": str(tmp_path / "gone"), "from_fit": "../gone"}
    write_json(tmp_path / "alone" / "config.json", config)
    return tmp_path / "alone"


@pytest.fixture
def older(home, tmp_path):
    """A fit as versions left it that kept no cameras."""
    shutil.copytree(home / "fit", tmp_path / "older")
    for name in ("transforms.json", "cameras.json"):
        (tmp_path / "older" / name).unlink()
    return tmp_path / "older"


def run(command, *words):
    return main([command, *map(str, words), "--quiet"])


def metrics_of(folder):
    return json.loads((folder / "metrics.json").read_text())


def test_what_was_held_out_has_the_scores_that_the_fit_printed(home, tmp_path):
    assert run("eval", home / "fit", "--out", tmp_path / "scores") == 0
    found = metrics_of(tmp_path / "scores")
    said = metrics_of(home / "fit")
    assert [v["name"] for v in found["views"]["held out"]] == ["0.png", "4.png"]
    assert set(found["scores"]["held out"]) == set(said["scores"]["held out"])
    for name, value in said["scores"]["held out"].items():
        assert found["scores"]["held out"][name] == pytest.approx(value, abs=1e-4), name


def test_a_capture_that_is_named_has_the_baselines_of_the_fit(home, tmp_path):
    words = ("eval", home / "fit", home / "photographs", "--hold-out", 4)
    assert run(*words, "--out", tmp_path / "scores") == 0
    assert "nearest_psnr" in metrics_of(tmp_path / "scores")["scores"]["photographs"]
    # Photographs that were trained on are their own nearest: no baseline.
    assert run(*words[:3], "--out", tmp_path / "all") == 0
    every = metrics_of(tmp_path / "all")["views"]["photographs"]
    assert {view["name"] for view in every if "nearest_psnr" in view} == {"0.png", "4.png"}


def test_who_names_the_photographs_or_the_fit_is_told_that_the_fit_knows_them(
    home, tmp_path, capsys
):
    bare = tmp_path / "bare"
    bare.mkdir()
    shutil.copy(home / "photographs" / "0.png", bare)
    for name in (bare, home / "fit", home / "fit" / "poses"):
        assert run("eval", home / "fit", name, "--out", tmp_path / "scores") == 3
        assert f"only the fit: rift eval {home / 'fit'}" in capsys.readouterr().err


def test_photographs_that_have_moved_are_named(home, alone, tmp_path, capsys):
    assert run("eval", alone, "--out", tmp_path / "scores") == 3
    error = capsys.readouterr().err
    assert "8 of its 8 photographs have moved" in error and "--photographs" in error
    assert not (tmp_path / "scores").exists()
    words = ("--photographs", home / "photographs", "--out", tmp_path / "scores")
    assert run("eval", alone, *words) == 0
    assert len(metrics_of(tmp_path / "scores")["views"]["held out"]) == 2


def test_a_film_needs_no_photographs(alone, tmp_path):
    small = ("--frames", 5, "--size", 40, 30)
    assert run("render", alone, "--out", tmp_path / "film", *small) == 0
    found = metrics_of(tmp_path / "film")
    np.testing.assert_allclose(found["center"], MIDDLE_OF_RING, atol=1e-6)
    np.testing.assert_allclose(found["up"], (0, 0, 1), atol=1e-6)
    assert found["degrees_to_photographs"] < 30
    for words in (("--path", alone), ("--capture", alone, "--frames", 2)):
        out = tmp_path / words[0].strip("-")
        assert run("render", alone, "--out", out, *words, "--size", 40, 30) == 0
    assert len(open_capture(tmp_path / "path").views) == 8


def test_a_scene_that_is_named_without_its_fit_is_said_to_be(home, older, tmp_path, capsys):
    small = ("--frames", 2, "--size", 40, 30)
    scene = home / "fit" / "scene.ply"
    words = f"{scene} is read without the fit"
    assert run("render", scene, "--out", tmp_path / "film", *small) == 0
    said = capsys.readouterr().err
    assert words in said and f"name the folder instead: {home / 'fit'}" in said
    for number, more in enumerate(((home / "fit",), (scene, "--capture", home / "photographs"))):
        assert run("render", *more, "--out", tmp_path / f"film{number}", *small) == 0
    assert run("render", older / "scene.ply", "--out", tmp_path / "alone", *small) == 0
    assert "taken without" not in capsys.readouterr().err


def test_distance_and_elevation_are_about_the_focus_and_up_that_are_used(alone, tmp_path):
    """Cameras with the picture's top down; what up is, is said; and a focus that the fit found."""
    turned = []
    for camera in ring(8):
        turned.append(Camera(camera.size, camera.K, np.diag([-1.0, -1, 1, 1]) @ camera.view))
    names = [f"{k}.png" for k in range(8)]
    write_json(tmp_path / "transforms.json", transforms_of(turned, names))
    scene = alone / "scene.ply"
    settings = RenderSettings(scene=scene, capture=tmp_path, up=(0, 0, 2))
    bounds = settings.bounds(settings.open_scene())
    assert bounds.elevation == pytest.approx(np.degrees(np.arctan(0.3)), abs=1e-6)
    record = json.loads((alone / "transforms.json").read_text())
    focus = np.add(MIDDLE_OF_RING, (0, 0, -1.0))
    record["capture"] |= {"focus": focus.tolist(), "up": [0, 0, -1]}
    write_json(alone / "transforms.json", record)
    for up, sign in ((None, -1), ((0, 0, 1), 1)):
        settings = RenderSettings(scene=alone, up=up)
        bounds = settings.bounds(settings.open_scene())
        np.testing.assert_array_equal(bounds.center, focus)
        assert bounds.distance == pytest.approx(np.hypot(5, 2.5), abs=1e-6)
        assert bounds.elevation == pytest.approx(sign * np.degrees(np.arctan(0.5)), abs=1e-6)


@pytest.mark.full
def test_analysis_and_plans_take_a_fit_for_its_capture(alone, tmp_path):
    sampled = open_sampled(AnalyzeSettings(alone, out=tmp_path / "analysis"))
    assert sampled.views == 8
    np.testing.assert_allclose(sampled.target.center, MIDDLE_OF_RING, atol=1e-6)
    words = ("--have", alone, "--out", tmp_path / "plan", "--dry-run")
    assert run("plan", "--views", 2, *words) == 0


def test_an_older_fit_says_what_it_lacks_and_still_works(older, home, tmp_path, capsys):
    small = ("--frames", 2, "--size", 40, 30)
    assert run("render", older, "--out", tmp_path / "film", *small) == 0
    assert "holds no cameras" in capsys.readouterr().err
    words = ("--capture", home / "photographs", "--out", tmp_path / "upright", *small)
    assert run("render", older, *words) == 0
    assert "no cameras" not in capsys.readouterr().err
    assert run("eval", older, "--out", tmp_path / "scores") == 3
    assert "older version and holds no cameras" in capsys.readouterr().err
    assert run("eval", older / "scene.ply", "--out", tmp_path / "scores") == 3
    assert "is no fit's folder" in capsys.readouterr().err


@pytest.mark.full
def test_a_fit_that_held_nothing_out_has_nothing_to_score(home, tmp_path, capsys):
    words = ("--steps", "1", "--splats", "9", "--hold-out", "0", "--checkpoint-every", "0")
    assert run("fit", home / "photographs", "--out", tmp_path / "fit", *words) == 0
    assert run("eval", tmp_path / "fit", "--out", tmp_path / "scores") == 3
    assert "held no photographs out" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["render", "analyze", "plan"])
def test_cameras_in_one_place_are_told_by_every_command(home, tmp_path, capsys, command):
    record = json.loads((home / "photographs" / "transforms.json").read_text())
    for frame in record["frames"]:
        for row in frame["transform_matrix"][:3]:
            row[3] = 2.0
    write_json(tmp_path / "transforms.json", record)
    words = {
        "render": (home / "fit", "--capture", tmp_path),
        "analyze": (tmp_path,),
        "plan": ("--have", tmp_path),
    }[command]
    assert run(command, *words, "--out", tmp_path / "out") == 3
    assert "all 8 cameras stand in one place" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.full
def test_a_film_is_made_again_from_its_key_frames(alone, tmp_path):
    film, again = tmp_path / "film", tmp_path / "again"
    assert run("render", alone, "--out", film, "--frames", 25, "--size", 20, 16) == 0
    keys = ("--path", film / "key_frames.json", "--between", 1)
    assert run("render", alone, "--out", again, *keys) == 0
    whole, made = (open_capture(folder).views for folder in (film, again))
    assert len(made) == len(whole) == 25 and not (again / "key_frames.json").exists()
    for old, new in zip(whole, made, strict=True):
        # 24 steps are a turn at a distance of 5.
        assert np.linalg.norm(old.camera.center - new.camera.center) < 0.1
