"""The pull of values to a few levels, from its definition."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def level_penalty(image: ArrayLike, levels: ArrayLike) -> float:
    """``sum of (x - low)(high - x) / 2``, low and high the levels about each value."""
    x, below = _between(image, levels)
    low, high = np.asarray(levels, np.float64)[[below, below + 1]]
    return float(np.sum((x - low) * (high - x)) / 2)


def level_pull(image: ArrayLike, levels: ArrayLike) -> NDArray[np.float64]:
    """Its gradient, the distance from each value to the middle of the levels about it."""
    x, below = _between(image, levels)
    low, high = np.asarray(levels, np.float64)[[below, below + 1]]
    pull: NDArray[np.float64] = (low + high) / 2 - x
    return pull


def _between(image: ArrayLike, levels: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    x, steps = np.asarray(image, np.float64), np.asarray(levels, np.float64)
    return x, np.clip(np.searchsorted(steps, x) - 1, 0, len(steps) - 2)
