"""The motion in common: found again of one camera and of many, and no picture tells of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rift_cl.geometry import Camera, look_at
from rift_cl.geometry.common_motion import Similarity, common_motion

MOTION = Similarity(
    1.3, Rotation.from_rotvec([0.2, -0.5, 0.3]).as_matrix(), np.array([0.4, -2.0, 1.0])
)


def cameras(count):
    places = 5 * np.random.default_rng(0).normal(size=(count, 3)) + [0, 1, 0]
    K = [[90, 0, 40], [0, 90, 30], [0, 0, 1]]
    return [Camera((60, 80), K, look_at(place, [0.1, 0, 0], [0, 0, 1])) for place in places]


# One camera, which a larger scene looks the same to, tells no scale.
@pytest.mark.parametrize(("count", "scale"), [(6, 1.3), (1, 1.0)])
def test_a_motion_is_found_again(count, scale):
    before, motion = cameras(count), replace(MOTION, scale=scale)
    found = common_motion(before, [motion.camera(camera) for camera in before], 5.0)
    assert found.scale == pytest.approx(scale)
    np.testing.assert_allclose(found.turn, motion.turn, atol=1e-6)
    np.testing.assert_allclose(found.shift, motion.shift, atol=1e-6)


def test_a_moved_camera_sees_the_moved_scene_as_before():
    camera, points = cameras(1)[0], np.random.default_rng(1).normal(size=(20, 3))
    moved = MOTION.scale * points @ MOTION.turn.T + MOTION.shift

    def pixels(one, seen):
        at = (seen @ one.view[:3, :3].T + one.view[:3, 3]) @ one.K.T
        return at[:, :2] / at[:, 2:]

    np.testing.assert_allclose(pixels(MOTION.camera(camera), moved), pixels(camera, points))


def test_what_one_camera_does_alone_is_hardly_in_common():
    before = cameras(20)
    alone = [MOTION.camera(before[0]), *before[1:]]
    found = common_motion(before, alone, 5.0)
    turned = Rotation.from_matrix(found.turn).magnitude()
    assert turned < 0.3 * Rotation.from_matrix(MOTION.turn).magnitude()
