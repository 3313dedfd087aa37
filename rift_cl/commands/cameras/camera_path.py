"""Camera paths in general: an orbit round a scene, and a smooth path from pose to pose.

Which of them a film takes is decided in ``film_path``.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.commands.cameras.arc import across
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera
from rift_cl.geometry.pose import look_at
from rift_cl.io.captures.view import Capture, View

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
    up, first = bounds.up, across(bounds.up)
    second = np.cross(up, first)
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


def in_film_order(capture: Capture) -> list[View]:
    """The views in the order of a film: that of the file, or of names where it has none.

    A COLMAP model lists photographs by their names, by which fits hold some of them out: frame10
    stands before frame2. Along a film the numbers in names count.
    """
    if not capture.path.is_dir():
        return list(capture.views)
    return sorted(capture.views, key=lambda view: (_parts(view.name), view.name))


def _parts(name: str) -> list[tuple[int, str]]:
    """Text and numbers of a name by turns; numbers by their digits, which may be many."""
    parts = re.split(r"([0-9]+)", name)
    digits = [part.lstrip("0") for part in parts[1::2]]
    parts[1::2] = digits
    return [(len(part) if k % 2 else 0, part) for k, part in enumerate(parts)]


def smooth_path(cameras: Sequence[Camera], between: int) -> list[Camera]:
    """The cameras with interpolated ones between: spline positions, interpolated rotations.

    Positions lie on a uniform Catmull-Rom spline through the given ones (Catmull and Rom 1974)
    whose ends go straight on; rotations turn evenly about one axis from each to the next (slerp,
    Shoemake 1985); focal lengths, principal points and apertures change evenly.

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
    return Camera(a.size, (1 - way) * a.K + way * b.K, view, a.model, _opening(a, b, way))


def _opening(a: Camera, b: Camera, way: float) -> Aperture | None:
    """Radius and inverse focus change evenly; a pinhole has the radius 0 and the other's focus."""
    first, second = a.aperture or b.aperture, b.aperture or a.aperture
    if first is None or second is None:
        return None
    radii = [0.0 if camera.aperture is None else camera.aperture.radius for camera in (a, b)]
    near = (1 - way) / first.focus + way / second.focus
    wavelength = (1 - way) * first.wavelength + way * second.wavelength
    radius = (1 - way) * radii[0] + way * radii[1]
    return Aperture(radius, 1 / near if near else math.inf, wavelength)


def opened(camera: Camera, radius: float | None, focus: float | None, middle: Floats) -> Camera:
    """A camera with another aperture or focus.

    Args:
        camera: with an aperture or without.
        radius: of the aperture, 0 for none; the camera's own if not given.
        focus: the depth that is sharp; the camera's own, or that of the middle, if not given.
        middle: (3,) of the scene.

    Raises:
        InputError: the middle is behind the camera, and no focus is given.
    """
    own = camera.aperture
    if radius is None:
        radius = 0.0 if own is None else own.radius
    if radius == 0:
        return Camera(camera.size, camera.K, camera.view, camera.model)
    if focus is None:
        depth = float(camera.view[2, :3] @ middle + camera.view[2, 3])
        focus = depth if own is None else own.focus
    if focus <= 0:
        raise InputError("--aperture wants --focus: the scene's middle is behind a camera")
    lens = Aperture(radius, focus, 0.0 if own is None else own.wavelength)
    return Camera(camera.size, camera.K, camera.view, camera.model, lens)
