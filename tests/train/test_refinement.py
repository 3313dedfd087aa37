"""Poses and exposures: gradients against differences, and what was disturbed is found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_start import ring
from test_trainer import SETTINGS, Ball

from rift_cl.geometry import Camera
from rift_cl.geometry.common_motion import Similarity
from rift_cl.train.parameters import Parameters
from rift_cl.train.per_view.exposures import Exposures, fitted_exposure
from rift_cl.train.per_view.held_out_poses import placed_cameras
from rift_cl.train.per_view.poses import Poses, twist_gradient
from rift_cl.train.settings import LearningRates
from rift_cl.train.trainer import Trainer

pytestmark = pytest.mark.dealt


def disturbed(cameras, turn, shift, seed=0):
    random = np.random.default_rng(seed)
    found = []
    for camera in cameras:
        view = camera.view.copy()
        view[:3, :3] = Rotation.from_rotvec(turn * random.normal(size=3)).as_matrix() @ view[:3, :3]
        view[:3, 3] += shift * random.normal(size=3)
        found.append(Camera(camera.size, camera.K, view, camera.model))
    return found


def test_the_gradient_of_a_twist_is_its_difference():
    random = np.random.default_rng(1)
    view, weights = ring(3)[1].view.copy(), random.normal(size=(3, 4))

    def loss(twist):
        turn = Rotation.from_rotvec(twist[:3]).as_matrix()
        moved = turn @ view[:3]
        moved[:, 3] += twist[3:]
        return float((weights * moved).sum())

    wanted = [(loss(1e-6 * axis) - loss(-1e-6 * axis)) / 2e-6 for axis in np.eye(6)]
    np.testing.assert_allclose(twist_gradient(view, weights), wanted, rtol=1e-6, atol=1e-8)


def test_poses_go_where_points_are_seen():
    """Reprojection of known points, as a loss whose gradient by the view is plain algebra."""
    truth = ring(4)
    poses = Poses(disturbed(truth, 0.02, 0.05), 5.0)
    points = np.concatenate([np.random.default_rng(2).normal(size=(50, 3)), np.ones((50, 1))], 1)

    def residual(number):
        return poses.views[number, :3] @ points.T - truth[number].view[:3] @ points.T

    before = [np.abs(residual(number)).max() for number in range(4)]
    for step in range(4000):
        number = step % 4
        by_view = 2 * residual(number) @ points / len(points)
        poses.update(number, by_view, 2e-3 * 0.998 ** (step // 4))
    after = [np.abs(residual(number)).max() for number in range(4)]
    assert max(after) < 0.02 * min(before)
    for view in poses.views:
        np.testing.assert_allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), atol=1e-12)
    assert poses.camera(2).size == truth[2].size


def test_how_far_cameras_moved_is_told():
    poses = Poses(ring(2), 1.0)
    assert not poses.moved().any()
    poses.views[0, :3, :3] = Rotation.from_rotvec([0.1, 0, 0]).as_matrix() @ poses.views[0, :3, :3]
    turned, moved = poses.moved()[0]
    assert turned == pytest.approx(0.1) and moved > 0.1
    assert not poses.moved()[1].any()


def test_a_gradient_that_is_not_finite_moves_nothing():
    poses = Poses(ring(2), 1.0)
    before = poses.views.copy()
    poses.update(0, np.full((3, 4), np.nan), 0.1)
    assert (poses.views == before).all()


def test_a_gain_and_an_offset_for_each_colour_are_applied(device):
    exposures, image = Exposures(device, 3), np.random.default_rng(0).uniform(size=(5, 7, 3))
    exposures.values[1] = [[1.1, 0.9, 1.0], [0.1, 0.0, -0.2]]
    sent = device.array(image.astype(np.float32))
    found = device.get(exposures.applied(sent, 1))
    np.testing.assert_allclose(found, image * [1.1, 0.9, 1.0] + [0.1, 0.0, -0.2], atol=1e-6)
    np.testing.assert_array_equal(device.get(exposures.applied(sent, 0)), image.astype(np.float32))


@pytest.mark.parametrize("weighted", [False, True])
def test_exposures_that_differ_are_found_up_to_what_all_share(device, weighted):
    random, exposures = np.random.default_rng(4), Exposures(device, 2)
    image = random.uniform(size=(16, 15, 3)).astype(np.float32)
    gains = np.array([[1.2, 1.0, 0.9], [0.8, 1.0, 1.1]])
    targets = [(image * gain).astype(np.float32) for gain in gains]
    weights = None
    if weighted:
        counted = random.uniform(size=(16, 15)) < 0.5
        weights = device.array(counted.astype(np.float32))
        targets = [np.where(counted[..., None], target, np.float32(9)) for target in targets]
    sent = device.array(image)
    for step in range(60):
        number = step % 2
        exposures.fit(sent, device.array(targets[number]), weights, number)
    np.testing.assert_allclose(exposures.values[:, 0], gains, atol=1e-4)
    np.testing.assert_allclose(exposures.values[:, 1], 0, atol=1e-4)
    np.testing.assert_allclose(exposures.values.mean(axis=0), [[1] * 3, [0] * 3], atol=1e-12)


def test_an_exposure_moves_to_the_least_of_a_known_sum(device):
    random, exposures = np.random.default_rng(6), Exposures(device, 200)
    image, noise = random.uniform(size=(2, 9, 11, 3)).astype(np.float32)
    target = (image * [0.8, 0.4, 1.2] + 0.2 * noise).astype(np.float32)
    weights = random.uniform(size=(9, 11)).astype(np.float32)
    exposures.fit(*map(device.array, (image, target, weights)), 0)
    roots, pixels = np.sqrt(weights.ravel().astype(float)), image.reshape(-1, 3)
    for color in range(3):
        rows = np.stack([roots * pixels[:, color], roots], axis=1)
        cost = [0.0, np.sqrt(0.02 * weights.sum(dtype=float))]
        wanted = [*(roots * target.reshape(-1, 3)[:, color]), 0.0]
        best = np.linalg.lstsq(np.vstack([rows, cost]), wanted, rcond=None)[0]
        # A share of .3 of the way from (1, 0), and a mean that is taken off all views.
        gain, offset = 1 + 0.3 * (best[0] - 1), 0.3 * best[1]
        assert exposures.values[0, 0, color] == pytest.approx(gain * 200 / (199 + gain), abs=1e-5)
        assert exposures.values[0, 1, color] == pytest.approx(offset * 199 / 200, abs=1e-5)


@pytest.mark.parametrize(
    ("image", "target", "gain"),
    [(0.0, 0.4, 1.0), (0.5, 0.0, 0.1), (0.01, 0.9, 10.0), (0.5, np.nan, 1.0)],
    ids=["black", "of black", "of white", "no number"],
)
def test_pictures_that_tell_no_exposure(device, image, target, gain):
    exposures = Exposures(device, 1)
    sent = [device.array(np.full((4, 4, 3), value, np.float32)) for value in (image, target)]
    exposures.fit(*sent, None, 0)
    np.testing.assert_allclose(exposures.values, [[[1] * 3, [0] * 3]], atol=1e-12)
    pair = Exposures(device, 2)
    pair.fit(*sent, None, 0)
    moved = 1 + 0.3 * (gain - 1)
    np.testing.assert_allclose(pair.values[0, 0] / pair.values[1, 0], moved, rtol=1e-6)
    pair.fit(*sent, device.zeros((4, 4)), 1)
    assert np.isfinite(pair.values).all()


def test_the_gradient_by_an_image_is_that_by_its_exposure_times_the_gain(device):
    exposures, by = Exposures(device, 2), np.random.default_rng(1).normal(size=(5, 6, 3))
    exposures.values[1] = [[1.1, 0.9, 1.0], [0.1, 0.0, -0.2]]
    found = device.get(exposures.gradient(device.array(by.astype(np.float32)), 1))
    np.testing.assert_allclose(found, by * [1.1, 0.9, 1.0], atol=1e-6)


@pytest.mark.parametrize("kind", ["poses", "exposures"])
def test_a_state_brings_both_back(device, kind):
    made = [Poses(ring(3), 2.0) if kind == "poses" else Exposures(device, 3) for _ in range(2)]
    image = device.array(np.ones((4, 4, 3), np.float32))

    def step(one):
        if kind == "poses":
            one.update(1, np.arange(12.0).reshape(3, 4), 0.01)
        else:
            one.fit(image, device.array(np.full((4, 4, 3), 0.5, np.float32)), None, 1)

    step(made[0])
    made[1].restore(made[0].state())
    for one in made:
        step(one)
    for name, array in made[0].state().items():
        np.testing.assert_array_equal(array, made[1].state()[name], err_msg=name)


def missed(cameras, truth, points):
    """How far points of a scene are from where they are to be seen, root mean square in pixels."""
    gaps = [
        seen(one, points) - seen(other, points) for one, other in zip(cameras, truth, strict=True)
    ]
    return np.sqrt(np.mean(np.square(gaps)))


def seen(camera, points):
    at = (points @ camera.view[:3, :3].T + camera.view[:3, 3]) @ camera.K.T
    return at[:, :2] / at[:, 2:]


@pytest.mark.full
@pytest.mark.parametrize("exposed", [False, True])
def test_cameras_that_were_held_out_go_where_their_photographs_were_taken(device, exposed):
    """The trained cameras have moved together: those that were given badly are to follow them."""
    rates = LearningRates(pose_reach=0.03)
    settings = replace(SETTINGS, refine_poses=True, refine_exposures=exposed, learning_rates=rates)
    ball, motion = Ball(device), Similarity(1.0, np.eye(3), np.array([0.05, 0.0, -0.1]))
    truth, back = ball.cameras, Similarity(1.0, np.eye(3), -motion.shift)
    ball.cameras = [back.camera(camera) for camera in truth]
    trainer = Trainer(ball, Parameters.of(device, ball.raw), settings)
    trainer.poses.views = np.array([camera.view for camera in truth])
    ball.cameras, truth = disturbed(ball.cameras, 0.006, 0.02)[:1], truth[:1]
    if exposed:
        ball.images = [0.8 * image + 0.05 for image in ball.images]
    start = missed(ball.cameras, truth, ball.raw["means"])
    followed = [motion.camera(camera) for camera in ball.cameras]
    moved = missed(followed, truth, ball.raw["means"])
    found = missed(list(placed_cameras(trainer, ball)), truth, ball.raw["means"])
    assert found < 0.3 * moved < 0.5 * start


def test_the_best_exposure_of_a_picture_is_that_of_least_squares():
    random = np.random.default_rng(3)
    image = random.uniform(size=(6, 7, 3)).astype(np.float32)
    wanted = np.array([[1.2, 0.7, 1.0], [-0.1, 0.05, 0.0]])
    target = (wanted[0] * image + wanted[1]).astype(np.float32)
    np.testing.assert_allclose(fitted_exposure(image, target), wanted, atol=1e-5)
    counted = random.uniform(size=(6, 7)) < 0.6
    target[~counted] = 7
    np.testing.assert_allclose(fitted_exposure(image, target, counted), wanted, atol=1e-5)
    # Of one colour, of nothing that counts, and of what falls where the photograph rises.
    flat = fitted_exposure(np.full_like(image, 0.3), target, counted)
    np.testing.assert_array_equal(flat[0], 1)
    none = fitted_exposure(image, target, np.zeros((6, 7), bool))
    np.testing.assert_array_equal(none, [[1] * 3, [0] * 3])
    np.testing.assert_array_equal(fitted_exposure(image, -image)[0], 0)
