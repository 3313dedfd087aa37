"""Where cameras may not stand: distances and their gradients are right, lines of sight stop."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rift_cl.errors import InputError
from rift_cl.sampling.planning.keep_out import Box, Cone, KeepOut, Sphere

SHAPES = {
    "sphere": Sphere((1, 2, 3), 2.0),
    "box": Box((-1, -2, 0), (2, 1, 4)),
    "cone": Cone((0, 0, 1), (1, 1, 2), 0.5),
    "floor": Box((-math.inf, -math.inf, -math.inf), (math.inf, math.inf, -1)),
}


def inside(shape, points):
    """By definition."""
    if isinstance(shape, Sphere):
        return np.linalg.norm(points - np.array(shape.center), axis=1) < shape.radius
    if isinstance(shape, Box):
        return ((points > shape.low) & (points < shape.high)).all(1)
    away = points - np.array(shape.apex)
    cosine = away @ np.array(shape.axis) / np.linalg.norm(away, axis=1)
    return cosine > math.cos(shape.half_angle)


@pytest.mark.parametrize("name", SHAPES)
def test_distance_is_negative_inside_and_the_way_to_the_nearest_point_of_the_surface(name):
    shape, points = SHAPES[name], np.random.default_rng(0).uniform(-6, 6, (400, 3))
    distance, slope = shape.distance(points)
    np.testing.assert_array_equal(distance < 0, inside(shape, points))
    outside = distance > 1e-6
    # The gradient leads straight away from the surface: a step back of that length meets it.
    np.testing.assert_allclose(np.linalg.norm(slope, axis=1), 1, rtol=1e-9)
    foot = points[outside] - distance[outside, None] * slope[outside]
    np.testing.assert_allclose(shape.distance(foot)[0], 0, atol=1e-9)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("hides", [False, True])
def test_clearance_has_the_gradient_of_finite_differences(name, hides):
    keepout = KeepOut(SHAPES[name], hides)
    random, center = np.random.default_rng(1), np.array([-3.0, 4.0, 5.0])
    points = random.uniform(-8, 8, (200, 3))
    distance, slope = keepout.clearance(points, center)
    for axis in range(3):
        step = np.eye(3)[axis] * 1e-6
        ends = [keepout.clearance(points + sign * step, center)[0] for sign in (1, -1)]
        rate = (ends[0] - ends[1]) / 2e-6
        # But for edges, where the nearest point jumps. Inside there are more: nobody starts there.
        right = np.abs(rate - slope[:, axis]) < 2e-3
        assert np.mean(right[distance > 0]) > 0.99
        assert hides or np.mean(right) > 0.97
    assert (distance <= SHAPES[name].distance(points)[0] + 1e-9).all()


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_a_body_hides_the_target_where_a_point_of_the_line_of_sight_lies_in_it(seed):
    random = np.random.default_rng(seed)
    place, center = random.uniform(-9, 9, (2, 3))
    share = np.linspace(0, 1, 2001)[:, None]
    for shape in SHAPES.values():
        clearance, _ = KeepOut(shape, hides=True).clearance(place[None], center)
        along = shape.distance(place + share * (center - place))[0].min()
        assert clearance[0] == pytest.approx(along, abs=0.01)
        assert clearance[0] <= along + 1e-9


@pytest.mark.full
@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_beside_a_body_a_ball_about_the_target_is_seen_whole(seed):
    """By the narrowest place of the cone from the camera to the ball; slopes by differences."""
    random = np.random.default_rng(seed)
    place, center, way = random.uniform(-9, 9, (3, 3))
    share = np.linspace(0, 1, 2001)[:, None]
    for shape in SHAPES.values():
        body = KeepOut(shape, hides=True)
        free = max(float(shape.distance(center[None])[0][0]), 0.0)
        for radius in (1.0, 50.0):
            clearance, slope = body.clearance(place[None], center, radius)
            along = shape.distance(place + share * (center - place))[0]
            least = (along - min(radius, free) * share[:, 0]).min()
            assert clearance[0] == pytest.approx(least, abs=0.01)
            assert clearance[0] <= least + 1e-9
        here, slope = body.clearance(place[None], center, 1.0)
        ends = [body.clearance((place + h * way)[None], center, 1.0)[0][0] for h in (1e-6, -1e-6)]
        rise, fall = (ends[0] - here[0]) / 1e-6, (here[0] - ends[1]) / 1e-6
        # But for edges, where the nearest place jumps; of lines through the body nobody asks.
        if here[0] > 1e-3 and abs(rise - fall) < 1e-4:
            assert slope[0] @ way == pytest.approx(rise, abs=1e-3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere((0, 0), 1), "Sphere: center"),
        (lambda: Sphere((0, 0, math.nan), 1), "Sphere: center"),
        (lambda: Sphere((0, 0, 0), -1), "radius is -1"),
        (lambda: Box((0, 0, 0), (1, 0, 1)), "is empty"),
        (lambda: Box((0, 0, "a"), (1, 1, 1)), "Box: low"),
        (lambda: Cone((0, 0, 0), (0, 0, 0), 0.3), "axis is zero"),
        (lambda: Cone((0, 0, 0), (0, 0, 1), 30), "half_angle is 30"),
        (lambda: KeepOut("wall"), "shape is 'wall'"),
    ],
)
def test_what_is_no_shape_is_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
