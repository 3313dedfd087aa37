"""Views of point sources as cameras: a pixel of either lies on the same ray."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.geometry.scan_cameras import scan_cameras

CONE = rift.Cone([0.3, 2.1, -1.4], 9, 12, (0.5, 0.4), 50, 80, (3.0, 7.5), [0, 0.5, -1])
FAN = rift.Fan([0.3, 2.1], 12, 0.4, 50, 80, 7.5)


def turned(vectors, angle):
    """The same views of a target that is turned about an oblique axis."""
    axis = np.array([0.6, 0.0, 0.8])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    values = (vectors.source, vectors.middle, vectors.across, vectors.down)
    return rift.Vectors(*(v @ turn.T for v in values), vectors.rows, vectors.bins)


def seen(camera, point):
    x, y, depth, _ = camera.view @ [*point, 1]
    fx, fy, cx, cy = camera.intrinsics
    return np.array([fy * y / depth + cy - 0.5, fx * x / depth + cx - 0.5]), depth


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("vectors", [CONE.vectors(), turned(CONE.vectors(), 0.7)])
def test_a_point_on_a_pixels_ray_is_seen_in_that_pixel(vectors, mirror):
    if mirror:
        down, rows, bins = -vectors.down, vectors.rows, vectors.bins
        vectors = rift.Vectors(vectors.source, vectors.middle, vectors.across, down, rows, bins)
    found = scan_cameras(vectors)
    for view, camera in enumerate(found.cameras):
        for row, column in ((0, 0), (8, 11), (2, 7)):
            pixel = vectors.middle[view] + (column - 5.5) * vectors.across[view]
            pixel = pixel + (row - 4) * vectors.down[view]
            point = vectors.source[view] + 0.6 * (pixel - vectors.source[view])
            place, depth = seen(camera, point)
            wanted = [8 - row if found.reversed_rows[view] else row, column]
            np.testing.assert_allclose(place, wanted, atol=1e-9)
            assert depth > 0
        np.testing.assert_allclose(camera.center, vectors.source[view], atol=1e-9)
    assert found.reversed_rows.all() != mirror


def test_a_cone_is_mirrored_and_has_the_cameras_of_its_vectors():
    assert scan_cameras(CONE).cameras == scan_cameras(CONE.vectors()).cameras
    assert scan_cameras(CONE).reversed_rows.all()


def test_a_fans_picture_has_one_row():
    camera = scan_cameras(FAN).cameras[1]
    gamma = FAN.fan_angles()[2]
    source = 50 * np.array([np.sin(2.1), -np.cos(2.1)])
    way = np.array([-np.sin(2.1 - gamma), np.cos(2.1 - gamma)])
    place, _ = seen(camera, [*(source + 40 * way), 0])
    np.testing.assert_allclose(place, [0, 2], atol=1e-9)
    assert camera.size == (1, 12)


def test_what_no_camera_sees_is_refused():
    with pytest.raises(InputError, match="curved"):
        scan_cameras(rift.Fan([0.3], 12, 0.4, 50, 80, curved=True))
    vectors = CONE.vectors()
    values = vectors.source, vectors.middle, vectors.across + 0.1 * vectors.down, vectors.down
    with pytest.raises(InputError, match=r"view 0.*perpendicular"):
        scan_cameras(rift.Vectors(*values, 9, 12))
