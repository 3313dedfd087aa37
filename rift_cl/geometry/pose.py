"""World-to-camera matrices of cameras that are pointed at something."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import real_numbers


def look_at(center: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """World-to-camera matrix (4, 4) of a camera that looks at a point, upright.

    Raises:
        InputError: the camera stands at the point, or looks along ``up``.
        ShapeError: one of them is not three finite numbers.
    """
    place, above = _three("center", center), _three("up", up)
    forward = _three("target", target) - place
    right = np.cross(forward, above)
    ahead, across = float(np.linalg.norm(forward)), float(np.linalg.norm(right))
    if ahead == 0:
        raise InputError(f"a camera at {place.tolist()} cannot look at the point it stands at")
    if not above.any():
        raise InputError("up is [0, 0, 0], wanted a direction")
    if not across > 1e-9 * ahead * float(np.linalg.norm(above)):
        raise InputError("a camera that looks straight up or down has no upright position")
    forward, right = forward / ahead, right / across
    view = np.eye(4)
    view[:3, :3] = [right, np.cross(forward, right), forward]
    view[:3, 3] = -view[:3, :3] @ place
    return view


def _three(name: str, values: ArrayLike) -> NDArray[np.float64]:
    numbers = real_numbers(values)
    if numbers is None or numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ShapeError(f"look_at: {name} is {values!r}, wanted three finite numbers")
    return numbers
