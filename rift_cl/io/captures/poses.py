"""Poses as files write them, turned into the world-to-camera motions of ``Camera``.

``transforms.json`` holds camera-to-world matrices with OpenGL's axes (x right, y up, z backward),
COLMAP holds world-to-camera quaternions with OpenCV's (x right, y down, z forward).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError

# How far M M' may be from 1: three digits behind the point leave 1.8e-3 of a rotation.
_RIGID = 2e-3
# How far from 1 two digits leave what a rotation stretches by, and how much its three stretches
# differ at most where a scene was scaled and nothing rounded.
_ROUNDED, _SCALED = 0.02, 1e-5


def view_of_opengl(camera_to_world: ArrayLike) -> NDArray[np.float64]:
    """World-to-camera matrix (4, 4), OpenCV axes, of a camera-to-world one (3, 4), OpenGL axes.

    Raises:
        NonFiniteError: an entry is NaN or infinite.
        InputError: the matrix is no rotation and shift.
    """
    pose = np.asarray(camera_to_world, np.float64)
    _demand_finite(pose)
    rotation = _nearest_rotation(pose[:, :3] * [1, -1, -1]).T
    with np.errstate(all="ignore"):
        return _motion(rotation, -rotation @ pose[:, 3])


def view_of_quaternion(quaternion: ArrayLike, shift: ArrayLike) -> NDArray[np.float64]:
    """World-to-camera matrix (4, 4) of a quaternion w, x, y, z of any length, and a shift.

    Raises:
        NonFiniteError: a number is NaN or infinite.
        InputError: the quaternion is zero.
    """
    numbers = np.asarray(quaternion, np.float64)
    _demand_finite(numbers, np.asarray(shift, np.float64))
    largest = np.abs(numbers).max()
    if largest == 0:
        raise InputError("the quaternion of the pose is zero, which is no rotation")
    numbers = numbers / largest
    w, x, y, z = numbers / np.linalg.norm(numbers)
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return _motion(rotation, shift)


def rigid_error(matrix: ArrayLike) -> float:
    """How far a matrix (3, 3) is from a rotation: the largest entry of |M M' - 1|."""
    rotation = np.asarray(matrix, np.float64)
    with np.errstate(all="ignore"):
        return float(np.abs(rotation @ rotation.T - np.eye(3)).max())


def _nearest_rotation(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(all="ignore"):
        left, stretch, right = np.linalg.svd(matrix)
    error = rigid_error(matrix)
    found: NDArray[np.float64] = left @ right
    if error <= _RIGID and np.linalg.det(found) > 0:
        return found
    if np.linalg.det(found) < 0:
        raise InputError("the pose mirrors the scene, wanted a rotation and a shift")
    spread = stretch[0] - stretch[2]
    if np.abs(stretch - 1).max() <= _ROUNDED and spread > _SCALED:
        raise InputError(
            f"the pose is no rigid motion: its rotation is off by {error:.2g}, as one is that was "
            "written with too few digits. Write five or more behind the point"
        )
    if spread <= _RIGID * stretch[0] and stretch[0] > 0:
        raise InputError(
            f"the pose scales the scene by {stretch[1]:.6g}, wanted a rotation and a shift: "
            "divide the first three columns by that"
        )
    raise InputError(
        f"the pose is no rigid motion (its rotation is off by {error:.2g}), wanted a rotation "
        "and a shift"
    )


def _motion(rotation: ArrayLike, shift: ArrayLike) -> NDArray[np.float64]:
    view = np.eye(4)
    view[:3, :3] = rotation
    view[:3, 3] = shift
    return view


def _demand_finite(*arrays: NDArray[np.float64]) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise NonFiniteError("the pose holds NaN or infinity, every number must be finite")
