"""``rift fit`` from photographs to a report, on a capture made of our own pictures."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from test_start import MIDDLE_OF_RING, ring

import rift_cl as rift
from rift_cl.commands.cli import main


def fit(capture, out, *more):
    arguments = ["fit", str(capture), "--out", str(out), "--steps", "60", "--splats", "200"]
    return main([*arguments, "--hold-out", "4", "--quiet", *more])


def test_a_fit_leaves_splats_scores_and_a_report(capture, tmp_path, capsys):
    assert fit(capture, tmp_path / "fit") == 0
    printed = capsys.readouterr().out
    assert "held out" in printed and "scene.ply and report.html" in printed
    scene = rift.SplatScene.load(tmp_path / "fit" / "scene.ply")
    assert 0 < len(scene) <= 200
    metrics = json.loads((tmp_path / "fit" / "metrics.json").read_text())
    assert metrics["splats"] == len(scene)
    scores = metrics["scores"]["held out"]
    names = [f"{who}_{what}" for who in ("fit", "nearest", "blend") for what in ("psnr", "ssim")]
    assert set(names) | {"fit_psnr_foreground"} <= set(scores)
    assert [view["name"] for view in metrics["views"]["held out"]] == ["0.png", "4.png"]
    assert all(30 < view["angle"] < 60 for view in metrics["views"]["held out"])
    page = (tmp_path / "fit" / "report.html").read_text()
    assert "Splats fitted to" in page and page.count("<img") >= 2
    config = json.loads((tmp_path / "fit" / "config.json").read_text())
    assert config["complete"] and config["settings"]["training"]["steps"] == 60


@pytest.mark.full
def test_the_same_seed_gives_the_same_file(capture, tmp_path):
    for name in ("one", "two"):
        assert fit(capture, tmp_path / name) == 0
    assert fit(capture, tmp_path / "other", "--seed", "1") == 0
    one, two, other = (
        (tmp_path / name / "scene.ply").read_bytes() for name in ("one", "two", "other")
    )
    assert one == two != other


def test_a_dry_run_writes_nothing(capture, tmp_path, capsys):
    assert fit(capture, tmp_path / "fit", "--dry-run") == 0
    printed = capsys.readouterr().out
    assert "6 photographs" in printed and "2 photographs" in printed
    assert not (tmp_path / "fit").exists()


@pytest.mark.full
def test_more_captures_are_scored_beside_it(capture, tmp_path):
    assert fit(capture, tmp_path / "fit", "--test", str(capture), "--views", "3") == 0
    metrics = json.loads((tmp_path / "fit" / "metrics.json").read_text())
    assert set(metrics["scores"]) == {"held out", capture.name}
    assert len(metrics["views"][capture.name]) == 8


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--hold-out", "1"], "leaves no photograph"),
        (["--views", "7"], "--views is 7, there are 6"),
        (["--downscale", "0"], "--downscale is 0"),
        (["--steps", "0"], "steps is 0"),
        (["--eps2d", "-1"], "eps2d is -1"),
        (["--sh-degree", "9"], "sh-degree is 9"),
        (["--test", "nowhere"], "nowhere"),
        (["--homogenise", "0", "--homogenise-by", "coverage"], "--homogenise-by coverage has no"),
    ],
)
def test_what_makes_no_sense_is_named_and_leaves_nothing(capture, tmp_path, capsys, more, words):
    assert fit(capture, tmp_path / "fit", *more) == 3
    assert words in capsys.readouterr().err
    assert not (tmp_path / "fit").exists()


@pytest.mark.full
def test_an_earlier_fit_is_not_lost(capture, tmp_path, capsys):
    assert fit(capture, tmp_path / "fit") == 0
    before = (tmp_path / "fit" / "scene.ply").read_bytes()
    assert fit(capture, tmp_path / "fit", "--seed", "5") == 5
    assert "--overwrite" in capsys.readouterr().err
    assert (tmp_path / "fit" / "scene.ply").read_bytes() == before
    assert fit(capture, tmp_path / "fit", "--seed", "5", "--overwrite") == 0
    assert (tmp_path / "fit" / "scene.ply").read_bytes() != before


def test_the_ring_is_where_the_capture_says(capture):
    """The fixture itself: the cameras that are read back look at the ball."""
    from rift_cl.io.captures.capture import open_capture

    for view, camera in zip(open_capture(capture).views, ring(8), strict=True):
        np.testing.assert_allclose(view.camera.view, camera.view, atol=1e-6)
        local = view.camera.view[:3, :3] @ MIDDLE_OF_RING + view.camera.view[:3, 3]
        assert local[2] > 4


@pytest.mark.full
def test_the_captures_own_lists_are_followed_unless_told_otherwise(capture, tmp_path, capsys):
    """As nerfstudio would: by 'train_filenames' and 'test_filenames'."""
    listed = tmp_path / "listed"
    shutil.copytree(capture, listed)
    path = listed / "transforms.json"
    lists = {
        "train_filenames": [f"{number}.png" for number in range(5)],
        "test_filenames": ["6.png", "7.png"],
    }
    path.write_text(json.dumps(json.loads(path.read_text()) | lists))
    words = ("--out", tmp_path / "fit", "--steps", "5", "--splats", "50")
    assert main(["fit", str(listed), *map(str, words)]) == 0
    assert (
        "Trained on 5 photographs, and 2 held out, by the capture's own" in capsys.readouterr().err
    )
    held_out = json.loads((tmp_path / "fit/metrics.json").read_text())["views"]["held out"]
    assert [view["name"] for view in held_out] == ["6.png", "7.png"]
    config = json.loads((tmp_path / "fit/config.json").read_text())
    assert config["settings"]["hold_out"] is None
    assert fit(listed, tmp_path / "every", "--dry-run") == 0
    assert "6 photographs" in capsys.readouterr().out


@pytest.mark.full
def test_a_list_of_no_frame_is_told_of_before_a_fit_that_scores_nothing(capture, tmp_path, capsys):
    listed = tmp_path / "listed"
    shutil.copytree(capture, listed)
    path = listed / "transforms.json"
    lists = {"val_filenames": ["06.png"]}  # misspelt
    path.write_text(json.dumps(json.loads(path.read_text()) | lists))
    words = ["fit", str(listed), "--out", str(tmp_path / "fit"), "--steps", "5", "--splats", "50"]
    assert main([*words, "--dry-run"]) == 0
    planned = " ".join(capsys.readouterr().out.replace("\u2502", " ").split())
    assert "such as 06.png, belong to no frame" in planned
    assert "Trained on 8 photographs, and none held out, by the capture's own" in planned
    assert main(words) == 0
    told = capsys.readouterr()
    assert "and none held out" in told.err and "PSNR" not in told.out
