"""Where the camera of a page is, and the camera that we draw it with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.commands.cameras.camera_path import pinhole
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.io.captures.poses import view_of_quaternion

# Windows narrower or wider than this are drawn as if they were not.
NARROWEST = 0.1


@dataclass(frozen=True)
class Pose:
    """Where the camera of a page is, as viser says it.

    Args:
        wxyz: camera-to-world rotation as a quaternion; the axes are OpenCV's.
        position: of the camera in world coordinates.
        fov: vertical field of view in radians.
        aspect: width of the window divided by its height.
    """

    wxyz: tuple[float, ...]
    position: tuple[float, ...]
    fov: float
    aspect: float

    @classmethod
    def said(
        cls, wxyz: ArrayLike, position: ArrayLike, fov: float, height: float, width: float
    ) -> Pose:
        """What a page says, which is not ours to trust.

        Raises:
            InputError: it is no pose.
        """
        try:
            turn, place = np.asarray(wxyz, np.float64), np.asarray(position, np.float64)
            angle = float(fov)
            aspect = float(width) / float(height) if height > 0 < width else 1.0
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"the page's camera is no pose: {error}") from error
        if turn.shape != (4,) or place.shape != (3,):
            raise InputError(f"the page's camera has shapes {turn.shape} and {place.shape}")
        return cls(tuple(turn.tolist()), tuple(place.tolist()), angle, aspect)

    def camera(self, edge: int) -> Camera:
        """The camera for a picture of which the longer edge has so many pixels.

        Raises:
            InputError: the page says nonsense.
        """
        aspect = min(max(self.aspect, NARROWEST), 1 / NARROWEST)
        height, width = edge / max(aspect, 1), edge * min(aspect, 1)
        size = max(1, round(height)), max(1, round(width))
        if not 0 < self.fov < np.pi:
            raise InputError(f"the page's field of view is {self.fov}, wanted 0 to pi")
        # A quaternion turned about is the inverse rotation.
        w, x, y, z = self.wxyz
        view = view_of_quaternion((w, -x, -y, -z), (0, 0, 0))
        with np.errstate(all="ignore"):
            view[:3, 3] = -view[:3, :3] @ np.asarray(self.position, np.float64)
        return pinhole(size, float(np.degrees(self.fov)), view)
