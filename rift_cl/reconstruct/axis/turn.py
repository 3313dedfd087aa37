"""Whether the views of parallel rays go as far round as their angles say.

Views half a turn apart are mirror images about the axis, wherever the axis is, whatever leaves the
detector. So many views apart as the angles make half a turn, they must therefore match; where they
do not, and views another number apart do, the angles are spread over a wrong turn. An object that
looks alike from all sides, or again after a part of a turn, matches at the angles' half turn too,
and nothing is said of it. Less than half a turn holds no such views, and tells nothing either.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.views import Views, binned, without_rings

Floats = NDArray[np.float64]

# Fewest views, bins that views are compared in, about, and most pairs and lags that are.
_FEWEST, _BINS, _PAIRS, _LAGS = 36, 128, 60, 150
# By how much steps between views may differ, as a share of the step.
_EVEN = 0.1
# Bins over which slopes are taken.
_SLOPE = 2.0
# Least overlap of mirrored views, as a share of the detector: of those the angles call opposite,
# and of all others.
_OVERLAP, _LEAST = 0.06, 0.5
# By how much half a turn may be missed, as a share of all views, and in views.
_CLOSE, _CLOSE_VIEWS = 1 / 60, 3
# Mismatch, 0 that of neighbouring views and 1 that of most: of views that are opposite, and of
# views that are not.
_SAME, _OTHER = 0.35, 0.6
# Least by which most views must mismatch more than neighbours: so many times as much as these, and
# as a share of the slopes' power.
_TIMES, _CONTRAST = 1.0, 0.01
# How far from the axis of the best lag the given one is tried, in bins of the small views.
_NEAR = 2
# The share of a turn by which another must differ.
_APART = 0.05


class OtherTurn(NamedTuple):
    """A turn that data contradict.

    Args:
        given: what the angles go round, in degrees.
        seen: what the views do.
    """

    given: float
    seen: float

    def in_words(self) -> str:
        """What contradicts the angles, as the end of a sentence."""
        return (
            f"views half a turn apart by their angles do not match, and others do as if the scan "
            f"had gone round {self.seen:.0f} degrees in place of {self.given:.0f}: the angles are "
            "probably wrong, or the rotation axis lies along the rows of the images (--axes "
            "angle,bin,row)"
        )

    def of_rays(self) -> str:
        """The same, where rays of a fan contradict them."""
        return (
            f"rays that measure the same line do not agree, and do as if the scan had gone round "
            f"{self.seen:.0f} degrees in place of {self.given:.0f}: the angles are probably wrong"
        )


def other_turn(views: Views, angles: Floats) -> OtherTurn | None:
    """The turn that the views of a row go round, where it is surely not that of their angles.

    Args:
        views: line integrals of one row, (angle, bin).
        angles: their directions in radians, evenly spaced, of half a turn to a whole one.

    Returns:
        Both turns; None where they agree, or the data do not tell.
    """
    order = np.argsort(angles, kind="stable")
    steps = np.diff(angles[order])
    if len(views) < _FEWEST or not steps.min() > 0:
        return None
    step = float(np.ptp(angles) / steps.size)
    half = np.pi / step
    count = len(views)
    if np.abs(steps - step).max() > _EVEN * step or not count / 2.1 <= half <= count + 1.5:
        return None
    lags = _Lags(without_rings(views[order]))
    reference = lags.direct(1)
    scanned = np.unique(np.linspace(count // 8, count - 1, _LAGS).round().astype(int))
    others = np.array([lags.mirrored(lag, _LEAST).min() for lag in scanned])
    contrast = float(np.median(others)) - reference
    if not contrast > max(_TIMES * reference, _CONTRAST):
        return None
    near = max(_CLOSE_VIEWS, round(_CLOSE * count))
    best = int(scanned[others.argmin()])
    finer = range(max(1, best - near), min(count, best + near + 1))
    found, lag = min((float(lags.mirrored(lag, _LEAST).min()), lag) for lag in finer)
    if found - reference > _SAME * contrast or abs(lag - half) < _APART * half:
        return None
    # The axis is one: if more views tell it than the angles call opposite, it is that of those.
    axis = int(lags.mirrored(lag, _LEAST).argmin())
    about = slice(max(0, axis - _NEAR), axis + _NEAR + 1) if lag < half else slice(None)
    nearby = [at for at in range(round(half) - near, round(half) + near + 1) if at < count]
    given = min(float(lags.mirrored(at, _OVERLAP)[about].min()) for at in nearby)
    if given - reference < _OTHER * contrast:
        return None
    whole = np.rad2deg(step) * count
    return OtherTurn(float(whole), float(180 * count / lag))


class _Lags:
    """How little views of a row match others so many views on: 0 if at all, 1 if not."""

    def __init__(self, views: Views) -> None:
        from scipy.fft import next_fast_len, rfft
        from scipy.ndimage import gaussian_filter1d

        small = binned(views, max(1, round(views.shape[1] / _BINS)))
        slopes = gaussian_filter1d(small, _SLOPE, axis=1, order=1, mode="nearest")
        self._slopes, self._bins = slopes, slopes.shape[1]
        self._length = next_fast_len(2 * self._bins, real=True)
        self._spectra = rfft(slopes, self._length, axis=1)
        self._power = np.concatenate(
            [np.zeros((len(slopes), 1)), np.cumsum(slopes**2, axis=1, dtype=float)], axis=1
        )

    def direct(self, lag: int) -> float:
        """Of views as they are."""
        one, other = self._pairs(lag)
        first, second = self._slopes[one], self._slopes[other]
        power = np.sqrt((first**2).sum() * (second**2).sum())
        return float(1 - (first * second).sum() / power) if power > 0 else 0.0

    def mirrored(self, lag: int, overlap: float) -> Floats:
        """Of views turned round about every half bin; 2 where less than so much of both is seen."""
        from scipy.fft import irfft

        one, other = self._pairs(lag)
        products = (self._spectra[one] * self._spectra[other]).sum(axis=0)
        bins = self._bins
        both = -irfft(products, self._length)[: 2 * bins - 1]
        turn = np.arange(2 * bins - 1)
        start, stop = np.maximum(0, turn - bins + 1), np.minimum(bins - 1, turn) + 1
        power = np.prod(
            [
                (self._power[part][:, stop] - self._power[part][:, start]).sum(axis=0)
                for part in (one, other)
            ],
            axis=0,
        )
        seen = (stop - start >= overlap * bins) & (power > 0)
        scores = np.full(power.size, -1.0)
        np.divide(both, np.sqrt(power), out=scores, where=seen)
        return 1 - scores

    def _pairs(self, lag: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        count = len(self._slopes) - lag
        one = np.unique(np.linspace(0, count - 1, min(_PAIRS, count)).round().astype(np.intp))
        return one, one + lag
