"""Samples of a line between those that there are, from the formula.

Band-limited data are the sum of sinc functions about their samples (Whittaker, Shannon). The sinc
is cut to ``TAPS`` samples by a Kaiser window (J. F. Kaiser, 1966), and the weights are divided by
their sum, so that constants stay what they are. Beyond the ends the last sample goes on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

TAPS = 12
_KAISER = 7.0


def resampled(stack: Reals, positions: Reals, axis: int) -> Reals:
    """Read each view of a stack at positions along its rows (axis 1) or its bins (axis 2).

    Args:
        stack: (view, row, bin).
        positions: (row, bin) of the result, the fractional row or bin to read.
        axis: which of the two is read between samples; the other index is the result's own.

    Returns:
        (view, row, bin), of as many rows and bins as the positions.
    """
    rows, bins = positions.shape
    out = np.empty((len(stack), rows, bins))
    for r in range(rows):
        for k in range(bins):
            taps = int(np.floor(positions[r, k])) + np.arange(1 - TAPS // 2, TAPS // 2 + 1)
            distance = taps - positions[r, k]
            share = np.clip(1 - (2 * distance / TAPS) ** 2, 0, None)
            weights = np.sinc(distance) * np.i0(_KAISER * np.sqrt(share))
            weights /= weights.sum()
            taps = np.clip(taps, 0, stack.shape[axis] - 1)
            samples = stack[:, taps, k] if axis == 1 else stack[:, r, taps]
            out[:, r, k] = samples @ weights
    return out
