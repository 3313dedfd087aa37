"""Focus of cameras: the point nearest to their axes, if it lies within their view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera
from rift_cl.train.start.points import focus_of

Floats = NDArray[np.float64]

# Root mean square angle by which axes miss a point, as a share of the spread of directions.
_MISSED = 0.6
# Cameras and points that are looked at.
_CAMERAS, _POINTS = 64, 20_000
# What is nearer, or farther off, than these shares of the points that a camera sees is not among
# what it looks at.
_NEAR, _FAR = 0.02, 0.98


def focus_among(cameras: Sequence[Camera], points: NDArray[np.float32] | None) -> Floats:
    """Focus of the cameras, (3,).

    Axes that do not meet leave the depth of the point nearest to them to chance. Where it is not
    among the sparse points, the median depth of those takes its place; without points, it is put
    as far before the cameras as they are spread.

    Args:
        cameras: one or more.
        points: (P, 3) sparse points of the scene, or None.
    """
    focus = focus_of(cameras)
    few = [cameras[k] for k in evenly(len(cameras), _CAMERAS)]
    depths = np.array([float(c.view[2, :3] @ focus + c.view[2, 3]) for c in few])
    spans = _depths_seen(few, points)
    if spans is None:
        if len(few) == 1 or axes_meet(few, focus):
            return focus
        centers = np.array([camera.center for camera in few])
        spread = float(np.linalg.norm(centers - centers.mean(axis=0), axis=1).max()) or 1.0
        return _ahead(few, np.full(len(few), spread))
    near, middle, far = spans.T
    among = np.mean((depths >= near) & (depths <= far))
    return focus if among >= 0.5 else _ahead(few, middle)


def axes_meet(cameras: Sequence[Camera], focus: Floats) -> bool:
    """Whether the axes of cameras meet near a point, in front of them.

    They do if their axes turn with the directions in which they see it: if they miss it by angles
    that are small beside the spread of those directions.
    """
    ways = focus - np.array([camera.center for camera in cameras])
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-300)
    axes = np.array([camera.view[2, :3] for camera in cameras])
    mean = ways.mean(axis=0) / (np.linalg.norm(ways.mean(axis=0)) or 1.0)
    # One less the cosine is half the square of a small angle.
    missed, spread = np.mean(1 - (ways * axes).sum(axis=1)), np.mean(1 - ways @ mean)
    return bool(missed < _MISSED**2 * spread)


def _depths_seen(cameras: Sequence[Camera], points: NDArray[np.float32] | None) -> Floats | None:
    """Nearest, median and farthest depth (V, 3) of the points in each picture; None without."""
    if points is None or len(points) == 0:
        return None
    some = np.asarray(points[evenly(len(points), _POINTS)], np.float64)
    rows = []
    for camera in cameras:
        local = some @ camera.view[:3, :3].T + camera.view[:3, 3]
        local = local[local[:, 2] > 0]
        fx, fy, cx, cy = camera.intrinsics
        x, y = local[:, 0] / local[:, 2] * fx + cx, local[:, 1] / local[:, 2] * fy + cy
        inside = (x > 0) & (x < camera.width) & (y > 0) & (y < camera.height)
        if not inside.any():
            return None
        rows.append(np.quantile(local[inside, 2], (_NEAR, 0.5, _FAR)))
    return np.array(rows)


def _ahead(cameras: Sequence[Camera], depths: Floats) -> Floats:
    """The mean of the points on the axes at these depths."""
    ends = [c.center + depth * c.view[2, :3] for c, depth in zip(cameras, depths, strict=True)]
    return np.asarray(np.mean(ends, axis=0))
