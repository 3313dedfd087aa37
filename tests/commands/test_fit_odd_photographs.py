"""Photographs whose exposure changes, and photographs of nothing: what a fit says of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.fit_photos.scores import ViewScore, brightness_spread
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


def test_photographs_of_nothing_are_told(capture, tmp_path, capsys):
    blank = changed(capture, tmp_path / "blank", lambda k, image: 0 * image + 0.5)
    assert "background" in told(blank, tmp_path / "fit", capsys, "--steps", 5)
    assert (tmp_path / "fit" / "scene.ply").is_file()


def test_brightness_is_a_factor_of_each_picture():
    random = np.random.default_rng(0)
    images = random.uniform(0.1, 1, (3, 4, 5, 3)).astype(np.float32)

    def spread(factors):
        return brightness_spread(
            [ViewScore("", 0.0, {}, f * i, i) for f, i in zip(factors, images, strict=True)]
        )

    assert spread([0.7, 0.7, 0.7]) == pytest.approx(0, abs=1e-6)
    assert spread([0.5, 1, 2]) == pytest.approx(np.std(np.log([0.5, 1, 2])), rel=1e-5)
    assert brightness_spread([]) == 0
