"""Separates coincident views, so that gradient steps can move them apart.

A greedy choice may take a candidate twice. Coincident views have identical gradients, so gradient
steps never separate them. The same holds for opposite views, which sample the same slices.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.candidates import allowed
from rift_cl.sampling.planning.design_space import AZIMUTH, ELEVATION, DesignSpace
from rift_cl.sampling.planning.view_table import ViewTable

Floats = NDArray[np.float64]
# The step that separates coincident views, in spacings of evenly spread views, and the number of
# directions that are tried, a golden angle apart, until one is allowed. Views that are nearer than
# a fraction _NEAR of that step are coincident.
_STEP, _WAYS, _NEAR, _GOLDEN = 0.05, 8, 0.25, math.pi * (3 - math.sqrt(5))


def parted(design: DesignSpace, views: ViewTable, spacing: float) -> ViewTable:
    """The views, each that coincides with an earlier one (or is opposite to it) moved a little.

    Args:
        design: whose elevations, azimuths and keep-outs are kept to.
        views: free ones.
        spacing: radians from a view to the next where they are spread evenly.

    Returns:
        As many views; the same ones if no two coincide. One that has no room to move stays.
    """
    near = _NEAR * _STEP * spacing
    coincident = np.flatnonzero(np.tril(_like(design, views, near)).any(1)).tolist()
    if not coincident:
        return views
    table = views.table
    for count, index in enumerate(coincident):
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
    """(V, V) which are nearer to another, or to its opposite, than ``near`` radians."""
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
