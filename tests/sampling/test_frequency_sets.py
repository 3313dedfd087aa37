"""Plans are judged at frequencies that share nothing with those they were made with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import qmc

from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.criteria.merit import criterion_of_coverage
from rift_cl.sampling.planning.frequency_sets import for_choosing, for_judging, for_planning
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target, ball_of, half_disc

TARGET = Target((0, 0, 0), 60.0)


def value(step, frequencies):
    """Of twelve views on an arc, so many degrees apart."""
    turn = np.radians(step) * np.arange(12)
    observations = Observations.along(np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1))
    known = host_coverage(observations, frequencies, TARGET.diameter)
    target = replace(TARGET, frequencies=frequencies)
    return criterion_of_coverage("logdet", known, target).value


@pytest.mark.parametrize("step", [11.2, 11.25])
def test_an_arrangement_that_fits_the_lattice_gains_nothing_by_it(step):
    """At 11.25 degrees the lattice that is planned with says 5 % too much."""
    planned = for_planning(TARGET, 500)
    many = ball_of(TARGET.highest, qmc.Sobol(3, scramble=False).random_base2(17)[1:])
    right = value(step, many)
    for judging in (for_judging(TARGET, planned), for_choosing(TARGET, planned)):
        assert value(step, judging.k) == pytest.approx(right, rel=0.012)
    assert value(step, planned.k) < 1.012 * right


def test_sets_of_a_plane_and_of_a_volume_differ_and_stay_in_their_band():
    for target in (TARGET, Target.flat(60.0)):
        planned = for_planning(target, 500)
        sets = [for_judging(target, planned).k, for_choosing(target, planned).k]
        assert not np.array_equal(*sets)
        for k in sets:
            lengths = np.linalg.norm(k, axis=1)
            assert lengths.max() <= target.highest and np.median(lengths) > 0.5 * target.highest
            assert (k[:, 2] == 0).all() == target.is_flat


def test_frequencies_that_a_target_came_with_stay():
    target = replace(TARGET, frequencies=half_disc(0.1, 50))
    assert for_judging(target, target) is target
