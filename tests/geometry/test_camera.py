"""Cameras: values that compare and hash, and errors that name what is wrong."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry import Camera

K = [[100, 0, 32], [0, 90, 24], [0, 0, 1]]


def pose(angle=0.3, shift=(0.1, -0.2, 4.0)):
    c, s = np.cos(angle), np.sin(angle)
    view = np.eye(4)
    view[:3, :3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    view[:3, 3] = shift
    return view


def camera(**changes):
    return Camera(**({"size": (48, 64), "K": K, "view": pose()} | changes))


def changed(matrix, place, value):
    matrix = np.array(matrix, float)
    matrix[place] = value
    return matrix


def test_parts_are_what_was_given():
    made = camera(model="fisheye")
    assert (made.size, made.height, made.width, made.model) == ((48, 64), 48, 64, "fisheye")
    assert made.intrinsics == (100, 90, 32, 24)
    assert camera().model == "pinhole"
    assert made.K.dtype == made.view.dtype == np.float64


def test_center_is_where_the_view_is_zero():
    made = camera()
    np.testing.assert_allclose(made.view @ [*made.center, 1], [0, 0, 0, 1], atol=1e-12)


def test_equal_cameras_are_equal_and_hash_equally():
    first, second = camera(), camera(size=[48.0, 64], K=np.array(K, np.float32))
    assert first == second
    assert hash(first) == hash(second)
    assert first != camera(view=pose(0.31))
    assert first != camera(model="ortho")
    assert first != camera(size=(64, 48))
    assert first != "a camera"
    minus_zero = changed(K, (0, 1), -0.0)
    assert hash(camera(K=minus_zero)) == hash(first)


def test_camera_cannot_be_changed_from_outside():
    mine = pose()
    made = camera(view=mine)
    mine[0, 3] = 99
    assert made.view[0, 3] == 0.1
    for matrix in (made.K, made.view):
        with pytest.raises(ValueError, match="read-only"):
            matrix[0, 0] = 1
    with pytest.raises(AttributeError):
        made.model = "ortho"


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))]
)
def test_copies_are_equal_and_as_unchangeable(again):
    made = again(camera())
    assert made == camera()
    assert not made.K.flags.writeable
    assert not made.view.flags.writeable


@pytest.mark.parametrize(
    "size", [(0, 5), (5, -1), (5,), (5, 5, 3), (5.5, 5), "ab", None, 7, (np.nan, 5), (1 << 40, 5)]
)
def test_empty_or_senseless_image_is_named(size):
    with pytest.raises(ShapeError, match="size is"):
        camera(size=size)


@pytest.mark.parametrize(
    ("matrix", "error", "words"),
    [
        (np.eye(4), ShapeError, r"K has shape \(4, 4\)"),
        ("K", InputError, "K is 'K'"),
        (np.array(K) * 1j, InputError, "K is"),
        (changed(K, (0, 2), np.nan), NonFiniteError, r"K\[0, 2\] is nan"),
        (changed(K, (0, 0), 0), InputError, "fx = 0.*singular"),
        (changed(K, (1, 1), -90), InputError, "fy = -90.*mirrors"),
        (changed(K, (0, 1), 0.5), InputError, "without skew"),
        (changed(K, (2, 2), 2), InputError, "without skew"),
        (changed(K, (2, 0), 1), InputError, "without skew"),
    ],
)
def test_intrinsics_that_are_none_are_named(matrix, error, words):
    with pytest.raises(error, match=words):
        camera(K=matrix)


@pytest.mark.parametrize(
    ("matrix", "error", "words"),
    [
        (np.eye(3), ShapeError, "view has shape"),
        (pose()[:3], ShapeError, r"view has shape \(3, 4\)"),
        (changed(pose(), (1, 3), np.inf), NonFiniteError, r"view\[1, 3\] is inf"),
        (2 * pose(), InputError, "last row of view is"),
        (changed(pose(), (3, 0), 0.1), InputError, "last row of view is"),
        (pose() @ np.diag([2, 2, 2, 1]), InputError, "no rigid motion"),
        (pose() @ np.diag([1, 1, -1, 1]), InputError, "no rigid motion.*determinant -1"),
        (np.diag([0, 0, 0, 1]), InputError, "no rigid motion"),
    ],
)
def test_poses_that_are_none_are_named(matrix, error, words):
    with pytest.raises(error, match=words):
        camera(view=matrix)


def test_pose_of_a_few_digits_passes():
    assert camera(view=np.round(pose(), 4)).model == "pinhole"


@pytest.mark.parametrize("model", ["ftheta", "", None, 3])
def test_unknown_model_is_named(model):
    with pytest.raises(InputError, match=r"model is .*pinhole"):
        camera(model=model)
