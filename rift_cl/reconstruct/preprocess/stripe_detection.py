"""Which detector bins are faulty, told from one number for each bin of a row.

Vo, Atwood and Drakopoulos (Optics Express 26, 28396, 2018) tell fluctuating and dead bins by how
rough they are along the views (algorithm 6), and strong stripes by the level of the bin
(algorithm 5).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Profile = NDArray[np.float64]
Mask = NDArray[np.bool_]

# The paper's windows across bins, to find stripes and to compare levels, and the share of a smaller
# detector that they may be.
WINDOW, _LEVEL_WINDOW, _SHARE = 21, 51, 8
# The two jumps round a stripe are opposite, and neither is more than twice the other.
_ALIKE = 2.0


def fluctuating(roughness: ArrayLike, ratio: float) -> Mask:
    """Bins that are much rougher or much smoother along the views than those around them.

    Args:
        roughness: (bin,) mean distance from a running mean along the views.
        ratio: how far a bin has to stand out.
    """
    rough = np.asarray(roughness, np.float64)
    usual = np.maximum(_median(rough, odd_window(WINDOW, rough.size)), 1e-3 * rough.mean())
    relative = np.divide(rough, usual, out=np.ones_like(rough), where=usual > 0)
    relative = np.maximum(relative, 1e-6)
    # Noise-free data are as smooth as dead bins in places: those differ by the whole ratio.
    far = np.abs(np.log(relative)) > np.log(ratio)
    return _narrow(_outliers(relative, ratio) & far)


def offset(levels: ArrayLike, ratio: float) -> Mask:
    """Bins between a jump of the level and one back, which stand out of the jumps around them.

    The level of an object has curves and corners, but hardly ever such a pair.

    Args:
        levels: (bin,) mean over the views.
        ratio: how far a jump has to stand out.
    """
    level = np.asarray(levels, np.float64)
    jump = np.diff(level)
    usual = _median(np.abs(jump), odd_window(WINDOW, jump.size))
    steep = np.abs(jump) > ratio * usual
    found = np.zeros(level.shape, np.bool_)
    for width in range(1, min(odd_window(WINDOW, level.size) // 2, jump.size - 1) + 1):
        first, second = jump[:-width], jump[width:]
        opposite = first * second < 0
        alike = (np.abs(second) < _ALIKE * np.abs(first)) & (np.abs(first) < _ALIKE * abs(second))
        for start in np.flatnonzero(steep[:-width] & steep[width:] & opposite & alike):
            found[start + 1 : start + width + 1] = True
    return _narrow(found)


def unevenness(levels: ArrayLike) -> Profile:
    """By how much the level of each bin exceeds the median of those around it, (bin,).

    Beyond an end the level goes on turned about the outermost bin, so that a slope stays one:
    mirrored, it would lift the air beside a steep object by its height. A stripe that begins at
    the outermost bin is left whole: nothing tells it from an object.
    """
    level = np.asarray(levels, np.float64)
    window = odd_window(_LEVEL_WINDOW, level.size)
    half = window // 2
    longer = np.pad(level, half, "reflect", reflect_type="odd")
    return level - _median(longer, window)[half:-half]


def odd_window(window: int, bins: int) -> int:
    """The window, or an odd fraction of the width of a smaller detector."""
    return min(window, max(bins // _SHARE, 3)) | 1


def _narrow(bad: Mask) -> Mask:
    """Bad bins and their neighbours, less runs too wide for a stripe and those at the border."""
    from scipy.ndimage import binary_dilation

    wide: Mask = binary_dilation(bad)
    edges = np.flatnonzero(np.diff(np.pad(wide, 1).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2):
        if start == 0 or stop == bad.size or stop - start > odd_window(WINDOW, bad.size) // 2:
            wide[start:stop] = False
    return wide


def _outliers(values: Profile, ratio: float) -> Mask:
    """Algorithm 4: which values stand out of the line through the middle half of the sorted ones.

    A value stands out where it is half the ratio times the line's rise away from the line's end,
    if the farthest one is the whole ratio away.
    """
    ranked = np.sort(values)
    quarter = ranked.size // 4
    place = np.arange(ranked.size)
    middle = slice(quarter, ranked.size - quarter)
    slope, low = np.polyfit(place[middle], ranked[middle], 1)
    high = low + slope * (ranked.size - 1)
    rise = max(high - low, 1e-6 * float(np.abs(values).max()), np.finfo(np.float64).tiny)
    found = np.zeros(values.shape, np.bool_)
    if ranked[-1] - high > ratio * rise:
        found |= values > high + ratio / 2 * rise
    if low - ranked[0] > ratio * rise:
        found |= values < low - ratio / 2 * rise
    return found


def _median(values: Profile, window: int) -> Profile:
    from scipy.ndimage import median_filter

    smooth: Profile = median_filter(values, window, mode="reflect")
    return smooth
