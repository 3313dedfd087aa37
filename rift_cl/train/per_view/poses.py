"""The cameras' poses, fitted along with the splats.

A pose moves by small turns and shifts in its own camera's frame, view <- exp(twist) view. With
G = dL/d(upper rows of view), the gradient by the shift is G's last column, and by a turn about axis
a it is the sum of G times (a x each column of view). Steps are Adam's, a rate for turns in radians
and one for shifts in the scene's unit. The common motion of all cameras, which the splats follow,
is not taken out: ``Poses.common_motion`` tells it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rift_cl.geometry import Camera
from rift_cl.geometry.common_motion import Similarity, common_motion
from rift_cl.train.per_view.host_adam import HostAdam

Floats = NDArray[np.float64]


class Poses:
    """Cameras whose poses are being fitted.

    Args:
        cameras: where they are believed to be.
        extent: length of the scene, that shifts are measured in.
    """

    def __init__(self, cameras: Sequence[Camera], extent: float) -> None:
        self._given = cameras
        self.extent = extent
        self.views = np.array([camera.view for camera in cameras])
        self._adam = HostAdam((len(cameras), 6))

    def camera(self, number: int) -> Camera:
        """A camera where it is believed to be by now."""
        given = self._given[number]
        return Camera(given.size, given.K, self.views[number], given.model, given.aperture)

    def update(self, number: int, by_view: Floats, rate: float) -> None:
        """Move a camera by a step.

        Args:
            number: which.
            by_view: (3, 4) gradient of the loss by the upper rows of its view matrix.
            rate: of turns, in radians; shifts go as far times the extent.
        """
        twist = twist_gradient(self.views[number], by_view)
        rates = np.repeat([rate, rate * self.extent], 3)
        # Adam's steps are longer where a gradient is much larger than those before; the reach that
        # a run gives a camera counts on none that is.
        step = -np.clip(self._adam.step(number, twist, rates), -rates, rates)
        if not step.any():
            return
        turn, view = Rotation.from_rotvec(step[:3]).as_matrix(), self.views[number]
        # Turned and made orthonormal again, so that rounding does not add up.
        basis, _, other = np.linalg.svd(turn @ view[:3, :3])
        view[:3, :3] = basis @ other
        view[:3, 3] = turn @ view[:3, 3] + step[3:]

    def moved(self) -> Floats:
        """How far each camera has turned, in radians, and moved, in the scene's unit: (V, 2)."""
        given = np.array([camera.view for camera in self._given])
        back = given[:, :3, :3].transpose(0, 2, 1)
        turned = Rotation.from_matrix(self.views[:, :3, :3] @ back).magnitude()
        away = np.linalg.norm(_centers(self.views) - _centers(given), axis=1)
        return np.stack([turned, away], axis=1)

    def common_motion(self, ahead: float) -> Similarity:
        """What all cameras have moved by, which the splats have followed.

        Args:
            ahead: distance of what the cameras look at.
        """
        cameras = [self.camera(number) for number in range(len(self._given))]
        return common_motion(self._given, cameras, ahead)

    def state(self) -> dict[str, Floats]:
        """What a checkpoint keeps."""
        return {"views": self.views.copy(), **self._adam.state()}

    def restore(self, state: Mapping[str, Floats]) -> None:
        """Go on from a checkpoint."""
        self.views = np.array(state["views"])
        self._adam.restore(state)


def twist_gradient(view: Floats, by_view: Floats) -> Floats:
    """Gradient by a small turn and shift in the camera's frame, (6,)."""
    turn = np.cross(view[:3].T, by_view.T).sum(axis=0)
    return np.concatenate([turn, by_view[:, 3]])


def _centers(views: Floats) -> Floats:
    return np.asarray(-np.einsum("vij,vi->vj", views[:, :3, :3], views[:, :3, 3]))
