"""Choose views one after another, each the one that helps most; and how far that is from the best.

Merits are convex in what is known and only fall as it grows, so that what a view gains shrinks as
others are chosen. That allows to look again only at those whose old gain could still win (Minoux
1978), and to bound what any choice could reach: at the best possible mixture of candidates no
single one falls faster than the mixture itself (Kiefer and Wolfowitz 1960).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.planning.pool import Pool

Floats = NDArray[np.float64]
# Sums of costs are compared with the budget up to this part of it; free views cost so little.
_ROUNDING, _FREE = 1e-9, 1e-12


class Choice(NamedTuple):
    """What was chosen, in order.

    Args:
        order: which candidates.
        merits: before the first, and after each.
    """

    order: list[int]
    merits: list[float]


class Limits(NamedTuple):
    """How much may be chosen.

    Args:
        views: how many at the most.
        costs: (C,) of the candidates.
        total: of all that are chosen; infinite without a budget.
    """

    views: int
    costs: Floats
    total: float

    @property
    def prices(self) -> Floats:
        """Costs above zero."""
        least = _FREE * self.total if np.isfinite(self.total) else _FREE
        return np.maximum(self.costs, least)


def choose(pool: Pool, limits: Limits, *, again: bool = True) -> Choice:
    """Choose greedily, by gain and by gain for its cost, and keep the better choice.

    Of equal candidates the first is taken. Gains of the criterion ``worst`` may also grow as others
    are chosen: there old gains are no more than a good guess.

    Args:
        pool: the candidates.
        limits: how many, and at what cost.
        again: whether a candidate may be chosen more than once.
    """
    found = _choose(pool, limits, np.ones(len(pool)), again)
    if np.isfinite(limits.total) and np.ptp(limits.costs) > 0:
        thrifty = _choose(pool, limits, limits.prices, again)
        found = min(found, thrifty, key=lambda choice: choice.merits[-1])
    return found


def _choose(pool: Pool, limits: Limits, prices: Floats, again: bool) -> Choice:
    pool.clear()
    left = limits.total * (1 + _ROUNDING)
    order: list[int] = []
    merits = [pool.start]
    stale = np.full(len(pool), np.inf)
    while len(order) < limits.views:
        paid = limits.costs <= left
        if not again:
            paid[order] = False
        if not paid.any():
            break
        stale = np.minimum(stale, pool.ceilings())
        best = _next(pool, merits[-1], stale, np.where(paid, 1 / prices, -1))
        order.append(best)
        merits.append(merits[-1] - float(stale[best]))
        pool.add(best)
        left -= limits.costs[best]
    return Choice(order, merits)


def _next(pool: Pool, criterion: float, stale: Floats, worth: Floats) -> int:
    """The candidate with the largest gain times worth; old gains in ``stale`` are renewed."""
    fresh = worth < 0
    while True:
        best = int(np.argmax(np.where(worth < 0, -np.inf, stale * worth)))
        if fresh[best]:
            return best
        stale[best] = criterion - pool.criterion_with(best)
        fresh[best] = True


def bound(pool: Pool, limits: Limits, chosen: list[int]) -> float:
    """Lower bound of the criterion over all choices of as many candidates at the same cost.

    Args:
        pool: the candidates; their criterion is convex in the amount of each.
        limits: how many, and at what cost.
        chosen: a choice to begin with.
    """
    mixture = np.bincount(chosen, minlength=len(pool)).astype(np.float64)
    best = -np.inf
    for step in range(pool.mixing):
        criterion, falls = pool.mixed(mixture)
        least = limits.views * float(falls.max())
        if np.isfinite(limits.total):
            least = min(least, limits.total * float((falls / limits.prices).max()))
        best = max(best, criterion + float(falls @ mixture) - least)
        if step == 0:
            mixture = (mixture + len(chosen) / len(pool)) / 2
        elif falls.max() > 0:
            # Titterington's step: what falls faster than the mean gains weight.
            mixture = mixture * np.sqrt(falls / falls.max())
            mixture *= len(chosen) / mixture.sum()
    return best
