"""Simple arrangements that come close to a plan: along the edge, and by the root of the power.

Where cameras keep to a sector, most of what is to be known lies at its edge. Where the power of a
flat target depends on the direction, mean squared error is least for a density of views that is
the root of the power, if each view tells of its own direction alone.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.constraints import Constraints
from rift_cl.sampling.targets.prior import checked_power
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Teeth of zigzags that are tried; points laid along a way, and angles; radii of power.
_TEETH, _LAID, _RADII = (1, 2, 3, 4, 6, 8, 12), 720, 24


def edge_ways(limits: Constraints) -> list[tuple[str, Floats]]:
    """Zigzags between the lowest and the highest elevation, and the edge; (n, 2) angles each.

    Empty where there is but one elevation.
    """
    (first, last), (low, high) = limits.azimuth, limits.elevation
    if high - low < 1e-9 or last - first < 1e-9:
        return []
    found = []
    for teeth in _TEETH:
        turn = np.linspace(first, last, 2 * teeth + 1)
        rise = np.where(np.arange(2 * teeth + 1) % 2, high, low)
        noun = "tooth" if teeth == 1 else "teeth"
        found.append((f"a zigzag of {teeth} {noun}", _laid(np.column_stack([turn, rise]))))
    if not limits.full_circle:
        corners = [(first, low), (last, low), (last, high), (first, high), (first, low)]
        # Its end is where it began.
        found.append(("the edge of what is allowed", _laid(np.array(corners))[:-1]))
    return found


def _laid(corners: Floats) -> Floats:
    """Points evenly spaced along straight paths in azimuth and elevation, by arc length."""
    dense = np.concatenate(
        [np.linspace(a, b, _LAID, endpoint=False) for a, b in itertools.pairwise(corners)]
        + [corners[-1:]]
    )
    step = np.diff(dense, axis=0)
    step[:, 0] *= np.cos((dense[1:, 1] + dense[:-1, 1]) / 2)
    length = np.append(0, np.cumsum(np.linalg.norm(step, axis=1)))
    wanted = np.linspace(0, length[-1], _LAID)
    return np.column_stack([np.interp(wanted, length, column) for column in dense.T])


def quantiles_of_power(target: Target, limits: Constraints, views: int) -> Floats | None:
    """Azimuth and elevation (views, 2) at quantiles of the root of a flat target's power.

    None for other targets, and where cameras may not stand level with it.
    """
    low, high = limits.elevation
    if not target.is_flat or not low <= 0 <= high:
        return None
    first, last = limits.azimuth[0], min(limits.azimuth[1], limits.azimuth[0] + math.pi)
    edges = np.linspace(first, last, _LAID + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    # A view knows what varies across its line of sight.
    across = np.column_stack([-np.sin(middle), np.cos(middle), 0 * middle])
    radii = np.linspace(1 / target.diameter, target.highest, _RADII)
    k = (radii[:, None, None] * across).reshape(-1, 3)
    power = checked_power(target.prior, k, target.diameter).reshape(_RADII, _LAID)
    # Radii stand for areas that grow with them.
    root = np.sqrt((radii[:, None] * power).sum(axis=0))
    sums = np.append(0, np.cumsum(root))
    azimuth = np.interp((np.arange(views) + 0.5) / views * sums[-1], sums, edges)
    return np.column_stack([azimuth, np.zeros(views)])
