"""A few cameras with small pictures, by which scales of colour and of grey are chosen."""

from __future__ import annotations

from collections.abc import Sequence

from rift_cl.commands.cameras.camera_path import resized
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera

# How many cameras are looked through, and the longer edge of what they see in pixels.
LOOKS, _EDGE = 8, 64


def small_looks(cameras: Sequence[Camera], edge: int = _EDGE) -> list[Camera]:
    """Evenly spaced ones of the cameras, with pictures of a size that takes no time to draw.

    Args:
        cameras: all of them.
        edge: pixels of a picture's longer edge at most.
    """
    return [_small(cameras[number], edge) for number in evenly(len(cameras), LOOKS)]


def _small(camera: Camera, edge: int) -> Camera:
    share = min(1.0, edge / max(camera.size))
    return resized(
        camera, (max(1, round(share * camera.height)), max(1, round(share * camera.width)))
    )
