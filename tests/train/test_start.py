"""Where splats begin, and how large the scene is taken for."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError
from rift_cl.geometry import Camera
from rift_cl.train.start.points import (
    far_points,
    focus_of,
    random_points,
    scene_extent,
    scene_size,
    start_splats,
)

MIDDLE_OF_RING = np.array([0.3, -0.2, 0.1])


def ring(count=12, radius=5.0, middle=MIDDLE_OF_RING):
    """Cameras on a ring that look at its middle."""
    cameras = []
    for angle in np.arange(count) * 2 * np.pi / count:
        center = middle + radius * np.array([np.cos(angle), np.sin(angle), 0.3])
        forward = (middle - center) / np.linalg.norm(middle - center)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        view = np.eye(4)
        view[:3, :3] = [right, np.cross(forward, right), forward]
        view[:3, 3] = -view[:3, :3] @ center
        cameras.append(Camera((60, 80), [[90, 0, 40], [0, 90, 30], [0, 0, 1]], view))
    return cameras


def test_focus_is_where_the_axes_meet():
    np.testing.assert_allclose(focus_of(ring()), [0.3, -0.2, 0.1], atol=1e-9)
    alone = ring(1)
    assert np.linalg.norm(focus_of(alone) - alone[0].center) == pytest.approx(1)


def test_extent_is_how_far_the_cameras_spread():
    assert scene_extent(ring()) == pytest.approx(1.1 * 5.0)
    assert scene_extent(ring(1)) == pytest.approx(1.0)


def test_random_points_lie_where_half_of_the_cameras_look():
    cameras = ring()
    points = random_points(cameras, 500, 3)
    assert points.shape == (500, 3)
    seen = np.zeros(500)
    for camera in cameras:
        local = points @ camera.view[:3, :3].T + camera.view[:3, 3]
        pixels = local[:, :2] / local[:, 2:] * 90 + (40, 30)
        seen += (local[:, 2] > 0) & ((pixels > 0) & (pixels < (80, 60))).all(axis=1)
    assert (seen >= 6).all()
    assert np.array_equal(points, random_points(cameras, 500, 3))
    assert not np.array_equal(points, random_points(cameras, 500, 4))


def test_far_points_lie_behind_the_focus_of_a_camera_that_sees_them():
    cameras = ring()
    points = far_points(cameras, 300, 3)
    seen = np.zeros(300, bool)
    for camera in cameras:
        local = points @ camera.view[:3, :3].T + camera.view[:3, 3]
        pixels = local[:, :2] / local[:, 2:] * 90 + (40, 30)
        beyond = local[:, 2] > 2.1 * np.linalg.norm(camera.center - MIDDLE_OF_RING)
        seen |= beyond & ((pixels >= 0) & (pixels <= (80, 60))).all(axis=1)
    assert seen.all()
    assert np.linalg.norm(points - MIDDLE_OF_RING, axis=1).max() > 5 * 5
    assert np.array_equal(points, far_points(cameras, 300, 3))
    assert far_points(cameras, 0, 3).shape == (0, 3)


def turned(cameras, turn):
    """The same places, with axes turned."""
    return [Camera(c.size, c.K, np.diag([*turn, 1.0]) @ c.view) for c in cameras]


def moved(cameras, scale):
    """The same cameras in another unit of length."""
    views = []
    for camera in cameras:
        view = camera.view.copy()
        view[:3, 3] *= scale
        views.append(Camera(camera.size, camera.K, view))
    return views


def test_cameras_that_look_away_are_told():
    with pytest.raises(InputError, match="OpenCV's for OpenGL's"):
        random_points(turned(ring(), (1, -1, -1)), 10, 0)


def test_cameras_whose_pictures_share_nothing_are_told():
    narrow = [Camera(c.size, [[9000, 0, 40], [0, 9000, 30], [0, 0, 1]], c.view) for c in ring(5)]
    random = np.random.default_rng(0)
    astray = []
    for camera in narrow:
        view = camera.view.copy()
        view[:3, 3] += random.uniform(-2, 2, 3) * (1, 1, 0)
        astray.append(Camera(camera.size, camera.K, view))
    with pytest.raises(InputError, match="no volume that half of the cameras see"):
        random_points(astray, 10, 0)


def survey(count=30, tilt=0.0):
    """Cameras in a line, that look down side by side, and each next one shows 3/4 of the last."""
    random, cameras = np.random.default_rng(5), []
    for number in range(count):
        a, b = tilt * random.standard_normal(2)
        turn = np.linalg.qr(np.array([[1, 0, a], [0, 1, b], [-a, -b, 1]]))[0]
        view = np.eye(4)
        view[:3, :3] = turn * np.sign(np.diag(turn))
        view[:3, 3] = -view[:3, :3] @ [0.667 * number, 0, 0]
        cameras.append(Camera((60, 80), [[90, 0, 40], [0, 90, 30], [0, 0, 1]], view))
    return cameras


@pytest.mark.parametrize("tilt", [0.0, 0.003])
def test_cameras_side_by_side_see_what_they_overlap_in(tilt):
    cameras = survey(tilt=tilt)
    depth = focus_of(cameras)[2]
    assert depth == pytest.approx(4, rel=0.05)
    points = random_points(cameras, 300, 0)
    assert points[:, 2].min() > 1 and points[:, 2].max() < 9
    assert np.ptp(points[:, 0]) > 0.8 * 0.667 * 30
    # In any unit.
    for scale in (20.0, 0.05):
        assert random_points(moved(cameras, scale), 300, 0) == pytest.approx(scale * points)
    # Few of them have something in common.
    assert random_points(survey(4, tilt), 100, 0)[:, 2].min() > 0


def test_the_size_of_a_scene_has_the_unit_of_its_coordinates():
    for cameras in (ring(), survey(), turned(ring(), (1, -1, -1))):
        assert scene_size(moved(cameras, 8.0)) == pytest.approx(8 * scene_size(cameras))
    assert scene_size(ring()) == pytest.approx(1.1 * 5.0)


def test_splats_are_as_large_as_the_gaps():
    grid = np.stack(np.meshgrid(*3 * [np.arange(4) * 0.5], indexing="ij"), -1).reshape(-1, 3)
    raw = start_splats(grid, None, seed=0)
    np.testing.assert_allclose(np.exp(raw["log_scales"]), 0.5, rtol=1e-6)
    assert raw["sh"].shape == (64, 1, 3)
    colored = start_splats(grid, np.full((64, 3), 0.8), seed=0)
    np.testing.assert_allclose(0.28209479 * colored["sh"] + 0.5, 0.8, rtol=1e-6)


def test_points_in_one_place_and_one_point():
    same = start_splats(np.zeros((5, 3)), None, seed=0)
    assert np.isfinite(same["log_scales"]).all()
    assert start_splats(np.zeros((1, 3)), None, seed=0)["log_scales"].tolist() == [[0, 0, 0]]
    with pytest.raises(InputError, match="no points"):
        start_splats(np.zeros((0, 3)), None, seed=0)


def test_points_and_colours_that_are_no_numbers_are_named():
    broken = np.eye(3)
    broken[1, 2] = np.nan
    with pytest.raises(NonFiniteError, match="points"):
        start_splats(broken)
    with pytest.raises(NonFiniteError, match="colors"):
        start_splats(np.eye(3), broken)
