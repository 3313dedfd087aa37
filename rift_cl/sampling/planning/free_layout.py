"""Views that move each for itself: what the refinement moves if there is no path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.design_space import (
    AZIMUTH,
    COLUMNS,
    DISTANCE,
    ELEVATION,
    EXPOSURE,
    F_NUMBER,
    FOCAL,
    FOCUS,
    DesignSpace,
)
from rift_cl.sampling.planning.view_table import ViewTable

Floats = NDArray[np.float64]
# Azimuths turn in steps that grow towards the poles, up to this much.
_FLATTEST = 0.05
# How far a view may turn, in spacings of views spread over what is allowed.
_TRUST = 1.0


@dataclass(frozen=True, eq=False)
class FreeLayout:
    """Every number of every view that is not fixed.

    Angles are counted from the start; distance and f-number by their logarithms; the focal length
    as a share of the way from the shortest to the longest that has the target in the picture; focus
    in target diameters; exposure in its longest.

    Args:
        site: where the views are.
        begin: the views at the start.
    """

    design: DesignSpace
    begin: ViewTable

    @cached_property
    def trust(self) -> float:
        """How far views may turn, in radians."""
        (first, last), (low, high) = (
            self.design.constraints.azimuth,
            self.design.constraints.elevation,
        )
        area = (last - first) * (math.sin(high) - math.sin(low))
        if area < 1e-9:
            return _TRUST * max(last - first, high - low) / max(1, len(self.begin) - 1)
        return min(1.0, _TRUST * math.sqrt(area / len(self.begin)))

    @property
    def reach(self) -> float:
        """How far a camera may move at the most."""
        near, far = (
            self.design.limits[:, DISTANCE, 0].min(),
            self.design.limits[:, DISTANCE, 1].max(),
        )
        return float(2 * self.trust * far + far - near)

    @cached_property
    def _limits(self) -> Floats:
        """(V, 7, 2) of every view's numbers."""
        limits = self.design.limits[self.begin.kind].copy()
        level = self._level[:, None]
        table = self.begin.table
        if self.design.constraints.full_circle:
            limits[:, AZIMUTH] = table[:, [AZIMUTH]] + np.array([-math.pi, math.pi])
        limits[:, AZIMUTH] = (limits[:, AZIMUTH] - table[:, [AZIMUTH]]) * level
        limits[:, ELEVATION] -= table[:, [ELEVATION]]
        angles = [AZIMUTH, ELEVATION]
        limits[:, angles] = np.clip(limits[:, angles], -self.trust, self.trust)
        limits[:, [DISTANCE, F_NUMBER]] = np.log(limits[:, [DISTANCE, F_NUMBER]])
        fixed = limits[:, FOCAL, 1] <= limits[:, FOCAL, 0]
        limits[:, FOCAL] = [0, 1]
        limits[fixed, FOCAL, 1] = 0
        limits[:, FOCUS] /= self.design.target.diameter
        limits[:, EXPOSURE] /= limits[:, EXPOSURE, 1:].copy()
        return limits

    @cached_property
    def _moved(self) -> NDArray[np.bool_]:
        """(V, 7) which numbers are free."""
        limits = self._limits
        return np.asarray(limits[..., 1] - limits[..., 0] > 1e-9)

    @cached_property
    def _level(self) -> Floats:
        return np.maximum(np.cos(self.begin.table[:, ELEVATION]), _FLATTEST)

    @cached_property
    def _all(self) -> Floats:
        """(V, 7) the numbers at the start, fixed ones among them."""
        table, numbers = self.begin.table, np.zeros_like(self.begin.table)
        numbers[:, [DISTANCE, F_NUMBER]] = np.log(table[:, [DISTANCE, F_NUMBER]])
        shortest = self.design.limits[self.begin.kind, FOCAL, 0]
        room, _, _ = self._room(table)
        share = (table[:, FOCAL] - shortest) / np.where(room > 0, room, 1)
        numbers[:, FOCAL] = np.where(self._limits[:, FOCAL, 1] > 0, np.clip(share, 0, 1), 0)
        numbers[:, FOCUS] = table[:, FOCUS] / self.design.target.diameter
        numbers[:, EXPOSURE] = table[:, EXPOSURE] / self.design.limits[self.begin.kind, EXPOSURE, 1]
        return numbers

    def _room(self, table: Floats) -> tuple[Floats, Floats, Floats]:
        """Focal lengths from the shortest to the longest allowed; by distance, by focus."""
        shortest, ceiling = np.moveaxis(self.design.limits[self.begin.kind, FOCAL], 1, 0)
        room, by_distance, by_focus = ceiling - shortest, *np.zeros((2, len(table)))
        for kind in np.unique(self.begin.kind):
            rows = np.flatnonzero(self.begin.kind == kind)
            found = self.design.longest(int(kind), table[rows, DISTANCE], table[rows, FOCUS])
            short = found[0] < ceiling[rows]
            room[rows] = np.where(short, np.maximum(found[0] - shortest[rows], 0), room[rows])
            by_distance[rows] = np.where(short, found[1], 0)
            by_focus[rows] = np.where(short, found[2], 0)
        return room, by_distance, by_focus

    @property
    def start(self) -> Floats:
        """(n,) where the refinement begins."""
        return self._all[self._moved]

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lowest and highest values, (n,) each."""
        limits = self._limits[self._moved]
        return limits[:, 0], limits[:, 1]

    def _filled(self, numbers: Floats) -> Floats:
        full = self._all.copy()
        full[self._moved] = numbers
        return full

    def view_table(self, numbers: Floats) -> ViewTable:
        """The views at some numbers."""
        full, table = self._filled(numbers), self.begin.table.copy()
        limits = self.design.limits[self.begin.kind]
        table[:, AZIMUTH] += full[:, AZIMUTH] / self._level
        table[:, ELEVATION] += full[:, ELEVATION]
        moved = self._moved
        for column in (DISTANCE, F_NUMBER):
            rows = moved[:, column]
            table[rows, column] = np.exp(full[rows, column])
        table[:, FOCUS] = full[:, FOCUS] * self.design.target.diameter
        table[:, EXPOSURE] = full[:, EXPOSURE] * limits[:, EXPOSURE, 1]
        room, _, _ = self._room(table)
        rows = moved[:, FOCAL]
        table[rows, FOCAL] = (limits[:, FOCAL, 0] + full[:, FOCAL] * room)[rows]
        return ViewTable(self.begin.kind, table)

    def pulled_back(self, numbers: Floats, by_table: Floats) -> Floats:
        """Derivatives by the numbers, (m, n), from those by the table, (m, V, 7)."""
        full, table = self._filled(numbers), self.view_table(numbers).table
        room, by_distance, by_focus = self._room(table)
        by = by_table.copy()
        zoomed = by[..., FOCAL] * full[:, FOCAL]
        by[..., DISTANCE] += zoomed * by_distance
        by[..., FOCUS] += zoomed * by_focus
        scale = np.ones((len(table), COLUMNS))
        scale[:, AZIMUTH] = 1 / self._level
        scale[:, DISTANCE] = table[:, DISTANCE]
        scale[:, F_NUMBER] = table[:, F_NUMBER]
        scale[:, FOCAL] = room
        scale[:, FOCUS] = self.design.target.diameter
        scale[:, EXPOSURE] = self.design.limits[self.begin.kind, EXPOSURE, 1]
        return np.asarray((by * scale)[:, self._moved])

    def nearer(self, numbers: Floats, views: NDArray[np.bool_]) -> Floats:
        """Numbers at which some views (V,) are closer to where they were at the start."""
        full = self._filled(numbers)
        full[views] = (full[views] + self._all[views]) / 2
        return np.asarray(full[self._moved])
