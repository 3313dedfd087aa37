"""A camera's way from key frame to key frame, as 'rift render --path' takes it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from rift_cl.geometry import Camera
from rift_cl.io.output import json_text
from rift_cl.io.transforms_record import transforms_of
from rift_cl.jobs.camera_path import smooth_path
from rift_cl.jobs.viewing.pose import Pose


def way_through(keys: Sequence[Pose], between: int, edge: int) -> list[Camera]:
    """The cameras of a way.

    Args:
        keys: one or more; the first one's window gives the shape of all pictures.
        between: frames between each two of them.
        edge: longer edge of a picture in pixels.

    Raises:
        InputError: a pose makes no sense.
    """
    shape = keys[0].aspect
    cameras = [dataclasses.replace(key, aspect=shape).camera(edge) for key in keys]
    return smooth_path(cameras, between)


def path_file(cameras: Sequence[Camera]) -> bytes:
    """The content of a transforms.json of these cameras."""
    names = [f"{number:04}.png" for number in range(len(cameras))]
    return json_text(transforms_of(cameras, names)).encode()
