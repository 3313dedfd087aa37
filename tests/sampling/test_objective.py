"""The merit of a table of views: the same as of the cameras it stands for, with its derivatives."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from rift_cl.geometry.camera_type import CameraType
from rift_cl.sampling.criteria.merit import merit
from rift_cl.sampling.planning.constraints import Constraints, Ranges
from rift_cl.sampling.planning.design_space import COLUMNS, DesignSpace
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target, half_ball

WIDE = CameraType("wide", 8.0, 4.0, 0.01, (300, 400))
LONG = CameraType("long", 50.0, 8.0, 0.01, (300, 300), pupil_magnification=0.8)
CORNERS = np.array([[0, 0, 0], [3, -2, 4], [-5, 1, 2]], float)


def design(points=CORNERS, **limits):
    target = Target(
        (10.0, -20.0, 5.0),
        30.0,
        points=CORNERS * 0 + [10, -20, 5] + points,
        frequencies=half_ball(0.4, 150),
    )
    ranges = {"long": Ranges((40, 60), (4, 16), (-6, 9), (0.5, 2))}
    return DesignSpace(
        target, Constraints(distance=(50, 900), ranges=ranges, **limits), (WIDE, LONG)
    )


def some(design, count=6, seed=0):
    random = np.random.default_rng(seed)
    kind = np.arange(count) % 2
    share = random.uniform(0.05, 0.95, (count, COLUMNS))
    low, high = np.moveaxis(design.limits[kind], 2, 0)
    return ViewTable(kind, low + share * (high - low))


@pytest.mark.parametrize("up", [(0, 0, 1), (1, -2, 0.5)])
def test_a_table_is_seen_as_the_cameras_it_stands_for(up):
    place = design(up=up)
    views = some(place)
    objective = Objective(place)
    observations = objective.observations(views)
    weights = observations.weight.max(1)
    cameras = views.cameras(place)
    expected = Observations.of(cameras, place.target.points, weights)
    for name, values in vars(expected).items():
        found = getattr(observations, name)
        np.testing.assert_allclose(found, values, rtol=1e-9, atol=1e-12, err_msg=name)
    # Photons per area of the target, which does not lie in the plane in focus.
    focus = np.array([camera.aperture.focus for camera in cameras])
    kinds = views.camera_types(place)
    light = [kind.object_photons(plane) for kind, plane in zip(kinds, focus, strict=True)]
    light = light * (focus / views.table[:, 2]) ** 2
    np.testing.assert_allclose(weights, light / place.brightness)


@pytest.mark.parametrize("kind", ["wiener", "logdet", "worst"])
def test_derivatives_are_those_of_finite_differences(kind):
    place = design()
    views = some(place)
    objective = Objective(
        place, kind, Observations.of(some(place, 2, 5).cameras(place), place.target.points)
    )
    value, gradient = objective.gradient(views)
    assert value == pytest.approx(objective.value(views))
    for row, column in np.ndindex(gradient.shape):
        step = 1e-6 * max(1.0, abs(views.table[row, column]))
        ends = []
        for sign in (1, -1):
            moved = views.table.copy()
            moved[row, column] += sign * step
            ends.append(objective.value(ViewTable(views.kind, moved)))
        slope = (ends[0] - ends[1]) / (2 * step)
        assert gradient[row, column] == pytest.approx(slope, rel=2e-4, abs=2e-9 / step * 1e-6)


def test_a_surface_has_derivatives_as_well():
    place = design()
    target = replace(place.target, mode="surface", normals=np.eye(3))
    place = replace(place, target=target)
    views = some(place, 4)
    objective = Objective(
        place, fixed=Observations.of(some(place, 2, 5).cameras(place), target.points)
    )
    _, gradient = objective.gradient(views)
    for row, column in itertools.product(range(4), (0, 1, 2, 3)):
        step = 1e-6 * max(1.0, abs(views.table[row, column]))
        ends = []
        for sign in (1, -1):
            moved = views.table.copy()
            moved[row, column] += sign * step
            ends.append(objective.value(ViewTable(views.kind, moved)))
        slope = (ends[0] - ends[1]) / (2 * step)
        assert gradient[row, column] == pytest.approx(slope, rel=1e-3, abs=1e-8)


def test_it_is_the_merit_of_the_cameras():
    place = design()
    views, objective = some(place), Objective(place)
    weights = objective.observations(views).weight.max(1)
    expected = merit(views.cameras(place), place.target, weights=weights)
    assert objective.value(views) == pytest.approx(expected.value, rel=1e-9)


def test_cameras_are_read_back():
    place = design()
    views = some(place)
    cameras, types = views.cameras(place), views.camera_types(place)
    again = ViewTable.of(cameras, types, views.kind, place)
    np.testing.assert_allclose(again.table, views.table, rtol=1e-9, atol=1e-9)
    for first, second in zip(cameras, again.cameras(place), strict=True):
        np.testing.assert_allclose(first.view, second.view, atol=1e-9)


def test_cameras_at_the_poles_have_an_upright_position_and_look_at_the_centre():
    place = design()
    table = np.tile(some(place).table[1], (5, 1))
    table[:, 0] = np.linspace(-3, 3, 5)
    table[:, 1] = [math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-12, 1.5, -1.5]
    for camera in ViewTable(np.ones(5, int), table).cameras(place):
        sight = camera.view[:3, :3] @ (place.target.center - camera.center)
        np.testing.assert_allclose(sight / sight[2], [0, 0, 1], atol=1e-9)
        # Up in the world is up in the picture, whose rows go down, or the camera is at a pole.
        assert camera.view[1, 2] <= 1e-9
