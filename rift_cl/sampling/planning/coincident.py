"""Part views that stand at the same place, so that they can move away from each other.

A greedy choice may take a candidate twice. Coincident have equal derivatives: whatever moves them
by those moves them together. So do views that lie opposite each other, which see the same slices.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.candidates import allowed
from rift_cl.sampling.planning.design_space import AZIMUTH, ELEVATION, DesignSpace
from rift_cl.sampling.planning.view_table import ViewTable

Floats = NDArray[np.float64]
# How far twins are moved at first, in spacings of evenly spread views, and in which ways: towards
# sides that a golden angle parts, for as long as one is allowed. What is nearer than
# a part of that step belongs to twins.
_STEP, _WAYS, _NEAR, _GOLDEN = 0.05, 8, 0.25, math.pi * (3 - math.sqrt(5))


def parted(design: DesignSpace, views: ViewTable, spacing: float) -> ViewTable:
    """The views, each that stands where one before it does (or opposite) a little aside.

    Args:
        design: whose elevations, azimuths and keep-outs are kept to.
        views: free ones.
        spacing: radians from a view to the next where they are spread evenly.

    Returns:
        As many views; the very same ones if no two are twins. A twin with no room stays.
    """
    near = _NEAR * _STEP * spacing
    twins = np.flatnonzero(np.tril(_like(design, views, near)).any(1)).tolist()
    if not twins:
        return views
    table = views.table
    for count, index in enumerate(twins):
        for way in range(_WAYS):
            trial = table.copy()
            trial[index] = _aside(design, table[index], spacing * _STEP, (count + way) * _GOLDEN)
            moved = ViewTable(views.kind, trial)
            if (
                not _like(design, moved, near)[index].any()
                and allowed(design, moved.take([index])).all()
            ):
                table = trial
                break
    return ViewTable(views.kind, table)


def _like(design: DesignSpace, views: ViewTable, near: float) -> NDArray[np.bool_]:
    """(V, V) which stand nearer to another, or to what is opposite, than some radians."""
    outward = views.frames(design)[:, 0]
    same = np.abs(outward @ outward.T) > math.cos(near)
    np.fill_diagonal(same, False)
    return np.asarray(same)


def _aside(design: DesignSpace, row: Floats, step: float, way: float) -> Floats:
    """A row of a table with its azimuth and elevation moved, within their limits."""
    moved = row.copy()
    (first, last), (low, high) = design.constraints.azimuth, design.constraints.elevation
    moved[ELEVATION] = np.clip(row[ELEVATION] + step * math.sin(way), low, high)
    level = max(math.cos(row[ELEVATION]), step)
    moved[AZIMUTH] = row[AZIMUTH] + step * math.cos(way) / level
    if not design.constraints.full_circle:
        moved[AZIMUTH] = np.clip(moved[AZIMUTH], first, last)
    return moved
