"""Which frequencies a planner counts with, and at which others its plan is judged.

Views can be fitted to a set of frequencies that lie farther apart than the slabs that they sample.
Hence a plan is made with more than a target has by itself, and judged at others. Frequencies that
the target came with stay, and so do those of a surface.
"""

from __future__ import annotations

from dataclasses import replace

from rift_cl.sampling.targets.scattered import is_open, scattered
from rift_cl.sampling.targets.target import Target, half_ball, half_disc

# How many more than a target has by itself to plan with.
_FINER = 4
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
    if factor <= 1 or not is_open(target):
        return target
    spread = half_disc if target.is_flat else half_ball
    return replace(target, frequencies=spread(target.highest, factor * len(target.k)))


def for_judging(target: Target, planned: Target) -> Target:
    """The target at frequencies that have nothing in common with those that were planned with.

    Args:
        target: that is asked about.
        planned: the same as ``for_planning`` made it.
    """
    return scattered(target) if is_open(target) else planned


def for_choosing(target: Target, planned: Target) -> Target:
    """The target at frequencies that were neither planned with nor judged at; as ``for_judging``.

    Between plans that were fitted to the first, and arrangements that were not, the last may not
    choose, if they are to judge.
    """
    return scattered(target, seed=2) if is_open(target) else planned
