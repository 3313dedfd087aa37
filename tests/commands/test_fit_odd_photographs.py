"""Photographs whose exposure changes, and photographs of nothing: what a fit says of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.fit_photos.scores import ViewScore, brightness_of
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.images.image import read_image, write_png


def changed(capture, folder, change):
    """A capture whose pictures are others, by (number, image)."""
    folder.mkdir()
    record = json.loads((capture / "transforms.json").read_text())
    for number, frame in enumerate(record["frames"]):
        image = read_image(capture / frame["file_path"])
        write_png(folder / frame["file_path"], np.clip(change(number, image), 0, 1))
    (folder / "transforms.json").write_text(json.dumps(record))
    return folder


def told(capture, out, capsys, *more):
    given = ["--steps", 60, "--splats", 200, "--hold-out", 3, *more]
    assert main(["fit", "photos", str(capture), "--out", str(out), *map(str, given)]) == 0
    said = capsys.readouterr()
    return said.out + said.err


@pytest.mark.full
def test_exposures_that_change_are_told(capture, tmp_path, capsys):
    exposed = changed(capture, tmp_path / "exposed", lambda k, image: image * (0.6 + 0.4 * (k % 2)))
    assert "--refine-exposures" in told(exposed, tmp_path / "fit", capsys)
    assert "--refine-exposures" in (tmp_path / "fit" / "report.html").read_text()
    assert "--refine-exposures" not in told(capture, tmp_path / "steady", capsys)


@pytest.mark.full
def test_exposures_that_are_fitted_are_not_told(capture, tmp_path, capsys):
    exposed = changed(capture, tmp_path / "exposed", lambda k, image: image * (0.6 + 0.4 * (k % 2)))
    said = told(exposed, tmp_path / "fit", capsys, "--refine-exposures")
    assert "--refine-exposures" not in said
    assert "gains were found between" in said
    metrics = json.loads((tmp_path / "fit" / "metrics.json").read_text())
    scores, found = metrics["scores"]["held out"], metrics["exposures"]["trained"]
    assert scores["fit_psnr"] > scores["given_psnr"] + 3
    # Of the five that were trained on, 1, 5 and 7 were exposed longer than 2 and 4; so few splats
    # show each of them differently well.
    longer, shorter = (
        np.mean([found[f"{number}.png"]["gain"] for number in numbers])
        for numbers in ((1, 5, 7), (2, 4))
    )
    assert longer > 1.15 * shorter


@pytest.mark.full
def test_photographs_of_nothing_are_told(capture, tmp_path, capsys):
    blank = changed(capture, tmp_path / "blank", lambda k, image: 0 * image + 0.5)
    assert "background" in told(blank, tmp_path / "fit", capsys, "--steps", 5)
    assert (tmp_path / "fit" / "scene.ply").is_file()


@pytest.mark.full
def test_alpha_that_is_the_same_everywhere_cuts_out_nothing(capture, tmp_path, capsys):
    """Many programs write RGBA: the fit is that of the colours alone, to the bit."""

    def with_alpha(level):
        def change(_, image):
            return np.dstack([image, np.full(image.shape[:2], level, np.float32)])

        return change

    scenes = {}
    for name, change in {
        "plain": lambda _, image: image,
        "opaque": with_alpha(1),
        "nearly": with_alpha(254 / 255),
    }.items():
        made = changed(capture, tmp_path / name, change)
        told(made, tmp_path / f"fit {name}", capsys, "--steps", 10)
        scenes[name] = (tmp_path / f"fit {name}" / "scene.ply").read_bytes()
    assert scenes["plain"] == scenes["opaque"] == scenes["nearly"]


def test_a_photograph_that_the_object_fills_belongs_to_what_is_cut_out(capture, tmp_path, capsys):
    def change(number, image):
        alpha = np.ones(image.shape[:2], np.float32)
        if number:
            alpha[:20] = 0
        return np.dstack([image, alpha])

    cut = changed(capture, tmp_path / "cut", change)
    pictures = CapturePictures(rift.default_device(), open_capture(cut).views)
    assert pictures.any_cut_out()
    assert pictures.foreground(0).all()
    assert pictures.foreground(1).mean() == pytest.approx(2 / 3)


@pytest.mark.parametrize("count", [3, 30])
def test_a_few_sparse_points_are_not_begun_at_and_that_is_said(capture, tmp_path, capsys, count):
    sparse = changed(capture, tmp_path / "sparse", lambda _, image: image)
    record = json.loads((sparse / "transforms.json").read_text())
    (sparse / "transforms.json").write_text(json.dumps({**record, "ply_file_path": "points.ply"}))
    places = np.random.default_rng(0).normal(0, 0.3, (count, 3))
    lines = ["ply", "format ascii 1.0", f"element vertex {count}"]
    lines += [f"property float {axis}" for axis in "xyz"] + ["end_header"]
    lines += [" ".join(f"{value:.4f}" for value in place) for place in places]
    (sparse / "points.ply").write_text("\n".join(lines) + "\n")
    said = told(sparse, tmp_path / "fit", capsys, "--steps", 5)
    assert ("3 sparse points are too few to begin at" in said) == (count == 3)


@pytest.mark.full
@pytest.mark.filterwarnings("always:.*its mask is black")
@pytest.mark.parametrize("black", [[0], [0, 3, 6]])
def test_photographs_with_a_black_mask_are_not_scored(capture, tmp_path, capsys, black):
    masked = changed(capture, tmp_path / "masked", lambda _, image: image)
    (masked / "masks").mkdir()
    for number in range(8):
        mask = np.full((60, 80), float(number not in black))
        write_png(masked / "masks" / f"{number}.png", mask)
    said = told(masked, tmp_path / "fit", capsys, "--steps", 5)
    assert "0.png: its mask is black, so that it is not scored" in said
    found = json.loads((tmp_path / "fit" / "metrics.json").read_text())["views"]
    assert len(found.get("held out", [])) == 3 - len(black)
    words = ["eval", str(tmp_path / "fit"), "--out", str(tmp_path / "scores")]
    assert (main(words) == 0) == (len(black) == 1)


@pytest.mark.full
def test_a_fit_that_is_no_better_than_its_neighbours_is_told(capture, tmp_path, capsys):
    shuffled = tmp_path / "shuffled"
    shuffled.mkdir()
    record = json.loads((capture / "transforms.json").read_text())
    names = [frame["file_path"] for frame in record["frames"]]
    for frame, name in zip(record["frames"], names[3:] + names[:3], strict=True):
        (shuffled / name).write_bytes((capture / name).read_bytes())
        frame["file_path"] = name
    (shuffled / "transforms.json").write_text(json.dumps(record))
    assert "poses, intrinsics or masks" in told(shuffled, tmp_path / "fit", capsys, "--steps", 5)
    assert "poses, intrinsics or masks" in (tmp_path / "fit" / "report.html").read_text()
    enough = ("--steps", 400, "--splats", 600)
    assert "poses, intrinsics" not in told(capture, tmp_path / "right", capsys, *enough)


def test_brightness_is_a_factor_of_each_picture():
    random = np.random.default_rng(0)
    images = random.uniform(0.1, 1, (3, 4, 5, 3)).astype(np.float32)

    def brightness(factors, noise=0.0):
        return brightness_of(
            [
                ViewScore("", 0.0, {}, f * i + noise * random.normal(size=i.shape), i)
                for f, i in zip(factors, images, strict=True)
            ]
        )

    assert brightness([0.7, 0.7, 0.7]).spread == pytest.approx(0, abs=1e-6)
    found = brightness([0.5, 1, 2])
    assert found.spread == pytest.approx(np.std(np.log([0.5, 1, 2])), rel=1e-5)
    assert found.explained == pytest.approx(1)
    # Pixels that do not count say nothing of it.
    counted = np.zeros((4, 5), bool)
    counted[1:3] = True
    masked = [
        ViewScore("", 0.0, {}, np.where(counted[..., None], f * i, 1), i, counted=counted)
        for f, i in zip([0.5, 1, 2], images, strict=True)
    ]
    assert brightness_of(masked).spread == pytest.approx(found.spread, rel=1e-5)
    # What is wrong in other ways is no matter of brightness.
    assert brightness([0.9, 1, 1.1], 0.5).explained < 0.2
    assert brightness_of([]) == (0, 0)
