"""What a fit that goes on keeps of the one that it goes on with: sizes and poses."""

from __future__ import annotations

import pytest
from test_fit_resume import VARIANTS, broken_off, digest, run, settings

from rift_cl.commands.fit_photos.job import Fit
from rift_cl.errors import CheckpointError


@pytest.mark.full
def test_the_size_that_was_decided_is_that_of_what_goes_on(capture, tmp_path, monkeypatch):
    """Another device would decide otherwise, and fits of old began without a choice."""
    small = {True: 400, False: 400}
    monkeypatch.setattr("rift_cl.commands.fit_photos.photograph_size.MOST_PIXELS", small)
    whole, cut, asked = (tmp_path / name for name in ("whole", "cut", "asked"))
    job, _ = run(settings(capture, whole, steps=75))
    broken_off(settings(capture, cut, steps=75), 25)
    broken_off(settings(capture, asked, steps=75, downscale=1), 25)
    monkeypatch.undo()
    other = Fit(settings(capture, cut, steps=75, resume=True))
    assert other.downscale == job.downscale > 1
    list(other.run())
    assert digest(cut) == digest(whole)
    assert Fit(settings(capture, asked, steps=75, resume=True)).downscale == 1
    with pytest.raises(CheckpointError, match=r"downscale 1.*2"):
        Fit(settings(capture, asked, steps=75, resume=True, downscale=2))


@pytest.mark.full
def test_what_goes_on_begins_with_the_poses_that_were_refined(capture, tmp_path):
    out = tmp_path / "fit"
    run(settings(capture, out, steps=50, **VARIANTS["default"]))
    before = (out / "transforms.json").read_bytes()
    job = Fit(settings(capture, out, steps=75, resume=True, **VARIANTS["default"]))
    next(report for report in job.run() if report.what == "steps")
    assert (out / "transforms.json").read_bytes() == before
