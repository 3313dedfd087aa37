"""A fit beside its baselines: over the same pictures, whatever pictures have no baseline."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.fit_photos.comparison import (
    compared_means,
    compared_record,
    comparison_notes,
    trained_record,
)
from rift_cl.commands.fit_photos.report import doubt_notes, score_rows
from rift_cl.commands.fit_photos.scores import ViewScore, mean_scores
from rift_cl.io.images.image import read_image, write_png

EMPTY = np.zeros((2, 2, 3), np.float32)


def view(name, fit, nearest=None, blend=None, angle=10.0):
    """Scores of a picture, without baselines where none are given."""
    values = {"fit_psnr": fit, "nearest_psnr": nearest, "blend_psnr": blend}
    known = {name: value for name, value in values.items() if value is not None}
    return ViewScore(name, angle, known, EMPTY, EMPTY)


def test_a_fit_is_compared_over_the_pictures_that_have_baselines():
    scores = [view("a", 10.0), view("b", 20.0, 12.0, 13.0), view("c", 30.0, 14.0, 17.0)]
    found = compared_means(scores, "psnr")
    assert found.pictures == 2
    assert found.means == {"fit": 25.0, "nearest": 13.0, "blend": 15.0}
    # All that the fit has is in its own mean.
    assert mean_scores(scores)["fit_psnr"] == 20.0
    (note,) = comparison_notes({"held out": scores})
    assert "1 of the 3 pictures of held out, such as a," in note and "20 dB" in note


def test_doubt_is_of_the_same_pictures():
    """Over all pictures the fit has 20 dB; where a baseline is, it is worse than that."""
    scores = [view("a", 30.0), view("b", 10.0, 12.0, 15.0)]
    (note,) = doubt_notes(scores)
    assert "(10.0 dB)" in note and "(15.0 dB)" in note
    assert not doubt_notes([view("a", 5.0), view("b", 20.0, 12.0, 15.0)])
    assert not doubt_notes([view("a", 5.0)]) and not doubt_notes([])


def test_an_exact_picture_is_in_no_mean_and_told():
    scores = [view("a", 20.0, 12.0, 13.0), view("grey", 24.0, math.inf, math.inf)]
    found = compared_means(scores, "psnr")
    assert found.pictures == 1 and found.means == {"fit": 20.0, "nearest": 12.0, "blend": 13.0}
    assert not doubt_notes(scores) and mean_scores(scores)["blend_psnr"] == 13.0
    (note,) = comparison_notes({"held out": scores})
    assert "such as grey," in note and "infinite" in note


def test_without_a_common_picture_the_fit_stands_alone():
    scores = [view("a", 10.0), view("b", 20.0)]
    groups = {"held out": scores}
    assert score_rows(compared_record(groups)) == [("held out", "PSNR", 15.0, None, None, None)]
    (note,) = comparison_notes(groups)
    assert "nothing to compare" in note and not doubt_notes(scores)


def test_pictures_that_were_all_trained_on_leave_no_score():
    scores = [replace(view("a", 20.0, angle=math.nan), trained=True)]
    (note,) = comparison_notes({"cap": scores})
    assert "1 of the 1 pictures of cap, such as a," in note and "none is left" in note
    record = trained_record({"cap": scores, "other": [view("b", 10.0)]})
    assert record == {"trained_on": {"cap": {"pictures": ["a"], "others": {}}}}
    assert not trained_record({"other": [view("b", 10.0)]})


def test_pictures_without_training_pictures_lack_nothing():
    assert not comparison_notes({"all": [view("a", 10.0, angle=math.nan)]})


@pytest.fixture(scope="module")
def mixed(capture, tmp_path_factory):
    """The capture, with all photographs but three beside each other cropped by a column."""
    folder = tmp_path_factory.mktemp("mixed")
    record = json.loads((capture / "transforms.json").read_text())
    for number, frame in enumerate(record["frames"]):
        image = read_image(capture / frame["file_path"])
        cropped = number not in (3, 4, 5)
        write_png(folder / frame["file_path"], image[:, :-1] if cropped else image)
        frame["w"] = 79 if cropped else 80
    del record["w"]
    (folder / "transforms.json").write_text(json.dumps(record))
    return folder


@pytest.mark.full
def test_photographs_of_other_sizes_are_told_by_fit_and_eval(mixed, tmp_path, capsys):
    """Of those held out, 2 lies between photographs of both sizes."""
    words = ["--steps", "5", "--splats", "100", "--hold-out", "2", "--downscale", "1"]
    assert main(["fit", "photos", str(mixed), "--out", str(tmp_path / "fit"), *words]) == 0
    said = capsys.readouterr()
    printed = " ".join((said.out + said.err).split())
    compared = json.loads((tmp_path / "fit" / "metrics.json").read_text())["compared"]["held out"]
    views = json.loads((tmp_path / "fit" / "metrics.json").read_text())["views"]["held out"]
    common = [view for view in views if "blend_psnr" in view]
    assert 0 < len(common) < len(views) and compared["psnr"]["pictures"] == len(common)
    for name in ("fit", "nearest", "blend"):
        expected = np.mean([view[f"{name}_psnr"] for view in common])
        assert compared["psnr"][name] == pytest.approx(expected)
    sentence = f"{len(views) - len(common)} of the {len(views)} pictures of held out"
    assert sentence in printed and " nan " not in printed
    assert sentence in (tmp_path / "fit" / "report.html").read_text()
    assert main(["eval", str(tmp_path / "fit"), "--out", str(tmp_path / "eval")]) == 0
    assert sentence in " ".join(capsys.readouterr().err.split())
    again = json.loads((tmp_path / "eval" / "metrics.json").read_text())["compared"]["held out"]
    assert again["psnr"]["pictures"] == len(common)
