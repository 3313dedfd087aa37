"""What a plan says of itself: its worth, its knee, and one line for all of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.sampling.criteria.merit import merit
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.planner import next_views, plan
from rift_cl.sampling.targets.target import Target, half_ball

CENTER = np.array([5.0, -6.0, 7.0])
TARGET = Target(CENTER, 60.0, snr=30.0, frequencies=half_ball(6 / 60, 300))
SECTOR = {"elevation": (0, math.pi / 3), "azimuth": (-math.pi / 3, math.pi / 3)}
WIDE = CameraType("wide", 8.0, 2.8, 0.005, (1000, 1200))
LONG = CameraType("long", 35.0, 4.0, 0.005, (1000, 1200))


def test_a_plan_is_judged_at_frequencies_that_it_was_not_made_with():
    target = Target(CENTER, 60.0, band=6 / 60, snr=100.0)
    found = plan(target, 4, method="greedy")
    planned = found.objective.design.target.k
    judged = found.objective.elsewhere.design.target.k
    assert len(planned) == 4 * len(target.k)
    assert len(judged) > len(planned)
    assert not set(map(tuple, planned)) & set(map(tuple, judged))
    scored = merit(found.cameras, replace(target, frequencies=judged), weights=found.weights)
    assert found.elsewhere == pytest.approx(scored.value, rel=1e-9)
    assert found.diminishing_returns().merits[-1] == pytest.approx(found.elsewhere, rel=1e-9)
    own = plan(replace(target, frequencies=target.k), 4, method="greedy")
    assert own.elsewhere == own.merit


def test_the_verdict_and_what_it_counts_are_one():
    found = plan(TARGET, 3, Constraints(**SECTOR), method="greedy")
    own, (name, other) = found.elsewhere, next(iter(found.baselines.items()))
    for gain, words in [
        (0.2, "Planning pays (isotropic target, constrained cameras): 20.0% less stays unknown"),
        (0.04, "Planning gains little (isotropic target, constrained cameras): 4.0% less stays"),
        (0.01, "is as good (1.0% apart)"),
        (-0.01, "is as good (1.0% apart)"),
        (-0.05, "is better (5.0% apart)"),
    ]:
        compared = other._replace(elsewhere=own / (1 - gain))
        judged = replace(found, baselines={name: compared})
        assert judged.gain(compared.elsewhere) == pytest.approx(gain)
        assert words in judged.verdict()
    assert "Nothing to compare with" in replace(found, baselines={}).verdict()


@pytest.mark.full
def test_a_plan_is_written_in_one_line():
    found = plan(TARGET, 3, Constraints(distance=(100, 600)), (WIDE, LONG), method="greedy")
    assert str(found) == repr(found)
    assert repr(found).startswith(f"Plan(3 views, merit {found.merit:.4g}, cameras: ")
    assert "x 'wide'" in repr(found) or "x 'long'" in repr(found)
    assert "3 views besides 3," in repr(next_views(found, TARGET, 3, method="greedy"))


def test_gains_only_shrink_and_the_knee_is_where_they_are_little():
    found = plan(TARGET, 16, Constraints(**SECTOR))
    diminishing_returns = found.diminishing_returns(0.2)
    assert sorted(found.order) == list(range(16))
    assert len(diminishing_returns.merits) == 17
    assert diminishing_returns.merits[0] == pytest.approx(1)
    assert diminishing_returns.merits[-1] == pytest.approx(found.merit, rel=1e-9)
    assert (np.diff(diminishing_returns.gains) <= 1e-9).all()
    mean = (
        diminishing_returns.merits[0] - diminishing_returns.merits[diminishing_returns.views]
    ) / diminishing_returns.views
    assert diminishing_returns.gains[diminishing_returns.views] < 0.2 * mean
    assert found.diminishing_returns(1e-9).views is None
    with pytest.raises(InputError, match="share is 2"):
        found.diminishing_returns(2)
