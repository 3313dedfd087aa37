"""``rift eval``: the scores of a scene, beside what a fit said of it and beside no baselines."""

from __future__ import annotations

import json
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from test_trainer import Ball

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.images.image import write_png
from rift_cl.io.output import write_json


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A ball of splats seen by eight cameras before grey."""
    folder = tmp_path_factory.mktemp("capture")
    ball = Ball(rift.default_device())
    names = [f"{k}.png" for k in range(8)]
    for name, image in zip(names, ball.images, strict=True):
        write_png(folder / name, np.clip(image, 0, 1))
    write_json(folder / "transforms.json", transforms_of(ball.cameras, names))
    return folder


@pytest.fixture(scope="module")
def fitted(capture, tmp_path_factory):
    """The folder of a short fit that held every fourth photograph out."""
    out = tmp_path_factory.mktemp("fits") / "fit"
    words = ["--steps", "30", "--splats", "150", "--hold-out", "4", "--eps2d", "0.2", "--quiet"]
    assert main(["fit", str(capture), "--out", str(out), *words]) == 0
    return out


def evaluate(scene, out, *more):
    return main(["eval", str(scene), *map(str, more), "--out", str(out), "--quiet"])


def metrics_of(folder):
    return json.loads((folder / "metrics.json").read_text())


def test_a_fit_is_scored_as_it_scored_itself(capture, fitted, tmp_path, capsys):
    out = tmp_path / "scores"
    assert evaluate(fitted, out, capture, "--train", capture, "--hold-out", 4) == 0
    printed = capsys.readouterr().out
    assert "PSNR foreground" in printed and "report.html" in printed
    said, found = metrics_of(fitted)["scores"]["held out"], metrics_of(out)
    assert found["eps2d"] == 0.2
    scores = found["scores"][capture.name]
    assert set(scores) == set(said)
    for name, value in said.items():
        assert scores[name] == pytest.approx(value, abs=1e-4), name
    assert [view["name"] for view in found["views"][capture.name]] == ["0.png", "4.png"]
    page = (out / "report.html").read_text()
    assert "degrees away" in page and page.count('class="pair"') == 2
    own = metrics_of(fitted)["errors"]["held out"]
    for kind, rows in found["errors"][capture.name].items():
        assert rows and len(rows) == len(own[kind]), kind
        for row, mine in zip(rows, own[kind], strict=True):
            assert row.pop("region", None) == mine.pop("region", None)
            assert row == pytest.approx(mine, rel=1e-3), kind
    assert "silhouette" in page and "cycles per pixel" in page


def test_without_training_views_there_are_no_baselines(capture, fitted, tmp_path, capsys):
    assert evaluate(fitted / "scene.ply", tmp_path / "scores", capture, "--eps2d", 0.2) == 0
    found = metrics_of(tmp_path / "scores")
    assert len(found["views"][capture.name]) == 8
    assert not any("nearest" in name for name in found["scores"][capture.name])
    # Any letters may come up in a picture's code.
    page = re.sub(r'base64,[^"]*', "", (tmp_path / "scores" / "report.html").read_text())
    assert "degrees away" not in page and "NaN" not in page
    # The held-out ones among them have the scores of the fit.
    said = {v["name"]: v["fit_psnr"] for v in metrics_of(fitted)["views"]["held out"]}
    for view in found["views"][capture.name]:
        if view["name"] in said:
            assert view["fit_psnr"] == pytest.approx(said[view["name"]], abs=1e-4)


def test_how_splats_are_drawn_changes_the_scores(capture, fitted, tmp_path):
    for name, more in (("own", ()), ("soft", ("--eps2d", 100.0))):
        assert evaluate(fitted, tmp_path / name, capture, *more) == 0
    own, soft = (metrics_of(tmp_path / name)["scores"][capture.name] for name in ("own", "soft"))
    assert abs(own["fit_psnr"] - soft["fit_psnr"]) > 0.01


def test_a_dry_run_says_what_would_be_scored(capture, fitted, tmp_path, capsys):
    assert evaluate(fitted / "scene.ply", tmp_path / "scores", capture, "--dry-run") == 0
    printed = capsys.readouterr().out
    assert "8 views" in printed and "no baselines" in printed
    assert not (tmp_path / "scores").exists()


def test_flip_is_scored_when_asked_for(capture, fitted, tmp_path, monkeypatch):
    module = SimpleNamespace(evaluate=lambda *pair, **more: (None, 0.25, {}))
    monkeypatch.setitem(sys.modules, "flip_evaluator", module)
    assert evaluate(fitted, tmp_path / "scores", "--flip") == 0
    scores = metrics_of(tmp_path / "scores")["scores"]["held out"]
    assert scores["fit_flip"] == scores["nearest_flip"] == 0.25
    assert "FLIP" in (tmp_path / "scores" / "report.html").read_text()


def test_scores_that_cannot_be_had_are_named(fitted, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    assert evaluate(fitted, tmp_path / "scores", "--flip") == 3
    assert "flip-evaluator" in capsys.readouterr().err
    assert evaluate(fitted, tmp_path / "scores", "--lpips", tmp_path / "none.pth") == 3
    assert "LPIPS" in capsys.readouterr().err.upper()
    assert not (tmp_path / "scores").exists()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--hold-out", 2), "knows what it held out"),
        (("CAPTURE", "CAPTURE"), "same name"),
        (("CAPTURE", "--train", "CAPTURE"), "--train"),
        (("CAPTURE", "--hold-out", -1), "--hold-out is -1"),
        (("CAPTURE", "--downscale", 0), "downscale is 0"),
        (("CAPTURE", "--downscale", 100), "downscale is 100"),
        (("nowhere",), "nowhere"),
        (("CAPTURE", "--train", "nowhere"), "nowhere"),
    ],
)
def test_what_makes_no_sense_is_named(capture, fitted, tmp_path, capsys, more, words):
    more = [capture if word == "CAPTURE" else word for word in more]
    assert evaluate(fitted, tmp_path / "scores", *more) == 3
    assert words in capsys.readouterr().err
    assert not (tmp_path / "scores").exists()
