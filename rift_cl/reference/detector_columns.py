"""Detector columns from their definition: sorted along the views, compared across the bins.

Every function takes a sinogram (view, bin) and is the twin of the kernel ``column_...`` that works
on the columns of many rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Values = NDArray[Any]

_BEFORE, _AFTER = 5, 4


def roughness(sinogram: ArrayLike) -> Floats:
    """Mean distance of each column from its running mean over ten views, (bin,)."""
    x = np.asarray(sinogram, np.float64)
    longer = np.pad(x, ((_BEFORE, _AFTER), (0, 0)), mode="edge")
    running = sum(longer[k : k + len(x)] for k in range(_BEFORE + _AFTER + 1))
    mean: Floats = np.abs(x - running / (_BEFORE + _AFTER + 1)).mean(axis=0)
    return mean


def ranked(sinogram: ArrayLike) -> tuple[Values, NDArray[np.int64]]:
    """Each column in ascending order, and the view that each value is of (equal ones in order)."""
    x = np.asarray(sinogram)
    order = np.argsort(x, axis=0, kind="stable")
    return np.take_along_axis(x, order, axis=0), order


def unranked(values: ArrayLike, order: NDArray[np.int64]) -> Values:
    """Ranked values back at their views: the inverse of ``ranked``."""
    ranks = np.asarray(values)
    x = np.empty_like(ranks)
    np.put_along_axis(x, order, ranks, axis=0)
    return x


def level(values: ArrayLike, dropped: int) -> Floats:
    """The mean of each ranked column without so many values at either end, (bin,)."""
    x = np.asarray(values, np.float64)
    mean: Floats = x[dropped : len(x) - dropped].mean(axis=0)
    return mean


def median_across(values: ArrayLike, window: int) -> Values:
    """The median across so many bins, an odd number; mirrored beyond the ends."""
    half = window // 2
    longer = np.pad(np.asarray(values), ((0, 0), (half, half)), mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(longer, window, axis=1)
    middle: Values = np.sort(windows, axis=-1)[..., half]
    return middle


def blended(values: ArrayLike, bad: NDArray[np.bool_]) -> Values:
    """Bad columns, from the nearest good ones on either side, along straight lines (float32)."""
    x = np.array(values, np.float32)
    good = np.flatnonzero(~bad)
    for hole in np.flatnonzero(bad):
        left, right = good[good < hole][-1], good[good > hole][0]
        share = np.float32((hole - left) / (right - left))
        x[:, hole] = (np.float32(1) - share) * x[:, left] + share * x[:, right]
    return x
