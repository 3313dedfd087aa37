"""Rings taken out before the reconstruction: stripes of the sinogram, with nothing to tune.

A detector bin that answers a little differently from its neighbours draws a straight stripe into
the sinogram and a ring into the slice. The methods are those of Vo, Atwood and Drakopoulos,
"Superior techniques for eliminating ring artifacts in X-ray micro-tomography" (Optics Express 26,
28396, 2018), in the order of their section 4: dead and fluctuating bins are found by how rough
they are along the angles and filled from their neighbours (algorithm 6), strong stripes are found
by the level of the bin and replaced (algorithm 5), and the rest goes with the sorting that gives
algorithm 3 its name: sorted along the angles, neighbouring bins of a slice hold nearly the same
values, so that a median across bins takes away what is one bin's own, and sorting back restores
the order of the angles. A stripe may be of any strength, change with what it measures, or end
somewhere; nothing is assumed of the angles.

One step is our own: as the projections are line integrals, where a bin's gain is a constant that
is added, levels are compared by differences and not by ratios, which mean nothing in air.
"""

from __future__ import annotations

import itertools
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import ShapeError

Floats = NDArray[np.float32]
Profile = NDArray[np.float64]
Mask = NDArray[np.bool_]
Value = TypeVar("Value", np.float32, np.float64)

# The paper's settings: the window of the median in bins, and how far a bin has to stand out.
_WINDOW, _RATIO = 21, 3.0
# A strong stripe begins and ends with steps of so many times those around it, nearly alike.
_STEEP, _ALIKE = 5.0, 2.0
# Views over which roughness is told, and the share of a bin's lowest and of its highest values
# that do not count for its level.
_VIEWS, _DROPPED = 10, 0.05
# The windows span no more than these shares of a smaller detector, on which the same object is as
# much smaller: one to tell stripes by, and one that takes a median, which blurs.
_SHARE, _PER_WINDOW, _LEAST = 8, 100, 3
_FEWEST_BINS, _FEWEST_VIEWS = 16, 16


def remove_rings(projections: Floats) -> Floats:
    """Take stripes out of line integrals.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin); every row by itself.

    Returns:
        The same without stripes, a new array. A scan of fewer than 16 views or bins is returned
        as it is: there, a stripe cannot be told from the object.

    Raises:
        ShapeError: the array has other axes.
    """
    stack = np.asarray(projections, np.float32)
    if stack.ndim not in (2, 3):
        raise ShapeError(
            f"projections have shape {stack.shape}, wanted (angle, bin) or (angle, row, bin)"
        )
    clean = stack.copy()
    if stack.shape[0] < _FEWEST_VIEWS or stack.shape[-1] < _FEWEST_BINS:
        return clean
    if stack.ndim == 2:
        return _without_stripes(clean)
    for row in range(stack.shape[1]):
        clean[:, row] = _without_stripes(np.ascontiguousarray(stack[:, row]))
    return clean


def _without_stripes(sinogram: Floats) -> Floats:
    """One sinogram after all three steps; it is changed."""
    _fill_dead(sinogram)
    _replace_strong(sinogram)
    return _sorted_median(sinogram)


def _fill_dead(sinogram: Floats) -> None:
    """Interpolate bins that follow no view, or jump from view to view."""
    from scipy.ndimage import uniform_filter1d

    smooth = uniform_filter1d(sinogram, min(_VIEWS, len(sinogram)), axis=0, mode="nearest")
    rough = np.abs(sinogram - smooth).mean(axis=0, dtype=np.float64)
    usual = np.maximum(_median(rough, _odd(_WINDOW, rough.size)), 1e-3 * rough.mean())
    ratio = np.divide(rough, usual, out=np.ones_like(rough), where=usual > 0)
    ratio = np.maximum(ratio, 1e-6)
    # Noise-free data are as smooth as dead bins in places: those differ by the whole ratio.
    _interpolate(sinogram, _narrow(_outliers(ratio) & (np.abs(np.log(ratio)) > np.log(_RATIO))))


def _replace_strong(sinogram: Floats) -> None:
    """Give bins whose level stands out what lies between their neighbours, rank by rank."""
    order = np.argsort(sinogram, axis=0, kind="stable")
    ranked = np.take_along_axis(sinogram, order, axis=0)
    dropped = int(_DROPPED * len(ranked))
    level = ranked[dropped : len(ranked) - dropped].mean(axis=0, dtype=np.float64)
    bad = _narrow(_between_jumps(level))
    if bad.any():
        _interpolate(ranked, bad)
        np.put_along_axis(sinogram, order, ranked, axis=0)


def _between_jumps(level: Profile) -> Mask:
    """Bins between a jump of the level and one back, which stand out of the jumps around them.

    The level of an object has curves and corners, but hardly ever such a pair.
    """
    jump = np.diff(level)
    usual = _median(np.abs(jump), _odd(_WINDOW, jump.size))
    steep = np.flatnonzero(np.abs(jump) > _STEEP * usual)
    found = np.zeros(level.shape, np.bool_)
    for first, second in itertools.combinations(steep, 2):
        near = second - first <= _odd(_WINDOW, level.size) // 2
        if near and -_ALIKE < jump[second] / jump[first] < -1 / _ALIKE:
            found[first + 1 : second + 1] = True
    return found


def _interpolate(columns: Floats, bad: Mask) -> None:
    """Fill bad columns from the good ones beside them, along straight lines."""
    good, holes = np.flatnonzero(~bad), np.flatnonzero(bad)
    if not holes.size:
        return
    after = np.searchsorted(good, holes)
    left, right = good[after - 1], good[after]
    share = ((holes - left) / (right - left)).astype(np.float32)
    columns[:, holes] = (1 - share) * columns[:, left] + share * columns[:, right]


def _narrow(bad: Mask) -> Mask:
    """Bad bins and their neighbours, less runs too wide for a stripe and those at the border."""
    from scipy.ndimage import binary_dilation

    wide: Mask = binary_dilation(bad)
    edges = np.flatnonzero(np.diff(np.pad(wide, 1).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2):
        if start == 0 or stop == bad.size or stop - start > _odd(_WINDOW, bad.size) // 2:
            wide[start:stop] = False
    return wide


def _sorted_median(sinogram: Floats) -> Floats:
    """Algorithm 3: sort along the angles, take the median across bins, sort back."""
    order = np.argsort(sinogram, axis=0, kind="stable")
    ranked = np.take_along_axis(sinogram, order, axis=0)
    bins = sinogram.shape[1]
    window = max(_LEAST, _odd(_WINDOW, bins // _PER_WINDOW * _SHARE))
    for view in ranked:
        view[:] = _median(view, window)
    clean = np.empty_like(sinogram)
    np.put_along_axis(clean, order, ranked, axis=0)
    return clean


def _outliers(values: Profile) -> Mask:
    """Algorithm 4: which bins stand out of the line through the middle half of the sorted ones.

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
    if ranked[-1] - high > _RATIO * rise:
        found |= values > high + _RATIO / 2 * rise
    if low - ranked[0] > _RATIO * rise:
        found |= values < low - _RATIO / 2 * rise
    return found


def _median(values: NDArray[Value], window: int) -> NDArray[Value]:
    from scipy.ndimage import median_filter

    smooth: NDArray[Value] = median_filter(values, window, mode="reflect")
    return smooth


def _odd(window: int, bins: int) -> int:
    return min(window, max(bins // _SHARE, 3)) | 1
