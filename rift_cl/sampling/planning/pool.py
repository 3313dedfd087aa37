"""Candidates of the greedy choice: the criterion with some of them, and with one more."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.planning.objective import Objective, some
from rift_cl.sampling.planning.surface_pool import SurfacePool
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.observations import Observations

Floats = NDArray[np.float64]
_MIXING = 25


class Pool(Protocol):
    """C candidates, of which some are chosen."""

    @property
    def start(self) -> float:
        """The criterion before the first choice."""

    @property
    def mixing(self) -> int:
        """Steps towards the best mixture that are worth their time; each tightens a bound."""

    def __len__(self) -> int:
        """C."""

    def clear(self) -> None:
        """Choose none."""

    def criterion_with(self, index: int) -> float:
        """The criterion of the chosen candidates and one more."""

    def add(self, index: int) -> None:
        """Choose one more."""

    def ceilings(self) -> Floats:
        """(C,) upper bound of how much each further candidate lowers the criterion."""

    def with_views(self, view_table: ViewTable) -> Pool:
        """A pool with some more candidates, and none chosen."""

    def mixed(self, amounts: Floats) -> tuple[float, Floats]:
        """The criterion of candidates in amounts (C,), and minus its derivative by each."""


def pool_of(objective: Objective, view_table: ViewTable) -> Pool:
    """The pool of candidates of a view table."""
    observations = objective.observations(view_table)
    if objective.design.target.mode == "surface":
        return SurfacePool(objective, observations)
    return _VolumePool(objective, _each(objective, observations))


def _each(objective: Objective, observations: Observations) -> Floats:
    target = objective.design.target
    views = (some(observations, slice(view, view + 1)) for view in range(observations.views))
    return np.stack([host_coverage(one, target.k, target.diameter) for one in views])


class _VolumePool:
    """Candidates for a volume, where coverage adds up.

    Args:
        objective: what is to be small.
        each: (C, P, K) coverage by every candidate.
    """

    def __init__(self, objective: Objective, each: Floats) -> None:
        self._objective, self._each = objective, each
        self.mixing = _MIXING
        # A view knows a slab alone, so that most of its coverage is zero.
        self._flat = csr_array(each.reshape(len(each), -1))
        self._known = np.zeros(each.shape[1:])
        self.start = objective.scored(self._known).value

    def __len__(self) -> int:
        return len(self._each)

    def clear(self) -> None:
        self._known = np.zeros_like(self._known)

    def criterion_with(self, index: int) -> float:
        return self._objective.scored(self._known + self._each[index]).value

    def add(self, index: int) -> None:
        self._known = self._known + self._each[index]

    def with_views(self, view_table: ViewTable) -> Pool:
        own = _each(self._objective, self._objective.observations(view_table))
        return _VolumePool(self._objective, np.concatenate([self._each, own]))

    def ceilings(self) -> Floats:
        # A convex criterion falls by no more than its slope says.
        slope = self._objective.scored(self._known).gradient
        return np.asarray(-(self._flat @ slope.ravel()))

    def mixed(self, amounts: Floats) -> tuple[float, Floats]:
        known = np.asarray(self._flat.T @ amounts).reshape(self._known.shape)
        scored = self._objective.scored(known)
        return scored.value, np.asarray(-(self._flat @ scored.gradient.ravel()))
