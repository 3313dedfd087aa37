"""A camera's way from key frame to key frame, as 'rift render --path' takes it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from rift_cl.commands.cameras.camera_path import smooth_path
from rift_cl.commands.view.pose import Pose
from rift_cl.geometry import Aperture, Camera
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import json_text


@dataclass(frozen=True)
class KeyFrame:
    """Where a page's camera was, and its lens; None for a pinhole."""

    pose: Pose
    aperture: Aperture | None = None

    def camera(self, aspect: float, edge: int) -> Camera:
        """The camera of a picture with this width by height, and so many pixels along an edge."""
        seen = dataclasses.replace(self.pose, aspect=aspect).camera(edge)
        return Camera(seen.size, seen.K, seen.view, seen.model, self.aperture)


def way_through(keys: Sequence[KeyFrame], between: int, edge: int) -> list[Camera]:
    """The cameras of a way.

    Args:
        keys: one or more; the first one's window gives the shape of all pictures.
        between: frames between each two of them.
        edge: longer edge of a picture in pixels.

    Raises:
        InputError: a pose makes no sense.
    """
    cameras = [key.camera(keys[0].pose.aspect, edge) for key in keys]
    return smooth_path(cameras, between)


def path_file(cameras: Sequence[Camera]) -> bytes:
    """The content of a transforms.json of these cameras."""
    names = [f"{number:04}.png" for number in range(len(cameras))]
    return json_text(transforms_of(cameras, names)).encode()
