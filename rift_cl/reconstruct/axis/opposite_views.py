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
# Opposite views decide from so many whole ones on, or from this share of all views on.
_ENOUGH, _ENOUGH_SHARE = 12, 0.05
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

    def seen(self, row: Row) -> tuple[Floats, Floats]:
        """The first and last place that the views hold, and their opposites, (n, 2) each."""
        ends = row.seen
        if ends is None:
            ends = np.tile([0.0, row.views.shape[1] - 1.0], (len(row.views), 1))
        before, after = ends[self.before], ends[self.after]
        both = [np.maximum(before[:, 0], after[:, 0]), np.minimum(before[:, 1], after[:, 1])]
        return ends[self.first], np.stack(both, axis=1)


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


def enough_pairs(angles: Floats, seen: Floats | None = None) -> Pairs | None:
    """Pairs of opposite views, if there are so many that they decide.

    Args:
        angles: directions of views, in radians.
        seen: (view, 2) the first and the last bin that each view holds; all of them if None.
    """
    pairs = opposite_pairs(angles)
    if pairs is None:
        return None
    wanted = min(_ENOUGH, _ENOUGH_SHARE * _held(angles, seen).sum())
    return pairs if shared_views(pairs, angles, seen) >= wanted else None


def shared_views(pairs: Pairs, angles: Floats, seen: Floats | None) -> float:
    """How many whole views were taken from opposite sides as well.

    Pairs count by what the shorter of both views holds, and half where an opposite is interpolated:
    each of these views is then the first of another pair.
    """
    held = _held(angles, seen)
    once = np.where(pairs.before == pairs.after, 1.0, 0.5)
    return float(once @ np.minimum(held[pairs.first], held[pairs.before]))


def _held(angles: Floats, seen: Floats | None) -> Floats:
    """The share of a whole view that each one holds."""
    shares: Floats = np.ones(angles.size) if seen is None else np.ptp(seen, axis=1) / np.ptp(seen)
    return shares


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
    chosen = pairs.thinned(_GUESS)
    places = np.arange(slopes.shape[1])
    masks = [
        ((places >= ends[:, :1]) & (places <= ends[:, 1:])).astype(np.float64)
        for ends in chosen.seen(row)
    ]
    first, opposite = (part * mask for part, mask in zip(chosen.of(slopes), masks, strict=True))
    count = 2 * places.size - 1
    length = next_fast_len(count + 1, real=True)

    def over_turns(one: Floats, other: Floats) -> Floats:
        """Sums over products of one view and another turned round about half of each number."""
        products = rfft(one, length, axis=1) * rfft(other, length, axis=1)
        sums: Floats = irfft(products.sum(axis=0), length)[:count]
        return sums

    both = -over_turns(first, opposite)
    squares = [over_turns(first**2, masks[1]), over_turns(masks[0], opposite**2)]
    power = np.prod([np.maximum(part, 1e-9 * part.max()) for part in squares], axis=0)
    turn = np.arange(count)
    inside = (turn / 2 >= low) & (turn / 2 <= high) & (power > 0)
    return turn[inside] / 2, both[inside] / np.sqrt(power[inside])


def _shared(first: Floats, opposite: Floats, center: float) -> Floats:
    """What of views and of their opposites the others hold too, mirrored about a centre.

    Args:
        first: (n, 2) the first and the last place that each view holds.
        opposite: the same of their opposites.
        center: the place of the axis.

    Returns:
        (2 n, 2) the same of the parts that both hold, of the views and then of their opposites;
        first and last place are one where nothing is shared.
    """
    low = np.maximum(first[:, 0], 2 * center - opposite[:, 1])
    high = np.maximum(np.minimum(first[:, 1], 2 * center - opposite[:, 0]), low)
    forth = np.stack([low, high], axis=1)
    return np.concatenate([forth, 2 * center - forth[:, ::-1]])


def pair_evidence(row: Row, pairs: Pairs, window: float, near: float) -> Evidence:
    """What opposite views say of the axis.

    Args:
        row: the views.
        pairs: which of them are opposite.
        window: centre, in bins of the row, of the part of the detector that is looked at.
        near: the centre as far as it is known, in bins of the row.
    """
    from scipy.ndimage import uniform_filter1d

    chosen = pairs.thinned(_MOST)
    seen = None if row.seen is None else _shared(*chosen.seen(row), window)
    ones = spectra(replace(row, views=np.concatenate(chosen.of(row.views)), seen=seen), window)
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
    # Where a window shows nothing at all, there is no energy either.
    least_noise = max(1e-12 * float(energy.max()), float(np.finfo(np.float64).tiny))
    noise = np.maximum(uniform_filter1d(left, _BLUR, mode="nearest"), least_noise)
    # How far views exceed noise, in its variance; where they do not, two noises that happen to
    # agree tell nothing, and the best weight for two measurements of one signal falls to zero.
    excess = np.maximum(uniform_filter1d(energy, _BLUR, mode="nearest") / noise - 1, 0)
    weights = 2 * excess / (2 * excess + 1) * len(one) / noise
    return ones.evidence(terms * weights, row, _FREEDOM, groups * weights)
