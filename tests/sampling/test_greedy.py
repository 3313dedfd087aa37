"""Greedy choice: the best step each time, never far from the best of all, never below the bound."""

import itertools
import math

import numpy as np
import pytest

from rift_cl.sampling.planning.candidates import candidates, spread
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.design_space import DesignSpace, default_types
from rift_cl.sampling.planning.greedy import Limits, bound, choose
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.pool import pool_of
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import directions_for
from rift_cl.sampling.targets.target import Target, half_ball

VOLUME = Target((0, 0, 0), 10.0, snr=30.0, frequencies=half_ball(0.5, 120))
NORMALS = directions_for(3, 7)
SURFACE = Target((0, 0, 0), 10.0, 5 * NORMALS, NORMALS, "surface", snr=30.0, band=0.5)


def pool(target=VOLUME, kind="wiener", count=9, fixed=False):
    design = DesignSpace(target, Constraints(), default_types(target))
    objective = Objective(design, kind)
    offered = candidates(objective, 4, 0)
    offered = offered.take(range(0, len(offered), len(offered) // count))
    if fixed:
        seen = Observations.of(offered.take([0, 3]).cameras(design), target.points)
        objective = Objective(design, kind, seen)
    return pool_of(objective, offered), objective, offered


def free(views, count):
    return Limits(views, np.zeros(count), math.inf)


@pytest.mark.parametrize("target", [VOLUME, SURFACE], ids=["volume", "surface"])
@pytest.mark.parametrize("kind", ["wiener", "logdet", "worst"])
@pytest.mark.parametrize("fixed", [False, True])
def test_a_pool_has_the_merit_of_the_views_chosen_from_it(target, kind, fixed):
    offers, objective, offered = pool(target, kind, fixed=fixed)
    chosen = []
    for index in (4, 1, 7):
        expected = objective.value(offered.take([*chosen, index]))
        assert offers.criterion_with(index) == pytest.approx(expected, rel=1e-9)
        gain = objective.value(offered.take(chosen)) - expected if chosen else 0
        assert gain <= offers.ceilings()[index] + 1e-12
        offers.add(index)
        chosen.append(index)
    amounts = np.bincount(chosen, minlength=len(offers)).astype(float)
    value, falls = offers.mixed(amounts)
    assert value == pytest.approx(expected, rel=1e-9)
    # From halves, so that there is room on both sides.
    _, falls = offers.mixed(amounts + 0.5)
    for index in (0, 5):
        step = np.zeros(len(offers))
        step[index] = 1e-5
        ends = [offers.mixed(amounts + 0.5 + sign * step)[0] for sign in (1, -1)]
        assert falls[index] == pytest.approx((ends[1] - ends[0]) / 2e-5, rel=1e-5)
    offers.clear()
    assert offers.criterion_with(4) == pytest.approx(objective.value(offered.take([4])), rel=1e-9)


@pytest.mark.parametrize("kind", ["wiener", "logdet"])
def test_every_choice_is_the_one_that_helps_most(kind):
    offers, objective, offered = pool(kind=kind, count=20)
    found = choose(offers, free(5, len(offered)))
    for step, index in enumerate(found.order):
        before = found.order[:step]
        merits = [objective.value(offered.take([*before, i])) for i in range(len(offered))]
        assert merits[index] == pytest.approx(min(merits), rel=1e-12)
        assert found.merits[step + 1] == pytest.approx(merits[index], rel=1e-9)


def test_the_bound_lies_below_every_choice_and_not_far_below_the_best():
    offers, objective, offered = pool(count=8)
    merits = [
        objective.value(offered.take(chosen))
        for chosen in itertools.combinations_with_replacement(range(len(offered)), 4)
    ]
    limits = free(4, len(offered))
    greedy = choose(offers, limits)
    least = bound(offers, limits, greedy.order)
    assert least <= min(merits) + 1e-12
    assert greedy.merits[-1] <= 1.05 * min(merits)
    assert least > 0.8 * min(merits)


def test_what_a_budget_buys_is_chosen_by_gain_for_its_cost():
    offers, objective, offered = pool(count=8)
    costs = np.where(np.arange(len(offered)) % 2, 1.0, 5.0)
    limits = Limits(10, costs, 6.0)
    found = choose(offers, limits)
    assert costs[found.order].sum() <= 6
    merits = [
        objective.value(offered.take(chosen))
        for size in range(1, 7)
        for chosen in itertools.combinations_with_replacement(range(len(offered)), size)
        if costs[list(chosen)].sum() <= 6
    ]
    assert found.merits[-1] <= 1.05 * min(merits)
    assert bound(offers, limits, found.order) <= min(merits) + 1e-12


def test_a_candidate_is_chosen_once_where_that_is_asked():
    offers, _, offered = pool(count=6)
    found = choose(offers, free(10, len(offered)), again=False)
    assert sorted(found.order) == list(range(len(offered)))


def test_directions_are_spread_evenly_over_what_is_allowed():
    limits = Constraints(elevation=(0.2, 1.2), azimuth=(-1, 2))
    design = DesignSpace(VOLUME, limits, default_types(VOLUME))
    angles = spread(design.constraints, 900, 3)
    heights = np.sin(angles[:, 1])
    cells, _, _ = np.histogram2d(
        angles[:, 0], heights, (6, 5), range=((-1, 2), (np.sin(0.2), np.sin(1.2)))
    )
    assert cells.sum() == 900
    assert cells.min() > 24
    assert cells.max() < 36


def test_no_two_directions_in_the_plane_lie_opposite_each_other():
    design = DesignSpace(VOLUME, Constraints(elevation=(0, 0)), default_types(VOLUME))
    for count in (480, 481):
        lines = np.sort(spread(design.constraints, count, 0)[:, 0] % math.pi)
        gaps = np.diff(lines, append=lines[0] + math.pi)
        assert gaps.min() > 0.9 * math.pi / count - 1e-3
        assert len(ViewTable(np.zeros(count, int), np.zeros((count, 7)))) == count
