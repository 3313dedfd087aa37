"""Paths: rings are round, splines smooth, views evenly spaced, limits kept."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.sampling.planning.baselines import baselines
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.curves import curves_of
from rift_cl.sampling.planning.design_space import DesignSpace, default_types
from rift_cl.sampling.planning.keep_out import Cone, KeepOut, Sphere
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.path_layout import PathLayout
from rift_cl.sampling.planning.paths import Free, Ring, Spline, TiltedRings
from rift_cl.sampling.planning.planner import plan
from rift_cl.sampling.planning.refine import permitted
from rift_cl.sampling.targets.target import Target, half_ball

TARGET = Target((0, 0, 0), 10.0, snr=30.0, frequencies=half_ball(0.6, 200))
SECTOR = {"elevation": (0.1, 1.0), "azimuth": (-1.0, 1.0)}
PATHS = {
    "ring": Constraints(path=Ring()),
    "arc": Constraints(path=Ring(), **SECTOR),
    "two rings": Constraints(path=TiltedRings(2), elevation=(-0.3, 0.9)),
    "three rings": Constraints(path=TiltedRings(3)),
    "below a pole": Constraints(path=TiltedRings(2), elevation=(0.2, math.pi / 2)),
    "closed": Constraints(path=Spline(6, closed=True), **SECTOR),
    "open": Constraints(path=Spline(6, closed=False), **SECTOR),
    "round": Constraints(path=Spline(6), elevation=(-0.2, 0.8)),
}


def steps(directions, closed):
    """Angles from each direction to the next."""
    ahead = np.roll(directions, -1, axis=0)
    products = (directions * ahead).sum(1)[: None if closed else -1]
    return np.arccos(np.clip(products, -1, 1))


@pytest.mark.parametrize("name", PATHS)
def test_whatever_the_numbers_a_path_keeps_to_its_limits(name):
    limits = PATHS[name]
    design = DesignSpace(TARGET, limits, default_types(TARGET))
    for index, curve in enumerate(curves_of(limits)):
        random = np.random.default_rng(index)
        drawn = random.uniform(curve.low, curve.high, (30, len(curve.low)))
        for numbers in [*drawn, *curve.starts]:
            layout = PathLayout(design, curve, 0, 11, np.append(numbers, np.zeros(4)))
            assert permitted(design, layout.view_table(layout.start))


@pytest.mark.parametrize("name", PATHS)
def test_a_path_is_planned_and_moved_to_advantage(name):
    limits = PATHS[name]
    found = plan(TARGET, 9, limits)
    first = plan(TARGET, 9, limits, method="greedy")
    assert len(found) == 9
    assert permitted(found.objective.design, found.view_table)
    assert found.merit <= first.merit
    assert found.bound <= found.merit
    assert "random" not in found.baselines


def test_a_ring_is_level_and_even_and_an_arc_ends_at_its_limits():
    ring = plan(TARGET, 9, PATHS["ring"])
    assert np.ptp(ring.elevation) < 1e-9
    gaps = np.diff(np.sort(ring.azimuth % (2 * math.pi)))
    np.testing.assert_allclose(gaps, 2 * math.pi / 9, atol=1e-9)
    arc = plan(TARGET, 9, PATHS["arc"])
    np.testing.assert_allclose(arc.azimuth, np.linspace(-1, 1, 9), atol=1e-9)
    assert np.ptp(arc.elevation) < 1e-9


@pytest.mark.parametrize("path", [Free(), Ring(), Spline(6)])
def test_what_a_path_is_compared_with_has_no_gap_where_a_keep_out_is(path):
    near = DesignSpace(TARGET, Constraints(), default_types(TARGET)).limits[0, 2, 0]
    limits = Constraints(path=path, keepouts=(KeepOut(Sphere((near, 0, 0), 0.6 * near)),))
    design = DesignSpace(TARGET, limits, default_types(TARGET))
    found = baselines(Objective(design), 9)
    for baseline in found.values():
        assert permitted(design, baseline.view_table)
    ring = found["ring"]
    azimuth = np.sort(ring.view_table.table[:, 0] % (2 * math.pi))
    widest = np.diff([*azimuth, azimuth[0] + 2 * math.pi]).max()
    whole = widest < 1.02 * 2 * math.pi / 9
    assert whole == (not isinstance(path, Free))
    assert ring.described.endswith("with a gap") != whole


def test_a_whole_ring_steps_over_a_small_keep_out():
    near = DesignSpace(TARGET, Constraints(), default_types(TARGET)).limits[0, 2, 0]
    first = near * np.array([math.cos(math.pi / 9), math.sin(math.pi / 9), 0])
    ball = KeepOut(Sphere(tuple(first), 0.1 * near))
    limits = Constraints(path=Ring(), elevation=(0, 0), keepouts=(ball,))
    design = DesignSpace(TARGET, limits, default_types(TARGET))
    view_table = baselines(Objective(design), 9)["ring"].view_table
    assert permitted(design, view_table)
    np.testing.assert_allclose(np.diff(np.unwrap(view_table.table[:, 0])), 2 * math.pi / 9)


@pytest.mark.full
def test_tilted_rings_are_circles_with_axes_of_their_own():
    found = plan(TARGET, 12, PATHS["three rings"])
    axes = []
    for index in range(3):
        ring = found.directions[4 * index : 4 * index + 4]
        _, spread, rows = np.linalg.svd(ring - ring.mean(0))
        # Four points evenly on a circle lie in a plane.
        assert spread[2] < 1e-9
        np.testing.assert_allclose(np.ptp(steps(ring, closed=True)), 0, atol=1e-9)
        axes.append(rows[2])
    assert np.abs(np.array(axes) @ np.array(axes).T - np.eye(3)).max() < 0.999


@pytest.mark.parametrize("closed", [True, False])
def test_views_along_a_spline_are_evenly_spaced(closed):
    limits = Constraints(path=Spline(6, closed), **SECTOR)
    (curve,) = curves_of(limits)
    for start in curve.starts:
        if np.ptp(start.reshape(3, 6)[:2], axis=1).min() == 0:
            continue
        rows = curve.angles(start, 200)
        level = np.cos(rows[:, 1])
        units = np.stack(
            [level * np.cos(rows[:, 0]), level * np.sin(rows[:, 0]), np.sin(rows[:, 1])], axis=1
        )
        found = steps(units, closed)
        # But where it turns sharply the chord is shorter than the way.
        assert np.median(np.abs(found / np.median(found) - 1)) < 0.01
        assert found.max() < 1.1 * np.median(found)


@pytest.mark.parametrize("name", PATHS)
def test_a_path_has_derivatives_as_finite_differences_have(name):
    limits = PATHS[name]
    design = DesignSpace(TARGET, limits, default_types(TARGET))
    objective, curve = Objective(design), curves_of(limits)[-1]
    random = np.random.default_rng(3)
    numbers = curve.low + (curve.high - curve.low) * random.uniform(0.2, 0.8, len(curve.low))
    layout = PathLayout(design, curve, 0, 7, np.append(numbers, np.zeros(4)))
    at = layout.start
    _, by_table = objective.gradient(layout.view_table(at))
    slope = layout.pulled_back(at, by_table[None])[0]
    for index in range(len(at)):
        step = np.eye(len(at))[index] * 1e-5
        ends = [objective.value(layout.view_table(at + sign * step)) for sign in (1, -1)]
        rate = (ends[0] - ends[1]) / 2e-5
        assert slope[index] == pytest.approx(rate, rel=0.02, abs=2e-3 * np.abs(slope).max())


@pytest.mark.full
def test_a_path_goes_round_keep_outs_or_says_that_none_does():
    near = DesignSpace(TARGET, Constraints(), default_types(TARGET)).limits[0, 2, 0]
    ball = KeepOut(Sphere((near, 0, 0), 0.3 * near))
    found = plan(TARGET, 9, Constraints(path=Spline(6), keepouts=(ball,)))
    assert permitted(found.objective.design, found.view_table)
    wall = KeepOut(Cone((0, 0, 0), (1, 0, 0), 1.5))
    with pytest.raises(InputError, match=r"Ring.*keepouts\[0\]"):
        plan(TARGET, 9, Constraints(path=Ring(), elevation=(-0.5, 0.5), keepouts=(wall,)))


@pytest.mark.full
def test_a_spline_finds_its_way_beside_a_wall_that_cuts_every_full_turn():
    wall = KeepOut(Cone((0, 0, 0), (1, 0, 0), 1.3))
    limits = Constraints(elevation=(0, 0.6), keepouts=(wall,))
    found = plan(TARGET, 12, replace(limits, path=Spline(6)))
    assert permitted(found.objective.design, found.view_table)
    with pytest.raises(InputError, match="no path Ring"):
        plan(TARGET, 12, replace(limits, path=Ring()))


@pytest.mark.full
@pytest.mark.parametrize("limits", [Constraints(elevation=(0, 1.3)), Constraints(**SECTOR)])
def test_a_spline_is_as_good_as_the_best_arc(limits):
    target = Target((0, 0, 0), 10.0, snr=1000.0, frequencies=half_ball(1.6, 600))
    found = plan(target, 16, replace(limits, path=Spline(6)))
    # But for views that stand half a step inside the ends of half a turn.
    assert found.merit <= 1.02 * found.baselines["arc"].merit


def test_free_views_follow_no_curve():
    with pytest.raises(TypeError, match="no curve"):
        curves_of(Constraints(path=Free()))
