"""What a capture is of: the surface in the middle of its pictures, not where axes meet."""

from __future__ import annotations

import numpy as np

from rift_cl.commands.cameras.camera_path import pinhole
from rift_cl.commands.cameras.film_path import film
from rift_cl.commands.cameras.subject import subject_of
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.geometry.pose import look_at
from rift_cl.sampling.targets.free_space import DepthMap

SIZE = (30, 40)


def cameras():
    """On one side of a wall at z = 0, all aimed at one point of it."""
    angles = np.radians(np.linspace(-30, 30, 7))
    places = [[4 * np.sin(a), 0, 4 * np.cos(a)] for a in angles]
    return [pinhole(SIZE, 40, look_at(at, [0, 0, 0], [0, 1, 0])) for at in places]


def test_what_stands_out_is_the_subject_and_the_wall_around_it_is_not():
    maps = []
    for camera in cameras():
        depth = np.full(SIZE, 4.0)
        depth[8:22, 12:28] = 3.0
        depth[0, 0] = np.inf
        maps.append(DepthMap(camera, depth))
    expected = np.median([c.center + 3 * c.view[2, :3] for c in cameras()], axis=0)
    np.testing.assert_allclose(subject_of(maps), expected)
    assert abs(expected[2] - 0.9) < 0.15


def test_pictures_that_show_nothing_in_their_middle_tell_no_subject():
    depth = np.full(SIZE, np.inf)
    depth[0] = 2.0
    assert subject_of([DepthMap(camera, depth) for camera in cameras()]) is None
    assert subject_of([]) is None


def test_a_film_from_one_side_looks_at_the_subject():
    bounds, subject = bounds_of_cameras(cameras()), np.array([0.1, 0.2, 0.9])
    for camera in film(bounds, frames=6, size=SIZE, fov=40, subject=subject):
        x, y, z = camera.view[:3, :3] @ subject + camera.view[:3, 3]
        np.testing.assert_allclose([x, y], 0, atol=1e-9)
        assert z > 0
