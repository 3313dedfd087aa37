"""Sets of directions of six kinds, for scores to tell apart, and what their gaps alone say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FAMILIES = ("jittered", "random", "wedge", "clustered", "tiny golden", "subsampled")


def family_angles(family: str, count: int, seed: int) -> Floats:
    """Directions (count,) in radians, of a kind, drawn from a seed."""
    random = np.random.default_rng([FAMILIES.index(family), count, seed])
    start = random.uniform(0, np.pi)
    steps = np.arange(count)
    if family == "jittered":
        return start + (steps + random.uniform(0.1, 0.8) * random.standard_normal(count)) * (
            np.pi / count
        )
    if family == "random":
        return random.uniform(0, np.pi, count)
    if family == "wedge":
        return start + steps * (np.pi - random.uniform(0.2, 1.6)) / count
    if family == "clustered":
        close = start + random.normal(0, random.uniform(0.05, 0.3), count // 2)
        return np.concatenate([close, random.uniform(0, np.pi, count - count // 2)])
    if family == "tiny golden":
        # Angles pi / (tau + n - 1) of Wundrak et al. (Magn. Reson. Med. 75, 2016).
        return start + steps * np.pi / ((1 + np.sqrt(5)) / 2 + random.integers(1, 12) - 1)
    fine = int(random.integers(2, 5)) * count
    return start + random.choice(fine, count, replace=False) * np.pi / fine


def gaps(angles: Floats) -> Floats:
    """Between neighbours on the half-circle, (views,); they add up to pi."""
    rising = np.sort(np.mod(angles, np.pi))
    return np.asarray(np.diff(rising, append=rising[0] + np.pi))
