"""Which frequencies a planner counts with, and at which others its plan is judged.

Views can be fitted to a set of frequencies that lie farther apart than the slabs that they sample.
Hence a plan is made with more than a target has by itself, and judged at others. Frequencies that
the target came with stay, and so do those of a surface.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rift_cl.sampling.targets.target import Target, ball_of, disc_of, half_ball, half_disc

# How many more than a target has by itself to plan with, and to judge with.
_FINER, _JUDGED = 4, 10
# Bytes that candidates' coverage may take for the sake of more frequencies.
_MEMORY = 250e6


def for_planning(target: Target, candidates: int) -> Target:
    """The target at up to four times as many frequencies, as far as memory allows.

    Args:
        target: that is asked about.
        candidates: how many views the planner may hold ready.
    """
    taken = 8 * candidates * len(target.points) * len(target.k)
    factor = min(_FINER, int(_MEMORY / taken))
    if factor <= 1 or not _open(target):
        return target
    spread = half_disc if target.is_flat else half_ball
    return replace(target, frequencies=spread(target.highest, factor * len(target.k)))


def for_judging(target: Target, planned: Target) -> Target:
    """The target at frequencies that have nothing in common with those that were planned with.

    Args:
        target: that is asked about.
        planned: the same as ``for_planning`` made it.
    """
    return _scattered(target, planned, seed=1)


def for_choosing(target: Target, planned: Target) -> Target:
    """The target at frequencies that were neither planned with nor judged at; as ``for_judging``.

    Between plans that were fitted to the first, and arrangements that were not, the last may not
    choose, if they are to judge.
    """
    return _scattered(target, planned, seed=2)


def _scattered(target: Target, planned: Target, *, seed: int) -> Target:
    """The target at points of Sobol's sequence, shifted round the edges.

    Further points of the lattices that are planned with would not do: a regular arrangement that
    avoids the first misses their continuation as well.
    """
    from scipy.stats import qmc

    if not _open(target):
        return planned
    power = math.ceil(math.log2(_JUDGED * len(target.k)))
    dim, fill = (2, disc_of) if target.is_flat else (3, ball_of)
    places = qmc.Sobol(dim, scramble=False).random_base2(power)
    shift = np.random.default_rng(seed).uniform(size=dim)
    return replace(target, frequencies=fill(target.highest, np.mod(places + shift, 1)))


def _open(target: Target) -> bool:
    """Whether the choice of frequencies is ours."""
    if target.mode == "surface":
        return False
    return target.frequencies is None or np.array_equal(target.k, half_disc(target.highest))
