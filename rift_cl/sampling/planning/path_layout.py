"""Views along a path, which share camera, settings and a few numbers that shape the path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.curve import Curve
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
# Step of the differences with which a path's shape is derived; that of the criterion is exact.
_STEP = 1e-6
# Settings that all views of a path share, as shares of their range.
_SHARED = (FOCAL, F_NUMBER, FOCUS, EXPOSURE)


@dataclass(frozen=True, eq=False)
class PathLayout:
    """A path's numbers, followed by focal length, f-number, focus and exposure as shares.

    Args:
        site: where the path is.
        curve: its family.
        kind: which camera type.
        views: how many.
        numbers: (n,) all numbers at the start.
    """

    design: DesignSpace
    curve: Curve
    kind: int
    views: int
    numbers: Floats

    @cached_property
    def _last(self) -> dict[str, Any]:
        return {}

    @cached_property
    def _box(self) -> Floats:
        """(n, 2) of all numbers; equal ends where there is nothing to choose."""
        limits = self.design.limits[self.kind]
        box = np.column_stack([self.curve.low, self.curve.high])
        shared = np.array([[0.0, 1.0] if np.ptp(limits[c]) > 0 else [0.0, 0.0] for c in _SHARED])
        return np.concatenate([box, shared])

    @cached_property
    def _moved(self) -> NDArray[np.bool_]:
        return np.asarray(np.ptp(self._box, axis=1) > 0)

    @property
    def start(self) -> Floats:
        """(n,) where the refinement begins."""
        return self.numbers[self._moved]

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lowest and highest values, (n,) each."""
        box = self._box[self._moved]
        return box[:, 0], box[:, 1]

    @property
    def reach(self) -> float:
        """How far a camera may move: anywhere."""
        return math.inf

    def view_table(self, numbers: Floats) -> ViewTable:
        """The views at some numbers."""
        full = self.numbers.copy()
        full[self._moved] = numbers
        shape, shared = full[: -len(_SHARED)], full[-len(_SHARED) :]
        zoom, stop, focus, exposure = shared.tolist()
        limits = self.design.limits[self.kind]
        rows = self.curve.angles(shape, self.views)
        table = np.empty((self.views, COLUMNS))
        table[:, [AZIMUTH, ELEVATION]] = rows[:, :2]
        table[:, DISTANCE] = _between(limits[DISTANCE], rows[:, 2])
        table[:, F_NUMBER] = _between(limits[F_NUMBER], stop)
        table[:, FOCUS] = limits[FOCUS, 0] + focus * np.ptp(limits[FOCUS])
        table[:, EXPOSURE] = limits[EXPOSURE, 0] + exposure * np.ptp(limits[EXPOSURE])
        longest, _, _ = self.design.longest(self.kind, table[:, DISTANCE], table[:, FOCUS])
        shortest, ceiling = limits[FOCAL]
        room = max(min(ceiling, float(longest.min())) - shortest, 0)
        table[:, FOCAL] = shortest + zoom * room
        return ViewTable(np.full(self.views, self.kind), table)

    def pulled_back(self, numbers: Floats, by_table: Floats) -> Floats:
        """Derivatives by the numbers, (m, n), from those by the table, (m, V, 7)."""
        # Criterion and constraints ask at the same numbers.
        if self._last.get("at") != numbers.tobytes():
            self._last.update(at=numbers.tobytes(), changes=self._changes(numbers))
        changes = self._last["changes"]
        flat = by_table.reshape(len(by_table), -1) @ changes.reshape(len(numbers), -1).T
        return np.asarray(flat)

    def _changes(self, numbers: Floats) -> Floats:
        """(n, V, 7) how the table changes with each number."""
        changes = np.empty((len(numbers), self.views, COLUMNS))
        for index in range(len(numbers)):
            step = np.zeros(len(numbers))
            step[index] = _STEP
            change = self.view_table(numbers + step).table - self.view_table(numbers - step).table
            turn = 2 * math.pi
            change[:, AZIMUTH] -= turn * np.round(change[:, AZIMUTH] / turn)
            changes[index] = change / (2 * _STEP)
        return changes

    def nearer(self, numbers: Floats, views: NDArray[np.bool_]) -> Floats:
        """Parameters half way back to the start; a path moves as a whole."""
        return (numbers + self.start) / 2


def _between(limits: Floats, share: Floats | float) -> Floats:
    """Between two positive numbers, by the logarithm."""
    low, high = limits
    return np.asarray(low * (high / low) ** share)
