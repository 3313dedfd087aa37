"""``rift eval``: the scores of a scene, beside what a fit said of it and beside no baselines."""

from __future__ import annotations

import json
import re
import shutil
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from test_trainer import MIDDLE, Ball

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.images.image import read_image, write_png
from rift_cl.io.images.pixels import write_pixels
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
    told = capsys.readouterr()
    assert "PSNR foreground" in told.out and "report.html" in told.out
    assert "poses are those of the captures" in told.err
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


def test_scored_photographs_that_were_trained_on_are_told(capture, fitted, tmp_path, capsys):
    assert evaluate(fitted, tmp_path / "scores", capture) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert f"6 of the 8 pictures of {capture.name}, such as 1.png, were trained on" in told
    found, said = metrics_of(tmp_path / "scores"), metrics_of(fitted)["scores"]["held out"]
    record = found["trained_on"][capture.name]
    assert record["pictures"] == [f"{number}.png" for number in (1, 2, 3, 5, 6, 7)]
    # The others are those that the fit held out, beside the same baselines.
    assert record["others"] == pytest.approx(said, abs=1e-4)
    compared = found["compared"][capture.name]["psnr"]
    assert compared["pictures"] == 2
    assert compared["fit"] == pytest.approx(said["fit_psnr"], abs=1e-4)
    assert f"{said['fit_psnr']:.4g} dB over the 2 others" in told
    whole = np.mean([view["fit_psnr"] for view in found["views"][capture.name]])
    assert found["scores"][capture.name]["fit_psnr"] == pytest.approx(whole)
    assert [view["angle"] is None for view in found["views"][capture.name]][:2] == [False, True]


def test_nothing_is_said_of_photographs_that_were_held_out(fitted, tmp_path, capsys):
    assert evaluate(fitted, tmp_path / "scores") == 0
    assert "trained on, which" not in " ".join(capsys.readouterr().err.split())
    assert "trained_on" not in metrics_of(tmp_path / "scores")


def test_doubts_of_a_capture_are_told(capture, fitted, tmp_path, capsys):
    """Those that a fit tells of it: intrinsics of another size, numbers beyond white."""
    record = json.loads((capture / "transforms.json").read_text())
    folder = tmp_path / "doubted"
    folder.mkdir()
    for number, frame in enumerate(record["frames"]):
        frame["cx"] = 5.0
        frame["file_path"] = f"{number}.exr"
        write_pixels(
            folder / f"{number}.exr",
            np.full((60, 80, 3), 2.0, np.float32),
            format="openexr",
            attributes={},
        )
    write_json(folder / "transforms.json", record)
    assert evaluate(fitted, tmp_path / "scores", folder, "--hold-out", 4) == 0
    told = " ".join(capsys.readouterr().err.split())
    page = (tmp_path / "scores" / "report.html").read_text()
    for words in ("the intrinsics are those of another size", "100 % of the numbers"):
        assert words in told and words in page


def test_views_without_a_splat_in_sight_are_told(capture, fitted, tmp_path, capsys):
    record = json.loads((capture / "transforms.json").read_text())
    folder = shutil.copytree(capture, tmp_path / "turned")
    turned = np.array(record["frames"][0]["transform_matrix"]) @ np.diag([1, -1, -1, 1])
    record["frames"][0]["transform_matrix"] = turned.tolist()
    write_json(folder / "transforms.json", record)
    assert evaluate(fitted, tmp_path / "scores", folder) == 0
    assert "no splat is in sight of 1 of 8 views" in " ".join(capsys.readouterr().err.split())


def test_poses_of_other_axes_are_refused_as_a_fit_refuses_them(capture, fitted, tmp_path, capsys):
    record = json.loads((capture / "transforms.json").read_text())
    folder = shutil.copytree(capture, tmp_path / "turned")
    for frame in record["frames"]:
        turned = np.array(frame["transform_matrix"]) @ np.diag([1, -1, -1, 1])
        frame["transform_matrix"] = turned.tolist()
    points = np.random.default_rng(0).normal(0, 0.1, (40, 3)) + MIDDLE
    rows = "\n".join(" ".join(map(str, point)) for point in points)
    head = "ply\nformat ascii 1.0\nelement vertex 40\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    (folder / "points.ply").write_text(f"{head}end_header\n{rows}\n")
    write_json(folder / "transforms.json", record | {"ply_file_path": "points.ply"})
    assert evaluate(fitted, tmp_path / "scores", folder) == 3
    assert "the axes of their cameras are turned" in " ".join(capsys.readouterr().err.split())
    words = ["render", str(fitted), "--path", str(folder), "--out", str(tmp_path / "film")]
    assert main(words) == 3
    assert "the axes of their cameras are turned" in " ".join(capsys.readouterr().err.split())


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


def without_border(capture, folder):
    """The middle of every photograph alone, which the ball fills."""
    folder.mkdir()
    record = json.loads((capture / "transforms.json").read_text())
    for frame in record["frames"]:
        frame |= {"w": 20, "h": 16, "cx": 10, "cy": 8}
        image = read_image(capture / frame["file_path"])
        write_png(folder / frame["file_path"], image[22:38, 30:50])
    write_json(folder / "transforms.json", record)
    return folder


def test_the_background_is_the_fits_whether_or_not_its_photographs_are_there(
    capture, fitted, tmp_path, capsys
):
    near = without_border(capture, tmp_path / "near")
    config = json.loads((fitted / "config.json").read_text())
    config["photographs"] |= {"folder": str(tmp_path / "gone"), "from_fit": "gone"}
    lone = shutil.copytree(fitted, tmp_path / "lone")
    (lone / "config.json").write_text(json.dumps(config))
    wanted, found = metrics_of(fitted)["background"], []
    assert wanted == pytest.approx([0.5] * 3, abs=0.01)
    for number, fit in enumerate((fitted, lone)):
        assert evaluate(fit, tmp_path / str(number), near) == 0
        assert "the background of the fit" in capsys.readouterr().err
        scores = metrics_of(tmp_path / str(number))
        assert scores["background"] == {"near": wanted}
        found.append(scores["views"]["near"])
    # Photographs that are gone are at no angle.
    assert [views[0]["angle"] is not None for views in found] == [True, False]
    assert [view["fit_psnr"] for view in found[0]] == [view["fit_psnr"] for view in found[1]]


@pytest.mark.parametrize(
    ("given", "more", "level", "words"),
    [
        ("capture", (), 0.5, "the common border of the photographs"),
        ("near", (), 0.0, "black, since the photographs have no common border"),
        ("capture", ("--background", 1, 1, 1), 1.0, "as --background says"),
    ],
)
def test_the_background_of_a_file_is_the_photographs_border_or_black(
    capture, fitted, tmp_path, capsys, given, more, level, words
):
    scored = capture if given == "capture" else without_border(capture, tmp_path / "near")
    assert evaluate(fitted / "scene.ply", tmp_path / "scores", scored, *more) == 0
    assert words in capsys.readouterr().err
    assert words in (tmp_path / "scores" / "report.html").read_text()
    (found,) = metrics_of(tmp_path / "scores")["background"].values()
    assert found == pytest.approx([level] * 3, abs=0.01)


def test_lpips_is_left_out_where_pixels_do_not_count_and_that_is_said(
    capture, fitted, tmp_path, monkeypatch, capsys
):
    """It has no map that could be averaged over the pixels that count."""
    torch = SimpleNamespace(__spec__=True)
    network = SimpleNamespace(Lpips=lambda weights: lambda image, truth: 0.125)
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setitem(sys.modules, "rift_cl.interop.lpips", network)
    masked = shutil.copytree(capture, tmp_path / "masked")
    mask = np.ones((60, 80))
    for number in (0, 5):
        mask[:, :20] = 0
        write_png(masked / f"{number}_mask.png", mask)
    assert evaluate(fitted, tmp_path / "scores", masked, "--lpips", tmp_path / "any.pth") == 0
    assert "LPIPS is left out for 2 of 8 photographs" in capsys.readouterr().err
    found = metrics_of(tmp_path / "scores")["views"]["masked"]
    assert [number for number, v in enumerate(found) if "fit_lpips" not in v] == [0, 5]


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


def test_flip_is_left_out_where_its_filters_see_pixels_that_do_not_count(
    capture, fitted, tmp_path, monkeypatch, capsys
):
    module = SimpleNamespace(evaluate=lambda *pair, **more: (None, 0.25, {}))
    monkeypatch.setitem(sys.modules, "flip_evaluator", module)
    masked = shutil.copytree(capture, tmp_path / "masked")
    mask = np.zeros((60, 80))
    mask[:, 30:50] = 1
    write_png(masked / "5_mask.png", mask)
    assert evaluate(fitted, tmp_path / "scores", masked, "--flip") == 0
    assert "FLIP is left out for 1 of 8 photographs" in capsys.readouterr().err
    found = metrics_of(tmp_path / "scores")["views"]["masked"]
    assert [number for number, v in enumerate(found) if "fit_flip" not in v] == [5]


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
        (("CAPTURE", "--downscale", 6), "--downscale 6 leaves 13 x 10 pixels of 0.png"),
        (("nowhere",), "nowhere"),
        (("CAPTURE", "--train", "nowhere"), "nowhere"),
    ],
)
def test_what_makes_no_sense_is_named(capture, fitted, tmp_path, capsys, more, words):
    more = [capture if word == "CAPTURE" else word for word in more]
    assert evaluate(fitted, tmp_path / "scores", *more) == 3
    assert words in capsys.readouterr().err
    assert not (tmp_path / "scores").exists()
