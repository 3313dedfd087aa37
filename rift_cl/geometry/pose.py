"""World-to-camera matrices of cameras that are pointed at something."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError


def look_at(center: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """World-to-camera matrix (4, 4) of a camera that looks at a point, upright.

    Raises:
        InputError: the camera stands at the point, or looks along ``up``.
    """
    place, above = np.asarray(center, np.float64), np.asarray(up, np.float64)
    forward = np.asarray(target, np.float64) - place
    right = np.cross(forward, above)
    ahead, across = float(np.linalg.norm(forward)), float(np.linalg.norm(right))
    if not across > 1e-9 * ahead * float(np.linalg.norm(above)):
        raise InputError("a camera that looks straight up or down has no upright position")
    forward, right = forward / ahead, right / across
    view = np.eye(4)
    view[:3, :3] = [right, np.cross(forward, right), forward]
    view[:3, 3] = -view[:3, :3] @ place
    return view
