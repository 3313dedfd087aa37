"""Views from opposite sides, which are mirror images about the axis.

Whole turns, and whatever goes further round than half a turn, hold such pairs; where no view was
taken from exactly the opposite side, the two next to it are interpolated. The difference of a view
and its opposite, turned round, is noise at the right centre: registration by phases, each weighted
by the noise that remains at its frequency.

The first guess comes from the normalised correlation of the slopes of opposite views over the part
that both see, which finds an axis anywhere on the detector, near its end too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.evidence import Evidence
from rift_cl.reconstruct.axis.views import Row, Views, spectra

Floats = NDArray[np.float64]

# A pair is taken if the views next to the opposite side are no further apart than this, in radians,
# or than so many steps between views.
_GAP, _STEPS = np.deg2rad(2.0), 2.5
# Fewest pairs that tell an axis, most that are looked at, and most that the first guess takes.
_FEWEST, _MOST, _GUESS = 6, 400, 90
# Angles closer than this are the same, in radians.
_SAME = 1e-6
# Bins over which slopes are taken for the first guess.
_SLOPE = 2.0
# How far a guess may be off, in bins of the row; frequencies over which noise is averaged.
_DOUBT, _BLUR = 1.0, 9
# Groups of neighbouring pairs whose disagreement is part of the error.
_GROUPS = 8
# Degrees of freedom of the t-distribution: many, as noise is measured over many pairs.
_FREEDOM = 100.0


@dataclass(frozen=True, eq=False)
class Pairs:
    """Which views are opposite to which.

    Args:
        first: (n,) numbers of views.
        before, after: (n,) numbers of the views on either side of the opposite direction.
        share: (n,) weight of ``after``; 1 less that is the weight of ``before``.
    """

    first: NDArray[np.intp]
    before: NDArray[np.intp]
    after: NDArray[np.intp]
    share: Floats

    def thinned(self, most: int) -> Pairs:
        """An evenly spaced subset of at most a given size."""
        count = self.first.size
        chosen = np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))
        return Pairs(*(part[chosen] for part in (self.first, self.before, self.after, self.share)))

    def of(self, views: Views) -> tuple[Views, Views]:
        """The views, and what is seen from their opposite sides."""
        share = self.share.astype(np.float32)[:, None]
        opposite = views[self.before] * (1 - share) + views[self.after] * share
        return views[self.first], opposite


def opposite_pairs(angles: Floats) -> Pairs | None:
    """Pairs of opposite views, or None where there are too few."""
    circle = np.mod(angles, 2 * np.pi)
    order = np.argsort(circle, kind="stable")
    circle = circle[order]
    step = np.median(np.diff(np.unique(np.round(circle, 7)), append=circle[0] + 2 * np.pi))
    wanted = np.mod(circle + np.pi, 2 * np.pi)
    after = np.searchsorted(circle, wanted - _SAME) % circle.size
    before = (after - 1) % circle.size
    gap = np.mod(circle[after] - circle[before], 2 * np.pi)
    ahead = np.mod(wanted - circle[before], 2 * np.pi)
    share = np.clip(np.divide(ahead, gap, out=np.ones(gap.size), where=gap > 0), 0, 1)
    off = np.abs(np.mod(wanted - circle[after] + np.pi, 2 * np.pi) - np.pi)
    exact = off < 2 * _SAME
    before, share = np.where(exact, after, before), np.where(exact, 1.0, share)
    # Two views an exact half turn apart are one pair, however often they are found.
    close = (gap <= max(_GAP, _STEPS * step)) & (gap > 0)
    once = exact & (circle < np.pi) | ~exact & close
    if np.count_nonzero(once) < _FEWEST:
        return None
    found = Pairs(order, order[before], order[after], share)
    return Pairs(*(part[once] for part in (found.first, found.before, found.after, found.share)))


def mirror_scores(row: Row, pairs: Pairs, low: float, high: float) -> tuple[Floats, Floats]:
    """How well slopes of opposite views correlate, turned round about trial centres.

    Args:
        row: the views.
        pairs: which of them are opposite.
        low: where to begin, in bins of the row.
        high: where to end.

    Returns:
        Trial centres, every half bin of the row, and their correlations, 1 at most.
    """
    from scipy.fft import irfft, next_fast_len, rfft
    from scipy.ndimage import gaussian_filter1d

    slopes = gaussian_filter1d(row.views, _SLOPE, axis=1, order=1, mode="nearest")
    first, opposite = pairs.thinned(_GUESS).of(slopes)
    bins = slopes.shape[1]
    length = next_fast_len(2 * bins, real=True)
    # Sums over products of one view and another turned round about half of each number.
    products = rfft(first, length, axis=1) * rfft(opposite, length, axis=1)
    both = -irfft(products.sum(axis=0), length)[: 2 * bins - 1]
    squares = [
        np.concatenate([[0], np.cumsum((part**2).sum(axis=0, dtype=float))])
        for part in (first, opposite)
    ]
    turn = np.arange(2 * bins - 1)
    start, stop = np.maximum(0, turn - bins + 1), np.minimum(bins - 1, turn) + 1
    power = np.prod([part[stop] - part[start] for part in squares], axis=0)
    inside = (turn / 2 >= low) & (turn / 2 <= high) & (power > 0)
    return turn[inside] / 2, both[inside] / np.sqrt(power[inside])


def pair_evidence(row: Row, pairs: Pairs, window: float, near: float) -> Evidence:
    """What opposite views say of the axis.

    Args:
        row: the views.
        pairs: which of them are opposite.
        window: centre, in bins of the row, of the part of the detector that is looked at.
        near: the centre as far as it is known, in bins of the row.
    """
    from scipy.ndimage import uniform_filter1d

    first, opposite = pairs.thinned(_MOST).of(row.views)
    ones = spectra(replace(row, views=np.concatenate([first, opposite])), window)
    one, other = np.split(ones.values, 2)
    ends = np.linspace(0, len(one), min(_GROUPS, len(one)) + 1).astype(int)[:-1]
    groups = -np.add.reduceat((one * other).astype(np.complex128), ends, axis=0)
    terms = groups.sum(axis=0)
    energy = (np.abs(one) ** 2 + np.abs(other) ** 2).sum(axis=0, dtype=np.float64)
    phase = np.exp(2j * ones.frequencies * (near - ones.origin))
    # At high frequencies, a guess that is slightly off must not pass for noise.
    known = np.exp(-2 * (ones.frequencies * _DOUBT) ** 2)
    least = energy - 2 * np.abs(terms)
    left = known * (energy + 2 * np.real(phase * terms)) + (1 - known) * least
    noise = np.maximum(uniform_filter1d(left, _BLUR, mode="nearest"), 1e-12 * energy.max())
    # How far views exceed noise, in its variance; where they do not, two noises that happen to
    # agree tell nothing, and the best weight for two measurements of one signal falls to zero.
    excess = np.maximum(uniform_filter1d(energy, _BLUR, mode="nearest") / noise - 1, 0)
    weights = 2 * excess / (2 * excess + 1) * len(one) / noise
    return ones.evidence(terms * weights, row, _FREEDOM, groups * weights)
