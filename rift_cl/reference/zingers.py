"""Zingers from their definition: medians of neighbourhoods, and which pixels stand out of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Values = NDArray[Any]


def local_median(stack: ArrayLike, reach: tuple[int, int, int]) -> Values:
    """The median round each pixel of a stack (view, row, bin), so many pixels to either side.

    Beyond the ends pixels are mirrored about the last one.
    """
    window = tuple(2 * n + 1 for n in reach)
    longer = _mirrored(np.asarray(stack), reach)
    views = np.lib.stride_tricks.sliding_window_view(longer, window)
    middle: Values = np.median(views, axis=(-3, -2, -1))
    return middle


def replaced(
    stack: ArrayLike,
    medians: ArrayLike,
    limits: ArrayLike,
    levels: ArrayLike,
    *,
    dark: bool,
    alone: bool,
    beside: int = 1,
) -> Values:
    """A stack (view, row, bin) with pixels that stand out replaced by their medians.

    Args:
        stack: of counts, or of a multiple.
        medians: of the neighbourhoods.
        limits: (row, bin) by how much the root of a pixel exceeds that of the median.
        levels: (row, 2) the least difference that counts, and the lowest median that a root is
            taken of.
        dark: whether pixels below the median count as well, by the same difference.
        alone: whether they must stand out twice as far as any in the views beside.
        beside: so many bins away, and a row.
    """
    x, usual = np.asarray(stack, np.float64), np.asarray(medians, np.float64)
    limit, (least, floor) = np.asarray(limits), np.asarray(levels).T[:, None, :, None]
    above = x - usual
    away = np.abs(above) if dark else above
    wanted = (np.sqrt(np.maximum(usual, floor)) + limit) ** 2 - np.maximum(usual, floor)
    bad = (away > least) & (away > wanted)
    if alone:
        sign = np.where(above < 0, -1, 1)
        for view, row, b in np.argwhere(bad):
            rows = _mirrored(np.arange(x.shape[1]), (1,))[row : row + 3]
            bins = _mirrored(np.arange(x.shape[2]), (beside,))[b : b + 2 * beside + 1]
            near = [v for v in (view - 1, view + 1) if 0 <= v < len(x)]
            at = (view, row, b)
            others = sign[at] * (x[np.ix_(near, rows, bins)] - usual[at])
            bad[at] = away[at] > 2 * others.max(initial=-np.inf)
    return np.where(bad, np.asarray(medians), np.asarray(stack))


def _mirrored(values: Values, reach: tuple[int, ...]) -> Values:
    return np.pad(values, [(n, n) for n in reach], mode="reflect")
