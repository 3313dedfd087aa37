"""Orbits, paths from pose to pose, and where a scene lies."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import capture_files as made
import numpy as np
import pytest
from test_start import MIDDLE_OF_RING, ring

from rift_cl.commands.cameras.camera_path import (
    in_film_order,
    orbit,
    orbit_distance,
    pinhole,
    resized,
    smooth_path,
)
from rift_cl.commands.inputs.scene_bounds import (
    SceneBounds,
    bounds_of_cameras,
    bounds_of_splats,
    weighted_quantile,
)
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.geometry.pose import look_at
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.scenes.splat_scene import SplatScene


def test_a_film_of_a_colmap_model_counts_the_numbers_in_names(tmp_path):
    """A fit holds photographs out by plain names, as published splits do."""
    names = ["frame10.png", "frame007.png", "frame2.png"]
    made.photographs(tmp_path / "images", names)
    images = made.colmap_text(tmp_path / "sparse" / "0") / "images.txt"
    lines = images.read_text()
    for before, name in zip(made.NAMES, names, strict=True):
        lines = lines.replace(f" {before}", f" {name}")
    images.write_text(lines)
    capture = open_capture(tmp_path)
    assert [view.name for view in capture.views] == sorted(names)
    found = [view.name for view in in_film_order(capture)]
    assert found == ["frame2.png", "frame007.png", "frame10.png"]


def test_a_film_of_a_transforms_json_keeps_its_order(tmp_path):
    file = made.transforms(tmp_path)
    record = json.loads(file.read_text())
    file.write_text(json.dumps(record | {"frames": record["frames"][::-1]}))
    found = [view.name for view in in_film_order(open_capture(file))]
    assert found == ["images/sub/c.png", "images/b.png", "images/a.png"]


BOUNDS = SceneBounds(np.array([1.0, -2, 3]), 0.7, np.array([0, 0.6, 0.8]))


def pixels(camera, points):
    local = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return local[:, :2] / local[:, 2:] * (fx, fy) + (cx, cy)


def scene(means, opacity=4.0):
    count = len(means)
    return SplatScene(
        means=means,
        log_scales=np.full((count, 3), -3.0),
        quats=np.tile([1.0, 0, 0, 0], (count, 1)),
        logit_opacities=np.broadcast_to(opacity, count),
        sh=np.zeros((count, 1, 3)),
    )


def test_an_orbit_keeps_its_distance_and_elevation_and_looks_at_the_middle_upright():
    cameras = orbit(BOUNDS, frames=7, elevation=25, distance=4, size=(30, 40), fov=50)
    for camera in cameras:
        way = camera.center - BOUNDS.center
        assert np.linalg.norm(way) == pytest.approx(4)
        assert np.degrees(np.arcsin(way @ BOUNDS.up / 4)) == pytest.approx(25)
        np.testing.assert_allclose(pixels(camera, BOUNDS.center[None]), [[20, 15]], atol=1e-9)
        above = pixels(camera, (BOUNDS.center + 0.1 * BOUNDS.up)[None])[0]
        assert above[0] == pytest.approx(20) and above[1] < 15
    steps = [np.linalg.norm(a.center - b.center) for a, b in pairwise([*cameras, cameras[0]])]
    np.testing.assert_allclose(steps, steps[0])


@pytest.mark.parametrize("size", [(300, 400), (400, 300), (200, 900)])
def test_the_whole_ball_is_seen_from_an_orbit(size):
    distance = orbit_distance(BOUNDS, size, 40)
    [camera] = orbit(BOUNDS, frames=1, elevation=-30, distance=distance, size=size, fov=40)
    random = np.random.default_rng(0)
    ways = random.normal(size=(2000, 3))
    seen = pixels(
        camera, BOUNDS.center + BOUNDS.radius * ways / np.linalg.norm(ways, axis=1)[:, None]
    )
    assert (seen > 0).all() and (seen < size[::-1]).all()
    # And not from much too far: the ball fills the shorter side.
    assert np.ptp(seen, axis=0).max() > 0.85 * min(size)


def test_a_path_goes_through_every_camera_and_is_smooth_between():
    cameras = ring(9)
    path = smooth_path(cameras, 4)
    assert len(path) == 9 + 8 * 4
    for number, camera in enumerate(cameras):
        np.testing.assert_allclose(path[5 * number].view, camera.view, atol=1e-12)
    centers = np.array([camera.center for camera in path])
    # Away from its ends the spline follows the ring, and no step is much longer than others.
    away = np.linalg.norm((centers - MIDDLE_OF_RING)[5:-5, :2], axis=1)
    np.testing.assert_allclose(away, 5, rtol=0.02)
    steps = np.linalg.norm(np.diff(centers[5:-5], axis=0), axis=1)
    assert steps.max() < 1.2 * steps.min()


def test_rotations_turn_evenly_and_remain_rotations():
    a, b = ring(12)[:2]
    path = smooth_path([a, b], 3)
    turns = [p.view[:3, :3] @ q.view[:3, :3].T for q, p in pairwise(path)]
    for turn in turns:
        np.testing.assert_allclose(turn, turns[0], atol=1e-9)
    np.testing.assert_allclose(turns[0] @ turns[0].T, np.eye(3), atol=1e-12)
    # Two knots make a straight line.
    np.testing.assert_allclose(path[2].center, (a.center + b.center) / 2, atol=1e-12)


def test_one_camera_makes_a_path_of_one_and_strangers_make_none():
    [alone] = smooth_path(ring(1), 5)
    assert alone == ring(1)[0]
    a, b = ring(2)
    with pytest.raises(InputError, match="one size"):
        smooth_path([a, resized(b, (30, 40))], 1)


def test_a_resized_camera_sees_the_same_at_the_same_share_of_its_height():
    camera = Camera((60, 80), [[90, 0, 43], [0, 80, 28], [0, 0, 1]], ring(1)[0].view)
    twice = resized(camera, (120, 160))
    points = MIDDLE_OF_RING + np.random.default_rng(0).normal(size=(20, 3))
    np.testing.assert_allclose(pixels(twice, points), 2 * pixels(camera, points))
    wide = resized(camera, (60, 200))
    np.testing.assert_allclose(pixels(wide, points), np.add(pixels(camera, points), (60, 0)))


def test_looking_straight_up_has_no_upright_position():
    with pytest.raises(InputError, match="upright"):
        look_at([0, 0, 0], [0, 0, 5], [0, 0, 1])


def test_a_pinhole_sees_its_field_of_view_from_top_to_bottom():
    camera = pinhole((100, 60), 60, np.eye(4))
    edge = np.tan(np.radians(30))
    np.testing.assert_allclose(pixels(camera, np.array([[0, edge, 1.0]])), [[30, 100]])


def test_cameras_on_one_side_that_look_down_do_not_tilt_what_is_up():
    middle, places = np.zeros(3), [[5.0, 0, 5], [4, 3, 6], [3, 4, 4], [4.5, -2, 5]]
    cameras = [pinhole((10, 10), 40, look_at(at, middle, [0, 0, 1])) for at in places]
    np.testing.assert_allclose(bounds_of_cameras(cameras).up, [0, 0, 1], atol=1e-9)
    # Side by side they have only one horizontal direction; then the mean is all there is.
    row = [pinhole((10, 10), 40, look_at([5, y, 5], [0, y, 0], [0, 0, 1])) for y in (0, 1.0)]
    np.testing.assert_allclose(bounds_of_cameras(row).up, [-(0.5**0.5), 0, 0.5**0.5], atol=1e-9)


def test_what_floats_far_off_or_is_faint_does_not_move_the_middle():
    random = np.random.default_rng(1)
    means = random.normal(size=(1000, 3)) * 0.2 + (3, -1, 2)
    plain = bounds_of_splats(scene(means))
    np.testing.assert_allclose(plain.center, (3, -1, 2), atol=0.05)
    assert 0.3 < plain.radius < 0.6
    far = np.concatenate([means, random.normal(size=(40, 3)) * 500])
    faint = np.concatenate([means, np.tile([9.0, 9, 9], (3000, 1))])
    logits = np.r_[np.full(1000, 4.0), np.full(3000, -9.0)]
    for other in (scene(far), scene(faint, logits)):
        found = bounds_of_splats(other)
        np.testing.assert_allclose(found.center, plain.center, atol=0.1)
        assert found.radius == pytest.approx(plain.radius, rel=0.3)


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, -1, 0), (0.1, -0.9, 0.3), (1, 0, 0.2)])
def test_a_flat_scene_says_which_way_is_up(axis):
    up = np.array(axis) / np.linalg.norm(axis)
    random = np.random.default_rng(2)
    means = random.normal(size=(3000, 3))
    means -= 0.9 * (means @ up)[:, None] * up
    np.testing.assert_allclose(bounds_of_splats(scene(means)).up, up, atol=0.05)
    round_one = bounds_of_splats(scene(random.normal(size=(3000, 3))))
    np.testing.assert_allclose(round_one.up, (0, 0, 1))


def test_a_single_splat_has_a_ball_of_its_own_size():
    bounds = bounds_of_splats(scene(np.ones((1, 3))))
    np.testing.assert_allclose(bounds.center, 1)
    assert bounds.radius == pytest.approx(3 * np.exp(-3.0), rel=1e-5)


def test_cameras_say_where_they_look_how_far_off_and_what_is_up():
    splats = replace(BOUNDS, radius=0.9)
    bounds = bounds_of_cameras(ring(8), splats)
    np.testing.assert_allclose(bounds.center, MIDDLE_OF_RING, atol=1e-9)
    np.testing.assert_allclose(bounds.up, (0, 0, 1), atol=1e-9)
    assert bounds.radius == 0.9
    assert bounds.distance == pytest.approx(5 * np.hypot(1, 0.3))
    assert bounds.elevation == pytest.approx(np.degrees(np.arctan(0.3)))
    assert bounds_of_cameras(ring(8)).radius == pytest.approx(bounds.distance / 2)


def test_cameras_that_hang_every_way_leave_up_to_the_splats():
    cameras = []
    for camera, upside in zip(ring(8), [1, -1] * 4, strict=True):
        view = camera.view.copy()
        view[:2] *= upside
        cameras.append(Camera(camera.size, camera.K, view))
    np.testing.assert_allclose(bounds_of_cameras(cameras, BOUNDS).up, BOUNDS.up)


def test_a_weighted_median_is_where_half_of_the_weight_lies():
    values, weights = np.array([5.0, 1, 3]), np.array([1.0, 10, 1])
    assert weighted_quantile(values, weights, 0.5) == 1
    assert weighted_quantile(values, weights, 1.0) == 5
    assert weighted_quantile(values, np.array([1.0, 1, 1]), 0.5) == 3
