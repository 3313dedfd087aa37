"""Appearance in directions to come: a Gaussian process' variance, and what a plan makes of it."""

from math import radians

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.reference.splat_projection import spherical_harmonics
from rift_cl.sampling.criteria.appearance import appearance_error, shown, variances
from rift_cl.sampling.planning.candidates import candidates, looked_at
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.design_space import DesignSpace, default_types
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.planner import plan
from rift_cl.sampling.planning.pool import pool_of
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

UP = np.array([[0, 0, 1.0]])
LOW = Constraints(elevation=(0.0, radians(35)), distance=4.0)


def units(count, seed):
    found = np.random.default_rng(seed).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def ball(count=12, **settings):
    normals = units(count, 1)
    return Target((0, 0, 0), 2.0, normals, normals, "surface", **settings)


def test_the_error_is_the_variance_that_is_left_where_it_is_looked_at():
    degree, views, wanted = 3, units(7, 0), units(11, 2)
    target = Target((0, 0, 0), 1.0, normals=UP, mode="surface", degree=degree, seen_from=wanted)
    error, _, _ = appearance_error(Observations.along(views), target, UP, "wiener")
    # Harmonics of variance 1, and the covariance of their coefficients given the views.
    scale = np.sqrt(4 * np.pi * np.repeat(variances(degree), [1, 3, 5, 7]))
    seen, asked = (spherical_harmonics(d, degree) * scale for d in (views, wanted))
    light = np.maximum(views[:, 2], 0)[:, None]
    left = np.linalg.inv(np.eye(16) + target.snr * seen.T @ (light * seen))
    variance = ((asked @ left) * asked).sum(1)
    weight = np.maximum(wanted[:, 2], 0)
    assert error == pytest.approx((weight * variance).sum() / weight.sum(), rel=1e-9)


def test_views_where_it_is_looked_at_help_and_those_elsewhere_do_not():
    toward = [[0.1, 0, 1], [-0.1, 0.1, 1]]
    target = Target((0, 0, 0), 1.0, normals=UP, mode="surface", degree=6, seen_from=toward)
    near, far = (
        appearance_error(Observations.along([way]), target, UP, "wiener")[0]
        for way in ([0, 0, 1.0], [1.0, 0, 0.2])
    )
    assert near < 0.2
    assert far > 0.9


def test_what_nobody_looks_at_has_no_error():
    target = Target((0, 0, 0), 1.0, normals=-UP, mode="surface", seen_from=UP)
    assert not shown(target, -UP).any()
    assert appearance_error(Observations.along(UP), target, -UP, "wiener")[0] == 0


@pytest.mark.parametrize("kind", ["wiener", "logdet", "worst"])
def test_candidates_add_up_to_the_merit_of_all_of_them(kind):
    target = looked_at(ball(degree=4), LOW)
    objective = Objective(DesignSpace(target, LOW, default_types(target)), kind)
    offered = candidates(objective, 2, 0).take(range(9))
    pool = pool_of(objective, offered)
    for index in range(8):
        pool.add(index)
    assert pool.criterion_with(8) == pytest.approx(objective.value(offered), rel=1e-9)
    merit, falls = pool.mixed(np.ones(9))
    assert merit == pytest.approx(objective.value(offered), rel=1e-9)
    # Falls are minus the derivatives by the amounts.
    more, less = (pool.mixed(np.ones(9) + h * np.eye(9)[3])[0] for h in (1e-5, -1e-5))
    assert (less - more) / 2e-5 == pytest.approx(falls[3], rel=1e-4)


def test_a_planner_looks_from_where_its_cameras_may_stand():
    target = ball(degree=6)
    asked = looked_at(target, LOW)
    elevation = np.arcsin(asked.seen_from[:, 2])
    assert elevation.min() >= 0
    assert elevation.max() <= radians(35) + 1e-9
    assert looked_at(asked, Constraints()) is asked
    everywhere = Constraints(distance=4.0)
    even = looked_at(target, everywhere).seen_from
    np.testing.assert_allclose(even.T @ even / len(even), np.eye(3) / 3, atol=0.01)


@pytest.mark.full
def test_a_plan_for_where_it_is_looked_at_knows_more_there():
    target = ball(degree=6)
    asked = looked_at(target, LOW)
    everywhere = looked_at(target, Constraints(distance=4.0))
    ours, theirs = (plan(told, 12, LOW, method="greedy") for told in (target, everywhere))
    there = Objective(DesignSpace(asked, LOW, default_types(asked)))
    assert there.value(ours.view_table) < 0.995 * there.value(theirs.view_table)


def test_directions_that_are_none_are_refused():
    with pytest.raises(InputError, match=r"seen_from\[1\]"):
        ball(seen_from=[[0, 0, 1], [0, 0, 0]])
    with pytest.raises(ShapeError, match="seen_from has shape"):
        ball(seen_from=[0, 0, 1])
