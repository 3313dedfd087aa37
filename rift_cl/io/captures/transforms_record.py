"""Cameras as a transforms.json says them, the other way round from ``transforms_json``.

nerfstudio's flavour: each frame has intrinsics of its own and a camera-to-world pose with OpenGL's
axes; the opening of a lens is ``aperture_radius``, ``focus_distance`` and ``wavelength``, what it
distorts ``camera_model`` and its coefficients by COLMAP's names. nerfstudio reads whether cameras
are fisheyes from the top of the file alone, which therefore names the model of all frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rift_cl.errors import InputError
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.lens_distortion import LENS_MODELS, Lens

_PINHOLE, _OPENCV = "PINHOLE", "OPENCV"
_WITHIN_OPENCV = {_PINHOLE, "SIMPLE_RADIAL", "RADIAL", _OPENCV}


def transforms_of(
    cameras: Sequence[Camera], names: Sequence[str], fields: Sequence[Mapping[str, Any]] = ()
) -> dict[str, Any]:
    """The cameras as the content of a transforms.json.

    Args:
        cameras: pinholes, with an aperture or without.
        names: of their pictures, relative to the file.
        fields: more of what is known of each camera; readers leave names alone that they do not
            know.

    Raises:
        InputError: a camera is no pinhole, which such a file has no words for.
    """
    for camera, name in zip(cameras, names, strict=True):
        if camera.model != "pinhole":
            raise InputError(
                f"the camera of {name!r} is of the model {camera.model!r}, wanted a pinhole: a "
                "transforms.json has no words for others"
            )
    more = fields or [{}] * len(cameras)
    frames = [_frame(*entry) for entry in zip(cameras, names, more, strict=True)]
    models = {frame.get("camera_model", _PINHOLE) for frame in frames}
    if len(models) > 1:
        frames = [{"camera_model": _PINHOLE, **frame} for frame in frames]
    return {**_top_model(models), "frames": frames}


def lens_fields(lens: Lens | None, crop_radius: float | None = None) -> dict[str, Any]:
    """What a frame says of a lens that distorts; nothing where it does not.

    Args:
        lens: of its photograph.
        crop_radius: of the circle that it fills; None where it fills all of the photograph.
    """
    if lens is None:
        return {}
    names = LENS_MODELS[lens.model]
    circle = {} if crop_radius is None else {"fisheye_crop_radius": crop_radius}
    return {
        "camera_model": lens.model,
        **dict(zip(names, lens.coefficients, strict=True)),
        **circle,
    }


def _top_model(models: set[str]) -> dict[str, str]:
    """The camera model at the top: that of all frames, or one that has them all as special cases.

    Nothing where there is none, as of fisheyes among others.
    """
    if len(models) <= 1:
        return {"camera_model": next(iter(models), _PINHOLE)}
    return {"camera_model": _OPENCV} if models <= _WITHIN_OPENCV else {}


def _frame(camera: Camera, name: str, more: Mapping[str, Any]) -> dict[str, Any]:
    pose = np.linalg.inv(camera.view)
    pose[:3, 1:3] *= -1
    fx, fy, cx, cy = camera.intrinsics
    frame = {"file_path": name, "w": camera.width, "h": camera.height}
    frame |= {"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy}
    lens = camera.aperture
    if lens is not None:
        frame["aperture_radius"] = lens.radius
        if lens.focus < math.inf:
            frame["focus_distance"] = lens.focus
        if lens.wavelength:
            frame["wavelength"] = lens.wavelength
    return {**frame, **more, "transform_matrix": pose}
