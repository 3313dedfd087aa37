"""What a dry run of a fit tries, and the time that it makes of it; the clock is ours."""

from __future__ import annotations

import itertools

import pytest

from rift_cl.commands.fit.probe import Probe, probed, time_words
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings


def trainer_of(capture, out, **more):
    job = Fit(FitPhotosSettings.of(capture, out, steps=600, splats=200, **more))
    return job._trainer(job.source, job._pictures(job.training_views))


@pytest.mark.full
def test_steps_are_tried_as_at_the_beginning_and_as_at_the_end(capture, tmp_path):
    trainer = trainer_of(capture, tmp_path / "fit", first_splats=0.25)
    first, reading = len(trainer.parameters), itertools.count()
    probe = probed(trainer, 200, clock=lambda: float(next(reading)))
    assert probe.counts == (first, 200) and first < 200
    # A clock that counts how often it is read: between two readings passes one second.
    assert probe.seconds == (1.0, 1.0)
    assert 0 < probe.entries < 50


def test_time_grows_evenly_between_both_and_beyond():
    probe = Probe((100, 300), (0.1, 0.3), 2.0)
    assert [probe.step(n) for n in (100, 200, 300, 500)] == pytest.approx([0.1, 0.2, 0.3, 0.5])
    assert probe.steps([(10, 100), (20, 300)]) == pytest.approx(7.0)
    # Many splats that were noisily quicker than few are not taken to be quicker still.
    assert Probe((100, 300), (0.3, 0.1), 2.0).step(1000) == 0.3
    assert Probe((300, 300), (0.2, 0.2), 2.0).step(600) == pytest.approx(0.4)


@pytest.mark.full
@pytest.mark.parametrize(
    "more",
    [{"basis": "hermite", "order": 2}, {"angular": "sg", "modes": 2}, {"strategy": "default"}],
    ids=["modes", "lobes", "default"],
)
def test_what_joins_late_is_tried_too(capture, tmp_path, more):
    trainer = trainer_of(capture, tmp_path / "fit", **more)
    before = trainer.state()
    assert probed(trainer, 200).seconds[1] > 0
    assert trainer.state().keys() == before.keys()


def test_times_are_said_in_two_figures():
    told = [time_words(seconds).split(",")[0] for seconds in (0.123, 4.56, 98.7, 1234.0)]
    assert told == ["about 0.12 s", "about 4.6 s", "about 99 s", "about 1200 s"]


@pytest.mark.full
def test_a_dry_run_leaves_the_fit_as_it_would_be(capture, tmp_path):
    scenes = []
    for name in ("tried", "not"):
        job = Fit(FitPhotosSettings.of(capture, tmp_path / name, steps=12, splats=100, hold_out=4))
        if name == "tried":
            plan = job.plan()
            assert "MiB of tile lists" in plan["device memory"]
            assert plan["time"].startswith("about ") and "give or take" in plan["time"]
            assert not (tmp_path / name).exists()
        list(job.run())
        scenes.append((tmp_path / name / "scene.ply").read_bytes())
    assert scenes[0] == scenes[1]
