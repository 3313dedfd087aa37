"""Cameras as viewers of 3D Gaussian splatting read them: INRIA's ``cameras.json``.

Kerbl et al. 2023, ``utils/camera_utils.py``: a list of objects with the camera's place, its
camera-to-world rotation by rows with OpenCV's axes, and its focal lengths in pixels. The format
has no principal point.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rift_cl.io.captures.view import View


def inria_cameras(views: Sequence[View]) -> list[dict[str, Any]]:
    """The cameras of views as the content of a ``cameras.json``."""
    return [_entry(number, view) for number, view in enumerate(views)]


def _entry(number: int, view: View) -> dict[str, Any]:
    camera = view.camera
    fx, fy, _, _ = camera.intrinsics
    return {
        "id": number,
        "img_name": view.name,
        "width": camera.width,
        "height": camera.height,
        "position": camera.center,
        "rotation": camera.view[:3, :3].T,
        "fy": fy,
        "fx": fx,
    }
