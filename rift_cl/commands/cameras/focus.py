"""Focus of cameras: the point nearest to their axes, if it lies within their view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera
from rift_cl.train.start.points import axes_meet, focus_of

Floats = NDArray[np.float64]

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
