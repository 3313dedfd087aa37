"""A target at frequencies that no views were fitted to, and enough of them to state a figure.

Most power lies at low frequencies, where a half-ball has few points: of 1,500 on a lattice 0.4 lie
below one cycle per diameter, and what is said to be unknown then hangs on how the views stand to
the axes, by 7 % for a single one. Sobol's sequence, shifted round the edges, is right to 0.5 % with
ten times as many; lattices of as many points are right to 5 %.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rift_cl.sampling.targets.target import Target, ball_of, disc_of, half_disc

# To what share of it each criterion is told there: single views, which are alike by symmetry
# wherever they stand, differ by no more.
ACCURACY = {"wiener": 0.005, "worst": 0.005, "logdet": 0.015}
# How many more frequencies than a target has by itself.
_MORE = 10


def scattered(target: Target, *, seed: int = 1) -> Target:
    """The target at points of Sobol's sequence; itself where its frequencies were given.

    Further points of the lattices that are planned with would not do: a regular arrangement that
    avoids the first misses their continuation as well.

    Args:
        target: that is asked about.
        seed: of the shift; sets of different seeds have nothing in common.
    """
    from scipy.stats import qmc

    if not is_open(target):
        return target
    power = math.ceil(math.log2(_MORE * len(target.k)))
    dim, fill = (2, disc_of) if target.is_flat else (3, ball_of)
    places = qmc.Sobol(dim, scramble=False).random_base2(power)
    shift = np.random.default_rng(seed).uniform(size=dim)
    return replace(target, frequencies=fill(target.highest, np.mod(places + shift, 1)))


def is_open(target: Target) -> bool:
    """Whether the choice of frequencies is ours."""
    if target.mode == "surface":
        return False
    return target.frequencies is None or np.array_equal(target.k, half_disc(target.highest))
