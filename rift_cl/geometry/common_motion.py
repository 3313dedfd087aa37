"""The motion that cameras have in common: what tells one frame of coordinates from another.

Cameras that are fitted together with a scene fix it up to a similarity alone: turned, shifted and
scaled as a whole, scene and cameras give the same pictures. The motion is found from four points of
each camera, its centre and three at some distance before it, by least squares (Umeyama, IEEE Trans.
PAMI 13, 1991). Points at the distance of what is seen weigh a turn and the shift that undoes it in
the picture as one, which they nearly are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry.camera import Camera

Floats = NDArray[np.float64]

# In the camera's frame, in units of the distance.
_POINTS = np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]])

# Rounds in which the scale settles. Of cameras round what they look at each leaves half of its
# error; of cameras that hardly spread, which tell little of it, the scale stays near one.
_ROUNDS = 100


@dataclass(frozen=True, eq=False)
class Similarity:
    """The motion x -> scale turn x + shift of points.

    Args:
        scale: above 0.
        turn: (3, 3) rotation.
        shift: (3,).
    """

    scale: float
    turn: Floats
    shift: Floats

    def camera(self, camera: Camera) -> Camera:
        """The camera that takes of the moved scene the picture that the given one took."""
        view = np.eye(4)
        view[:3, :3] = camera.view[:3, :3] @ self.turn.T
        view[:3, 3] = self.scale * camera.view[:3, 3] - view[:3, :3] @ self.shift
        return Camera(camera.size, camera.K, view, camera.model, camera.aperture)


def common_motion(before: Sequence[Camera], after: Sequence[Camera], ahead: float) -> Similarity:
    """The motion that takes cameras to where they are afterwards, by least squares.

    The scale is one where all cameras stand in one place, which tells none.

    Args:
        before: one or more cameras.
        after: the same cameras, in the same order.
        ahead: distance of what they look at, above 0.
    """
    old, motion = _points(before, ahead), Similarity(1.0, np.eye(3), np.zeros(3))
    for _ in range(_ROUNDS):
        # What they look at is farther off in a scene that was made larger.
        motion = _between(old, _points(after, motion.scale * ahead))
    return motion


def _between(old: Floats, new: Floats) -> Similarity:
    """The motion of points (N, 3) to others."""
    old_mean, new_mean = old.mean(axis=0), new.mean(axis=0)
    left, values, right = np.linalg.svd((new - new_mean).T @ (old - old_mean))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    turn = (left * signs) @ right
    scale = float(values @ signs / np.sum((old - old_mean) ** 2))
    return Similarity(scale, turn, new_mean - scale * turn @ old_mean)


def _points(cameras: Sequence[Camera], ahead: float) -> Floats:
    """Four points of each camera, (4 V, 3)."""
    views = np.array([camera.view for camera in cameras])
    seen = ahead * _POINTS - views[:, None, :3, 3]
    return np.asarray(seen @ views[:, :3, :3]).reshape(-1, 3)
