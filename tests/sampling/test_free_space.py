"""What pictures show to be free, what lies behind surfaces, and whence a target is seen."""

import numpy as np
import pytest
from walls import WALL, arc, depth_of_ball, looking, points_before_a_wall

from rift_cl.errors import InputError, ShapeError
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.keep_out import KeepOut
from rift_cl.sampling.planning.out_of_sight import out_of_sight
from rift_cl.sampling.planning.planner import next_views
from rift_cl.sampling.targets.free_space import (
    BEHIND,
    FREE,
    UNSEEN,
    DepthMap,
    FreeSpace,
    depth_of_points,
)
from rift_cl.sampling.targets.prior import directions_for
from rift_cl.sampling.targets.target import Target

ORIGIN = np.zeros(3)


def walled(kind):
    """The space before a wall, known by depth or by sparse points."""
    if kind == "depth":
        return FreeSpace([DepthMap(c, depth_of_ball(c, behind=None)) for c in arc()])
    points = points_before_a_wall()
    return FreeSpace([depth_of_points(camera, points) for camera in arc()])


def all_round(distance):
    """Places evenly all round the origin."""
    half = directions_for(3, 300)
    return distance * np.concatenate([half, -half])


@pytest.mark.parametrize("kind", ["depth", "points"])
def test_space_is_free_before_a_wall_and_not_behind_it(kind):
    space = walled(kind)
    points = [(1, 0, 0.3), (0.8, 0.8, 0), (0, 0, 0), (-1.5, 0, 0), (-3, 0.5, 0.5), (9, 0, 9)]
    assert space.judged(points).tolist() == [FREE, FREE, BEHIND, BEHIND, BEHIND, UNSEEN]
    # The wall goes on beyond the border of all pictures.
    assert space.judged([(-2, 6, 0)])[0] == BEHIND


@pytest.mark.parametrize("kind", ["depth", "points"])
def test_a_target_before_a_wall_is_seen_from_before_it_alone(kind):
    space = walled(kind)
    places = all_round(4.0)
    sight = space.in_sight(places, ORIGIN, 0.7)
    before = places[:, 0] + WALL
    assert not sight[before < -0.1].any()
    assert sight[before > 1.5].min() > 0.9
    np.testing.assert_array_equal(space.scaled(10).in_sight(10 * places, ORIGIN, 7.0), sight)


def test_a_ball_in_the_open_is_seen_from_all_sides_though_its_back_never_was():
    space = FreeSpace([DepthMap(c, depth_of_ball(c)) for c in arc(9, 80)])
    assert space.in_sight(all_round(4.0), ORIGIN, 0.6).min() == 1
    # Within its ball nobody stands, and a pillar before it hides it.
    assert space.in_sight([(0.1, 0, 0)], ORIGIN, 0.6)[0] == 0
    pillar = [DepthMap(c, np.full((6, 6), 0.5)) for c in arc(9, 20)]
    assert FreeSpace(pillar).in_sight([(4, 0, 1)], ORIGIN, 0.6)[0] == 0


@pytest.mark.full
def test_further_views_of_an_opaque_target_stand_before_the_wall():
    space, taken = walled("points"), arc(3, 10)
    ways = all_round(1.0)
    target = Target(ORIGIN, 1.0, 0.5 * ways[::60], ways[::60], "surface", degree=4)
    shape = out_of_sight(space, ORIGIN, 0.5, 4.0, 4.0)
    distance = 4 * 1.05
    free = Constraints(distance=distance, elevation=(0, 1.3))
    closed = Constraints(distance=distance, elevation=(0, 1.3), keepouts=(KeepOut(shape),))
    without, found = (
        next_views(taken, target, 4, limits, compare=False) for limits in (free, closed)
    )
    before = [np.array([c.center[0] + WALL for c in plan.cameras]) for plan in (without, found)]
    assert before[0].min() < -0.5
    assert before[1].min() > 0
    sight = space.in_sight([camera.center for camera in found.cameras], ORIGIN, 0.5)
    assert sight.min() > 0.5


@pytest.mark.full
def test_the_distance_from_what_is_shut_has_its_gradient():
    shape = out_of_sight(walled("depth"), ORIGIN, 0.5, 3.0, 5.0)
    places = all_round(4.1)[:40]
    distance, slope = shape.distance(places)
    assert (distance > 0).any() and (distance < 0).any()
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        rate = (shape.distance(places + step)[0] - shape.distance(places - step)[0]) / 2e-6
        np.testing.assert_allclose(slope[:, axis], rate, atol=1e-5)


def test_what_makes_no_sense_is_refused():
    camera = looking((3, 0, 0))
    with pytest.raises(ShapeError, match="depth has shape"):
        DepthMap(camera, np.ones(3))
    with pytest.raises(InputError, match="zero or less"):
        DepthMap(camera, np.zeros((2, 2)))
    with pytest.raises(InputError, match="map of depth"):
        FreeSpace([])
    near = FreeSpace([DepthMap(c, np.full((2, 2), 0.1)) for c in arc()])
    with pytest.raises(InputError, match="no place"):
        out_of_sight(near, ORIGIN, 0.5, 4.0, 4.0)
    with pytest.raises(InputError, match="no surface"):
        KeepOut(out_of_sight(walled("depth"), ORIGIN, 0.5, 4.0, 4.0), hides=True)
    assert depth_of_points(camera, np.array([[9.0, 9, 9]])) is None
