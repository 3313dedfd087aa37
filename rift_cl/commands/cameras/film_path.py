"""The camera path of a film, and the first view of a viewer: close to the capture's cameras.

A ring of cameras gives an orbit at their distance and elevation. Cameras on one side give a path
there and back along them, which never leaves the region that they cover: what is behind is unknown.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.cameras.arc import Arc, arc_of
from rift_cl.commands.cameras.camera_path import orbit, orbit_distance, pinhole
from rift_cl.commands.cameras.route import looked_at, route_through
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.geometry.pose import look_at

Floats = NDArray[np.float64]

# What an orbit is where no camera says.
_ELEVATION, _FOV, _SIZE = 20.0, 45.0, (480, 640)
# Share of a route at either end that a film leaves out.
_ENDS = 0.1
# Nearer to the zenith than this cosine, up is what the cameras' pictures have above.
_STEEP = 0.97


def film(
    bounds: SceneBounds,
    *,
    frames: int,
    size: tuple[int, int],
    fov: float,
    elevation: float | None = None,
    distance: float | None = None,
    subject: Floats | None = None,
) -> list[Camera]:
    """The cameras of a film; the last is one step before the first, so that it closes.

    Args:
        bounds: what is looked at, and the cameras that did.
        frames: how many.
        size: (height, width) in pixels.
        fov: vertical field of view in degrees.
        elevation: above the horizon in degrees; that of the cameras if not given.
        distance: from the middle in scene units; that of the cameras if not given.
        subject: (3,) what a film from one side looks at, if cameras stand about something; what
            their axes pass nearest to if not given.
    """
    arc = capture_arc(bounds)
    if arc is None or arc.closed:
        rise, away = orbit_place(bounds, size, fov, elevation, distance)
        return orbit(bounds, frames=frames, elevation=rise, distance=away, size=size, fov=fov)
    route = route_through(bounds.cameras, bounds.center, about=arc.inward)
    # There and back, slower at the ends, and not up to them: from there few others looked.
    shares = 0.5 - (0.5 - _ENDS) * np.cos(2 * np.pi * np.arange(frames) / frames)
    places, targets = route.at(shares)
    if arc.inward:
        # Some looked past the subject; all of them together tell where it is.
        aim = bounds.center if subject is None else subject
        targets = np.broadcast_to(aim, targets.shape)
    if elevation is not None or distance is not None:
        places = np.array([_moved(at, bounds, elevation, distance) for at in places])
    return [
        pinhole(size, fov, _upright(at, target, bounds))
        for at, target in zip(places, targets, strict=True)
    ]


def orbit_place(
    bounds: SceneBounds,
    size: tuple[int, int],
    fov: float,
    elevation: float | None,
    distance: float | None,
) -> tuple[float, float]:
    """Elevation in degrees and distance of an orbit; those of the cameras if not given."""
    rise = _usual(elevation, _usual(bounds.elevation, _ELEVATION))
    return rise, distance or orbit_distance(bounds, size, fov)


def capture_arc(bounds: SceneBounds) -> Arc | None:
    """Arc of the capture's cameras; None if they are not known."""
    return arc_of(bounds.cameras, bounds.center, bounds.up) if bounds.cameras else None


def first_view(bounds: SceneBounds) -> tuple[Camera, Floats]:
    """The viewer's first camera, and its focus (3,).

    A photograph's camera, the one in the middle of the capture; where nobody knows the cameras,
    that of an orbit.
    """
    if bounds.cameras:
        camera = middle_of(bounds)
        return camera, looked_at(camera, bounds.center)
    return film(bounds, frames=1, size=_SIZE, fov=_FOV)[0], bounds.center


def middle_of(bounds: SceneBounds) -> Camera:
    """The camera whose place and aim are nearest to those of all others."""
    ends = np.array([(c.center, looked_at(c, bounds.center)) for c in bounds.cameras])
    apart = np.linalg.norm(ends - np.median(ends, axis=0), axis=2).sum(axis=1)
    return bounds.cameras[int(apart.argmin())]


def frame_of(
    bounds: SceneBounds, size: tuple[int, int] | None, fov: float | None
) -> tuple[tuple[int, int], float]:
    """Size (height, width) and vertical field of view in degrees of a film's frames.

    Where the cameras are known, a frame has the shape of their photographs, and none shows more to
    any side than they did.

    Args:
        bounds: the cameras.
        size: what was asked for, or None.
        fov: what was asked for, or None.
    """
    if not bounds.cameras:
        return size or _SIZE, fov or _FOV
    camera = middle_of(bounds)
    fx, fy = camera.intrinsics[:2]
    longer = max(_SIZE)
    shrunk = longer / max(camera.size)
    # Films want even edges.
    own = (
        max(2, 2 * round(camera.height * shrunk / 2)),
        max(2, 2 * round(camera.width * shrunk / 2)),
    )
    size = size or own
    if fov is not None or camera.model != "pinhole":
        return size, fov or _FOV
    half = min(camera.height / fy, camera.width / fx * size[0] / size[1]) / 2
    return size, math.degrees(2 * math.atan(half))


def farthest_from_cameras(path: list[Camera], bounds: SceneBounds) -> float | None:
    """The largest angle between a frame and the nearest camera, in degrees at the middle."""
    if not bounds.cameras:
        return None
    ways = [np.array([c.center for c in some]) - bounds.center for some in (path, bounds.cameras)]
    units = [way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300) for way in ways]
    nearest = np.clip(units[0] @ units[1].T, -1, 1).max(axis=1)
    return float(np.degrees(np.arccos(nearest.min())))


def _usual(given: float | None, usual: float) -> float:
    return usual if given is None else given


def _moved(
    place: Floats, bounds: SceneBounds, elevation: float | None, distance: float | None
) -> Floats:
    """A place at another elevation or distance, in the same horizontal direction."""
    way, up = place - bounds.center, bounds.up
    length = float(np.linalg.norm(way))
    rise = math.asin(float(np.clip(way @ up / length, -1, 1))) if length else 0.0
    rise = rise if elevation is None else math.radians(elevation)
    flat = way - (way @ up) * up
    flat = flat / (np.linalg.norm(flat) or 1.0)
    length = distance or length
    return np.asarray(bounds.center + length * (math.cos(rise) * flat + math.sin(rise) * up))


def _upright(place: Floats, target: Floats, bounds: SceneBounds) -> Floats:
    """The pose of a camera that is held upright, or as the nearest camera was if it looks down."""
    forward = target - place
    up, length = bounds.up, float(np.linalg.norm(forward))
    if not length:
        raise InputError("the film's camera stands at what it looks at: give a --distance")
    if abs(forward @ up) > _STEEP * length:
        nearest = min(bounds.cameras, key=lambda c: float(np.linalg.norm(c.center - place)))
        up = -nearest.view[1, :3]
    return look_at(place, target, up)
