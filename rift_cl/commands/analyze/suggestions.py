"""Views to add to those that were taken: the most informative ones that see the target."""

from __future__ import annotations

import math

import numpy as np

from rift_cl.commands.inputs.surfaces import hidden_places, strange_places, surface_of
from rift_cl.commands.inputs.view_set import Floats, ViewSet
from rift_cl.commands.pictures.views_table import angles_of
from rift_cl.geometry import Camera
from rift_cl.geometry.camera_type import CameraType
from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.planning.keep_out import KeepOut
from rift_cl.sampling.planning.planner import next_views
from rift_cl.sampling.targets.observations import coarser_focal

# Highest elevation that is suggested, in degrees.
_HIGH = 75.0
# A pinhole of CameraType's: so small that everything is sharp.
_PINHOLE = 1e4
# Focal length of what stands for a camera, in radii of its opening or distances from the origin:
# so short that its image distance, and with it the scale of its picture, is the same at any focus.
_SHORT = 1e-9
# Share of the target's outline in the picture; those who took the others chose theirs.
_COVER = 0.05


def cameras_to_add(sampled: ViewSet, count: int) -> tuple[Camera, ...]:
    """Cameras like the existing ones, as far away, between their elevations or 0 to 75 degrees.

    For an opaque target none is placed inside or behind the geometry that the views show, or where
    it occludes the target; where the geometry is unknown, none is far from the existing ones.

    Raises:
        InputError: no camera fits there.
    """
    center, up = sampled.target.center, sampled.up
    angles = np.array([angles_of(camera, center, up) for camera in sampled.cameras])
    low, high = min(0.0, float(angles[:, 1].min())), max(_HIGH, float(angles[:, 1].max()))
    distance = usual_distance(sampled)
    target = surface_of(sampled, distance) if sampled.opaque else sampled.target
    closed = _closed(sampled, distance)
    constraints = Constraints(
        elevation=(math.radians(low), math.radians(high)),
        distance=distance,
        keepouts=() if closed is None else (closed,),
        cover=_COVER,
        up=(float(up[0]), float(up[1]), float(up[2])),
    )
    alike = camera_type_of(sampled.cameras[int(np.argsort(angles[:, 2])[len(angles) // 2])])
    found = next_views(sampled.cameras, target, count, constraints, (alike,), compare=False)
    return tuple(found.cameras[place] for place in found.order)


def kept_near(sampled: ViewSet) -> bool:
    """Whether places far from the existing cameras are closed, as nothing is known of them."""
    unknown = sampled.opaque and sampled.space is None
    return unknown and strange_places(sampled, usual_distance(sampled)) is not None


def _closed(sampled: ViewSet, distance: float) -> KeepOut | None:
    """Where no camera is suggested; None for nowhere."""
    if not sampled.opaque:
        return None
    if sampled.space is None:
        return strange_places(sampled, distance)
    return hidden_places(sampled, distance, distance)


def usual_distance(sampled: ViewSet) -> float:
    """Median distance of the cameras from the target's centre."""
    away = np.array([camera.center for camera in sampled.cameras]) - sampled.target.center
    return float(np.median(np.linalg.norm(away, axis=1)))


def camera_type_of(camera: Camera) -> CameraType:
    """What a camera is, but for its scale: the same field of view, pixels and opening.

    Pixels that are no squares become squares as long as their longer edge. A pinhole's picture
    says nothing of the size of its sensor; a small one is taken, which is in focus wherever it
    looks.
    """
    lens, far = camera.aperture, float(np.linalg.norm(camera.center)) + 1.0
    image = _SHORT * (lens.radius if lens is not None else far)
    fx, fy = camera.intrinsics[:2]
    focal = coarser_focal(camera)
    size = round(camera.height * focal / fy), round(camera.width * focal / fx)
    return CameraType(
        "as at hand",
        focal_length=image,
        f_number=_PINHOLE if lens is None else image / (2 * lens.radius),
        pixel=image / focal,
        size=(max(1, size[0]), max(1, size[1])),
        wavelength=0.0 if lens is None else lens.wavelength,
    )


def angles_to_add(angles: Floats, count: int) -> tuple[float, list[float]]:
    """The largest gap between directions of a scan, and the middles of the largest ones.

    Args:
        angles: radians; half a turn on, a direction is the same.
        count: how many to add, one after the other.

    Returns:
        The gap and the angles to add, in degrees from 0 to 180.
    """
    known = np.mod(angles, np.pi).tolist()
    added: list[float] = []
    largest = 0.0
    for step in range(max(count, 1)):
        order = sorted(known)
        gaps = np.diff([*order, order[0] + np.pi])
        place = int(gaps.argmax())
        largest = largest if step else float(gaps[place])
        middle = (order[place] + gaps[place] / 2) % np.pi
        known.append(middle)
        added.append(math.degrees(middle))
    return math.degrees(largest), added[:count]
