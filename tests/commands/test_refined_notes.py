"""What is told of poses and exposures: how far they went, and whether they were held back."""

from __future__ import annotations

import pytest

from rift_cl.commands.fit_photos.refined import exposure_notes, pose_notes
from rift_cl.commands.fit_photos.report import score_table


def told(turned, moved, reach=1.0, scores=None):
    spreads = {
        name: {"median": median, "largest": 2 * median, "reach": reach}
        for name, median in (("turned", turned), ("moved", moved))
    }
    return pose_notes({"poses": spreads, "scores": scores or {}})


@pytest.mark.parametrize(("turned", "moved"), [(0.8, 0.1), (0.1, 0.8)])
def test_poses_that_were_held_back_are_told(turned, moved):
    assert any("--learning-rates.pose-reach" in note for note in told(turned, moved))
    assert not any("--learning-rates.pose-reach" in note for note in told(0.6, 0.6))
    # A run of too few steps to move any.
    assert not any("--learning-rates.pose-reach" in note for note in told(0.0, 0.0, reach=0.0))


def test_scores_of_refined_poses_and_exposures_are_told_as_such():
    assert "as given" in told(0.1, 0.1, scores={"held out": {}})[-1]
    assert not pose_notes({"scores": {}}) and not exposure_notes({"scores": {}})
    trained = {"a.png": {"gain": [0.9, 1, 1]}, "b.png": {"gain": [1.1, 1, 1]}}
    found = exposure_notes({"exposures": {"trained": trained}, "scores": {"held out": {}}})
    assert "0.90 and 1.10" in found[0] and "as given" in found[1]


def test_the_table_has_a_column_for_scores_as_given_where_there_are_some():
    psnr = {"pictures": 2, "fit": 30.0, "nearest": 17.0, "blend": 18.0}
    columns, rows, caption = score_table({"compared": {"held out": {"psnr": psnr}}})
    assert columns == ["pictures", "score", "fit", "nearest", "blend"]
    assert "as given" not in caption
    columns, rows, caption = score_table(
        {"compared": {"held out": {"psnr": psnr | {"given": 20.0}}}}
    )
    assert columns[3] == "as given" and rows == [("held out", "PSNR", 30.0, 20.0, 17.0, 18.0)]
    assert "as given" in caption
