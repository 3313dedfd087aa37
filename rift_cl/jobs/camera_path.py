"""Ways of a camera through a scene: round it, or from pose to pose of a capture."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.geometry.pose import look_at
from rift_cl.jobs.scene_bounds import SceneBounds

Floats = NDArray[np.float64]

# An orbit leaves so much room round the scene.
_ROOM = 1.05


def pinhole(size: tuple[int, int], fov: float, view: ArrayLike) -> Camera:
    """A camera of (height, width) pixels with a vertical field of view in degrees."""
    height, width = size
    focal = height / 2 / math.tan(math.radians(fov) / 2)
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(size, K, view)


def orbit_distance(bounds: SceneBounds, size: tuple[int, int], fov: float) -> float:
    """How far off the whole ball is seen: where the cameras stood, if that is known."""
    if bounds.distance is not None:
        return bounds.distance
    height, width = size
    half = math.tan(math.radians(fov) / 2) * min(1.0, width / height)
    return _ROOM * bounds.radius / math.sin(math.atan(half))


def orbit(
    bounds: SceneBounds,
    *,
    frames: int,
    elevation: float,
    distance: float,
    size: tuple[int, int],
    fov: float,
) -> list[Camera]:
    """Cameras on a circle about the scene, evenly spaced, that look at its middle.

    Args:
        bounds: where the scene lies.
        frames: how many; the last is one step before the first, so that the film closes.
        elevation: above the horizon in degrees.
        distance: from the middle, in scene units.
        size: (height, width) in pixels.
        fov: vertical field of view in degrees.
    """
    up = bounds.up
    along = np.eye(3)[np.abs(up).argmin()]
    second = np.cross(up, along) / np.linalg.norm(np.cross(up, along))
    first = np.cross(second, up)
    rise = math.radians(elevation)
    cameras = []
    for angle in np.arange(frames) * 2 * np.pi / frames:
        flat = np.cos(angle) * first + np.sin(angle) * second
        center = bounds.center + distance * (np.cos(rise) * flat + np.sin(rise) * up)
        cameras.append(pinhole(size, fov, look_at(center, bounds.center, up)))
    return cameras


def resized(camera: Camera, size: tuple[int, int]) -> Camera:
    """The same vertical field of view on another (height, width), pixels square as they were."""
    fx, fy, cx, cy = camera.intrinsics
    scale = size[0] / camera.height
    cx = size[1] / 2 + (cx - camera.width / 2) * scale
    K = np.array([[fx * scale, 0, cx], [0, fy * scale, cy * scale], [0, 0, 1]])
    return Camera(size, K, camera.view, camera.model, camera.aperture)


def smooth_path(cameras: Sequence[Camera], between: int) -> list[Camera]:
    """The cameras, with so many more between each two: positions on a spline, rotations turned.

    Positions lie on a uniform Catmull-Rom spline through the given ones (Catmull and Rom 1974)
    whose ends go straight on; rotations turn evenly about one axis from each to the next (slerp,
    Shoemake 1985); focal lengths and principal points change evenly.

    Raises:
        InputError: two cameras differ in size or model, so that no picture lies between them.
    """
    if any(c.size != cameras[0].size or c.model != cameras[0].model for c in cameras):
        raise InputError("--between wants views of one size and model: give --size, or leave it")
    centers = np.array([camera.center for camera in cameras])
    ends = (2 * centers[0] - centers[1], 2 * centers[-1] - centers[-2]) if len(cameras) > 1 else ()
    knots = np.array([ends[0], *centers, ends[1]]) if ends else centers
    path = []
    for number, (a, b) in enumerate(itertools.pairwise(cameras)):
        for way in np.arange(between + 1) / (between + 1):
            center = _spline(knots[number : number + 4], float(way))
            path.append(a if way == 0 else _between(a, b, float(way), center))
    return [*path, cameras[-1]]


def _spline(knots: Floats, way: float) -> Floats:
    """A point between the two middle ones of four."""
    before, start, end, after = knots
    return np.asarray(
        start
        + way / 2 * (end - before)
        + way**2 / 2 * (2 * before - 5 * start + 4 * end - after)
        + way**3 / 2 * (3 * start - before - 3 * end + after)
    )


def _between(a: Camera, b: Camera, way: float, center: Floats) -> Camera:
    from scipy.spatial.transform import Rotation

    first, second = (Rotation.from_matrix(camera.view[:3, :3]) for camera in (a, b))
    turn = (second * first.inv()).as_rotvec()
    view = np.eye(4)
    view[:3, :3] = (Rotation.from_rotvec(way * turn) * first).as_matrix()
    view[:3, 3] = -view[:3, :3] @ center
    return Camera(a.size, (1 - way) * a.K + way * b.K, view, a.model)


def transforms_of(cameras: Sequence[Camera], names: Sequence[str]) -> dict[str, Any]:
    """The cameras as a transforms.json in nerfstudio's convention.

    Args:
        cameras: pinholes.
        names: of their pictures, relative to the file.
    """
    frames = []
    for camera, name in zip(cameras, names, strict=True):
        pose = np.linalg.inv(camera.view)
        pose[:3, 1:3] *= -1
        fx, fy, cx, cy = camera.intrinsics
        size = {"w": camera.width, "h": camera.height}
        lens = {"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, **size}
        frames.append({"file_path": name, **lens, "transform_matrix": pose})
    return {"camera_model": "PINHOLE", "frames": frames}
