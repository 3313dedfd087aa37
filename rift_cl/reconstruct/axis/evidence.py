"""What data say about the axis, frequency by frequency along the detector.

Turning a view round about an axis at bin c multiplies its Fourier coefficient at frequency k
(radians per bin) by ``exp(-2i k c)`` and conjugates it. The energy by which views contradict
turned ones is therefore ``A(k) + 2 Re(exp(2i k c) C(k))``: one complex number C(k), found by one
pass over the data, tells the energy for every trial centre, whole bin or not, without another
transform or any interpolation.

Energies are divided by their expectation at the right centre, which makes them log-likelihoods.
Each frequency's share, ``X(k) = 2 |C| (1 + cos(2 k c + arg C))`` above its own least, is then
bounded as in Student's t-distribution, ``nu log(1 + X / nu)``: a frequency that contradicts all
others, because the object leaves the field of view or the beam drifted, is outvoted instead of
deciding. The standard error is the sandwich estimate (Huber, Proc. 5th Berkeley Symposium 1, 221,
1967) over bands of frequencies, so that it also grows where bands disagree. Where groups of
neighbouring views have their own shares of the evidence and disagree by more than that, the axis
moved during the scan.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Bands of frequencies of about equal weight, whose disagreement tells the error.
_BANDS = 16
# Newton steps, the longest of them, and the one that ends the search, in bins.
_STEPS, _LONGEST, _SHORTEST = 12, 0.2, 1e-5


@dataclass(frozen=True, eq=False)
class Evidence:
    """What one sinogram says of its axis.

    Args:
        frequencies: (n,) along the detector, in radians per bin, ascending.
        terms: (n,) the numbers C(k), for centres counted in bins of the detector.
        freedom: degrees of freedom nu of the t-distribution; the fewer, the more a frequency that
            contradicts the others is outvoted.
        groups: (group, n) the shares of ``terms`` that groups of neighbouring views have; None
            where they have none of their own.
    """

    frequencies: Floats
    terms: Complexes
    freedom: float
    groups: Complexes | None = None

    @cached_property
    def _weight(self) -> Floats:
        return 2 * np.abs(self.terms) / self.freedom

    @cached_property
    def _phase(self) -> Floats:
        return np.angle(self.terms)

    @property
    def most(self) -> float:
        """The score of a centre on which all frequencies agreed."""
        return float(self.freedom * _mute(self._weight))

    def scores(self, centers: Floats) -> Floats:
        """Log-likelihood of trial centres, less what centres reach on average if data are mute."""
        a = self._weight
        angles = 2 * np.multiply.outer(centers, self.frequencies) + self._phase
        scores: Floats = self.freedom * (_mute(a) - np.log1p(a * (1 + np.cos(angles))).sum(axis=-1))
        return scores

    def peak(self, start: float) -> float:
        """The likeliest centre next to ``start``, by Newton's method."""
        center = start
        for _ in range(_STEPS):
            slope, bend = self._derivatives(center)
            if bend.sum() <= 0:
                break
            step = float(np.clip(-slope.sum() / bend.sum(), -_LONGEST, _LONGEST))
            center += step
            if abs(step) < _SHORTEST:
                break
        return center

    def error(self, center: float) -> float:
        """Standard error of a centre at a peak, in bins; infinite where there is no peak."""
        slope, bend = self._derivatives(center)
        total = bend.sum()
        if not total > 0:
            return np.inf
        share = np.cumsum(np.maximum(bend, 0))
        bands = np.minimum((_BANDS * share / share[-1]).astype(int), _BANDS - 1)
        slopes = np.bincount(bands, slope, minlength=_BANDS)
        return float(max(np.linalg.norm(slopes) / total, 1 / np.sqrt(total)))

    def drift(self, center: float) -> float:
        """By how much groups of views move a centre at a peak beyond its standard error, in bins.

        A standard error as well, of what all rows of a detector have in common; 0 where groups
        have no shares of their own.
        """
        if self.groups is None or len(self.groups) < 2:
            return 0.0
        total = self._derivatives(center)[1].sum()
        if not total > 0:
            return 0.0
        twice = 2 * self.frequencies
        share = 1 / (1 + self._weight * (1 + np.cos(twice * center + self._phase)))
        turned = self.groups * np.exp(1j * twice * center)
        slopes = -2 * (turned.imag * (share * twice)).sum(axis=1)
        count = slopes.size
        scatter = float(slopes.std() * count / np.sqrt(count - 1) / total)
        return float(np.sqrt(max(scatter**2 - self.error(center) ** 2, 0.0)))

    def _derivatives(self, center: float) -> tuple[Floats, Floats]:
        """First and second derivative of the negative log-likelihood, by frequency."""
        a, twice = self._weight, 2 * self.frequencies
        angle = twice * center + self._phase
        share = a / (1 + a * (1 + np.cos(angle)))
        slope = -self.freedom * share * np.sin(angle) * twice
        bend = -self.freedom * twice**2 * (share * np.cos(angle) + (share * np.sin(angle)) ** 2)
        return slope, bend


def _mute(a: Floats) -> float:
    """What centres lose on average over all phases: the mean of log(1 + a + a cos u) over u."""
    return float(np.log((1 + a + np.sqrt(1 + 2 * a)) / 2).sum())
