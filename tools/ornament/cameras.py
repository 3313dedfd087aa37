"""Where the ornament is seen from: a ring, views off that ring, or any list of cameras.

Poses are camera to world with OpenGL's axes (x right, y up, z backward), as transforms.json has
them, so that what is rendered and what is written down are the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.io.captures.poses import view_of_opengl
from rift_cl.io.captures.view import located
from rift_cl.io.json_fields import Fields, read_json_object

# What the built-in cameras look at, a little above the ball's centre.
TARGET = (0.0, 0.0, 0.07)
_GOLDEN_ANGLE = 180 * (3 - math.sqrt(5))
# Eight elevations and three distances meet in 24 views before one comes again.
_ELEVATIONS = tuple(float(degrees) for degrees in range(2, 31, 4))
_DISTANCES = (5.0, 5.5, 6.0)
_DISTORTION = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture that is to be taken; pixels are square.

    Args:
        pose: (4, 4) camera to world, OpenGL axes.
        size: (height, width) in pixels.
        focal: focal length in pixels.
        center: (cx, cy), the principal point in pixels.
        aperture_radius: of a thin lens, in units of the scene; 0 for a pinhole.
        focus_distance: of what is sharp, along the optical axis.
    """

    pose: NDArray[np.float64]
    size: tuple[int, int]
    focal: float
    center: tuple[float, float]
    aperture_radius: float = 0.0
    focus_distance: float | None = None

    @property
    def camera(self) -> Camera:
        """The same camera as the package sees it, without its aperture."""
        (cx, cy), f = self.center, self.focal
        K = [[f, 0, cx], [0, f, cy], [0, 0, 1]]
        return Camera(self.size, K, view_of_opengl(self.pose[:3]))


def around(
    azimuth: float, elevation: float, distance: float, target: Sequence[float] = TARGET
) -> NDArray[np.float64]:
    """The pose of a camera that looks at a target; angles in degrees, z up."""
    a, e = math.radians(azimuth), math.radians(elevation)
    backward = np.array([math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(backward, right), backward
    pose[:3, 3] = np.array(target) + distance * backward
    return pose


def ring(views: int, elevation: float, distance: float) -> list[NDArray[np.float64]]:
    """Poses on a ring, evenly spaced in azimuth."""
    return [around(360 * k / views, elevation, distance) for k in range(views)]


def off_path(views: int) -> list[NDArray[np.float64]]:
    """Poses off any ring: azimuths by the golden angle, elevations 2 to 30, distances 5 to 6."""
    return [
        around(_GOLDEN_ANGLE * k % 360, _ELEVATIONS[k % len(_ELEVATIONS)], _DISTANCES[k % 3])
        for k in range(views)
    ]


def shots_at(
    poses: Sequence[NDArray[np.float64]], size: tuple[int, int], field: float
) -> list[Shot]:
    """Shots with one centred pinhole lens.

    Args:
        poses: (4, 4) each, camera to world, OpenGL axes.
        size: (height, width) in pixels.
        field: horizontal field of view in degrees.
    """
    height, width = size
    focal = width / 2 / math.tan(math.radians(field) / 2)
    return [Shot(pose, size, focal, (width / 2, height / 2)) for pose in poses]


def shots_of_file(path: Path, size: tuple[int, int] | None = None) -> list[Shot]:
    """The cameras of a transforms.json; its photographs are not looked at.

    Args:
        path: the file.
        size: (height, width) to render at, of the file's proportions; the file's own if None.

    Raises:
        RiftError: the file cannot be used, or has a lens that is not rendered here.
    """
    top = read_json_object(path)
    shots = [_shot(frame, frame.within(top), size) for frame in top.objects("frames")]
    if not shots:
        raise InputError(f"{path}: 'frames' is empty, wanted a camera or more")
    if len({(shot.size, shot.focal, shot.center) for shot in shots}) > 1:
        raise InputError(f"{path}: the frames have several lenses, wanted a file for each")
    return shots


def _shot(own: Fields, fields: Fields, size: tuple[int, int] | None) -> Shot:
    bent = [name for name in _DISTORTION if fields.number(name)]
    if bent or fields.text("camera_model") == "OPENCV_FISHEYE":
        raise InputError(f"{own.where}: has a distorted lens, only pinholes and thin lenses are")
    width, height = _demanded(fields.whole("w"), own, "w"), _demanded(fields.whole("h"), own, "h")
    focal = _focal(own, fields, width)
    cx, cy = fields.number("cx"), fields.number("cy")
    pose = np.eye(4)
    pose[:3] = own.pose("transform_matrix")
    shot = Shot(
        pose,
        (height, width),
        focal,
        (width / 2 if cx is None else cx, height / 2 if cy is None else cy),
        fields.number("aperture_radius") or 0.0,
        fields.number("focus_distance"),
    )
    with located(own.where):
        # The package's own camera says what is wrong with a pose or a lens.
        _ = shot.camera
    return shot if size is None else _scaled(own, shot, size)


def _focal(own: Fields, fields: Fields, width: int) -> float:
    across, down = fields.number("fl_x"), fields.number("fl_y")
    angle = fields.number("camera_angle_x")
    if across is None and angle is not None and 0 < angle < math.pi:
        across = width / 2 / math.tan(angle / 2)
    across = _demanded(across, own, "fl_x")
    if down is not None and abs(down - across) > 1e-6 * across:
        raise InputError(f"{own.where}: 'fl_x' and 'fl_y' differ, pixels must be square")
    return across


def _scaled(own: Fields, shot: Shot, size: tuple[int, int]) -> Shot:
    factor = size[1] / shot.size[1]
    if abs(size[0] - factor * shot.size[0]) > 1e-6:
        raise InputError(
            f"--size is {size[1]} {size[0]}, {own.where} has {shot.size[1]} x {shot.size[0]}: "
            "wanted the same proportions"
        )
    cx, cy = shot.center
    return replace(shot, size=size, focal=factor * shot.focal, center=(factor * cx, factor * cy))


def _demanded(value: Any, own: Fields, name: str) -> Any:
    if value is None:
        raise InputError(f"{own.where}: has no {name!r}")
    return value


def with_aperture(shot: Shot, radius: float | None, focus: float | None) -> Shot:
    """The shot with another aperture or focus; None leaves what it has.

    Raises:
        InputError: there is an aperture and no focus, or one of them makes no sense.
    """
    radius = shot.aperture_radius if radius is None else radius
    focus = shot.focus_distance if focus is None else focus
    if radius < 0 or not math.isfinite(radius):
        raise InputError(f"--aperture-radius is {radius}, wanted 0 (a pinhole) or more")
    if radius and (focus is None or not 0 < focus < math.inf):
        raise InputError(f"--focus-distance is {focus}, an aperture wants a positive one")
    height, width = shot.size
    if radius and shot.center != (width / 2, height / 2):
        raise InputError("--aperture-radius wants the principal point in the picture's middle")
    return replace(shot, aperture_radius=radius, focus_distance=focus if radius else None)


def transforms(shots: Sequence[Shot], suffix: str = ".png", **facts: Any) -> dict[str, Any]:
    """What transforms.json says about shots of one lens; ``facts`` are written beside it."""
    first = shots[0]
    height, width = first.size
    lens = {"w": width, "h": height, "fl_x": first.focal, "fl_y": first.focal}
    lens |= {"cx": first.center[0], "cy": first.center[1]}
    angle = {"camera_angle_x": 2 * math.atan(width / 2 / first.focal)}
    frames = [_frame(number, shot, suffix) for number, shot in enumerate(shots)]
    return {"camera_model": "OPENCV", **lens, **angle, **facts, "frames": frames}


def _frame(number: int, shot: Shot, suffix: str) -> dict[str, Any]:
    frame: dict[str, Any] = {"file_path": f"images/{number:04d}{suffix}"}
    frame["transform_matrix"] = shot.pose.tolist()
    if shot.aperture_radius:
        frame["aperture_radius"] = shot.aperture_radius
        frame["focus_distance"] = shot.focus_distance
    return frame
