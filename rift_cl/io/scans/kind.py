"""What the values of a scan are: counts, transmission or attenuation.

Three things come out of scanners and their software. *Counts* I want the flats I0, the darks and
a logarithm; *transmission* I / I0 wants the logarithm alone; *attenuation*, -log(I / I0), is the
line integral itself. Taking one for another gives slices that look like slices. So they are told
apart by what the file says and by a sample of the values: air is brightest in counts, near 1 in
transmission, near 0 in attenuation; and where that leaves a doubt, a person is asked.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.io.scans.literals import Kind
from rift_cl.io.scans.scan_file import RowSource

# The sample: views across the scan, rows of the detector, and the most values in all.
_VIEWS, _ROWS, _MOST = 9, 3, 1 << 18
# Bins at each end of the detector that are looked at for air, as a share of its width.
_END = 0.02
# Transmission reaches from 0 to a little above 1.
_TRANSMISSION = 1.5
_AIR = (0.8, 1.2)
# No more than this is left of line integrals' range: e^-20 is less than one quantum in 10^8.
INTEGRAL = 20.0
# Line integrals in air are no more than this share of the largest, in nearly all views.
_ZERO = 0.04
# Where one end of the detector alone sees air, the middle sees this share of the largest.
_FILLED = 0.25
# Negative values of this share of the largest are noise, in which nothing is told.
_NOISE = 0.5
# Share of ends that are exactly 0 where sums were computed.
_COMPUTED = 0.4
# Ends of counts in air are at least this share of the brightest, of transmission nearly that.
_BRIGHT, _NEARLY = 0.6, 0.85
# Numbers below zero that an unsigned type of so many bytes at most wrapped lie in this share of its
# range at the top, as far below it as the noise of dark samples, which is at most this share of the
# bright ones; beside them it is dark as well. A few of them, in more bins than one, tell.
_WRAPPED_BYTES, _TOP, _DARK, _WRAPPED_FEW = 2, 0.125, 0.05, 4
# Transmission reads about the same at both ends, unless an object reaches one: a person knows.
_BOTH = 0.7

_NAMES: tuple[tuple[Kind, frozenset[str]], ...] = (
    ("counts", frozenset(("count", "counts", "raw", "adu", "photons", "electrons"))),
    ("transmission", frozenset(("transmission", "transmittance", "transmissions"))),
    (
        "attenuation",
        frozenset(("attenuation", "absorption", "absorbance", "neglog", "minuslog", "mlog")),
    ),
)


@dataclass(frozen=True)
class Sample:
    """What some lines of the detector show.

    Args:
        dtype: type of the values as they are stored.
        low: their 0.5th percentile.
        high: their 99.5th percentile.
        bright: their 95th percentile, which zingers and a few stuck pixels leave as it is.
        ends: median of the outermost bins at the left and at the right.
        peaks: what these are at most in 19 of 20 lines, at the left and at the right.
        middle: median of the middle half of the bins.
        whole: every value is a whole number.
        zeros: share of the outermost values that are exactly 0, as in sums that were computed.
        wrapped: values at the top of an unsigned type's range that stand for numbers below zero,
            as where darks were subtracted without a sign; 0 where some may as well be hits.
    """

    dtype: np.dtype[np.generic]
    low: float
    high: float
    bright: float
    ends: tuple[float, float]
    peaks: tuple[float, float]
    middle: float
    whole: bool
    zeros: float
    wrapped: int = 0

    def __str__(self) -> str:
        return f"{self.dtype.name}, {self.low:.4g} to {self.high:.4g} in the frames looked at"


def sample(rows: RowSource, shape: tuple[int, int, int], dtype: np.dtype[np.generic]) -> Sample:
    """Look at a few rows of a few views across a scan.

    Args:
        rows: reads them.
        shape: (angle, row, bin).
        dtype: type of the values as they are stored.

    Raises:
        InputError: the rows cannot be read.
    """
    lines = max(_MOST // shape[2], 1)
    rows_seen = spread(shape[1], min(_ROWS, lines))
    views = spread(shape[0], max(min(_VIEWS, lines // len(rows_seen)), 1))
    values = rows.look("projections", views, rows_seen)
    return sampled(values, dtype)


def sampled(values: NDArray[np.float32], dtype: np.dtype[np.generic]) -> Sample:
    """What lines of the detector show, (..., bin); values that are not finite do not count."""
    lines = np.where(np.isfinite(values), values, np.nan).astype(np.float64)
    finite = lines[~np.isnan(lines)]
    if not finite.size:
        nothing = (0.0, 0.0)
        return Sample(dtype, 0.0, 0.0, 0.0, nothing, nothing, 0.0, whole=False, zeros=0.0)
    bins = lines.shape[-1]
    edge = max(1, round(_END * bins))
    left, right = lines[..., :edge], lines[..., -edge:]
    outer = np.concatenate([left.ravel(), right.ravel()])
    low, bright, high = np.percentile(finite, [0.5, 95, 99.5], method="nearest")
    return Sample(
        dtype=dtype,
        low=float(low),
        high=float(high),
        bright=float(bright),
        ends=(_median(left), _median(right)),
        peaks=(_peak(left), _peak(right)),
        middle=_median(lines[..., bins // 4 : max(bins - bins // 4, bins // 4 + 1)]),
        whole=bool((finite == np.rint(finite)).all()),
        zeros=float(np.mean(outer == 0)),
        wrapped=_wrapped(lines, dtype),
    )


def _wrapped(lines: NDArray[np.float64], dtype: np.dtype[np.generic]) -> int:
    """Values that are below zero but for their type, between others about zero.

    Hits and stuck pixels are as bright, but few of them lie so near to the end of the range without
    being the last code itself, between samples that are dark or wrapped, one of them dark.
    """
    if dtype.kind != "u" or dtype.itemsize > _WRAPPED_BYTES:
        return 0
    codes = 2.0 ** (8 * dtype.itemsize)
    top = lines >= (1 - _TOP) * codes
    if not top.any() or top.all():
        return 0
    noise = _DARK * float(np.percentile(lines[~top], 95))
    below = top & (codes - lines <= noise)
    dark = ~top & (np.abs(lines) <= noise)
    low, inner = below | dark, lines[..., 1:-1]
    wrapped = below[..., 1:-1] & low[..., :-2] & low[..., 2:] & (dark[..., :-2] | dark[..., 2:])
    count, bins = int(wrapped.sum()), wrapped.any(axis=tuple(range(lines.ndim - 1)))
    several = count >= _WRAPPED_FEW and bins.sum() > 1 and np.ptp(inner[wrapped]) > 0
    return count if several else 0


def _median(values: NDArray[np.float64]) -> float:
    finite = values[~np.isnan(values)]
    return float(np.median(finite)) if finite.size else 0.0


def _peak(values: NDArray[np.float64]) -> float:
    """What the medians of lines stay below in 19 of 20."""
    complete = values[~np.isnan(values).any(axis=-1)]
    return float(np.percentile(np.median(complete, axis=-1), 95)) if complete.size else 0.0


def spread(count: int, wanted: int) -> list[int]:
    """So many of the numbers below ``count``, evenly spread, none of them twice."""
    places = (np.arange(wanted) + 0.5) * count / wanted
    return sorted({int(place) for place in places})


def possible_kinds(seen: Sample) -> tuple[Kind, ...]:
    """What values may be, the likelier first; one alone where there is no doubt."""
    if seen.dtype.kind in "iu" or (seen.whole and seen.high > _TRANSMISSION):
        return ("counts",)
    if seen.low == seen.high == 0:
        return ("attenuation",)
    if seen.high <= 0:
        return ("attenuation", "transmission")
    if seen.high <= _TRANSMISSION:
        return _small(seen)
    if seen.high <= INTEGRAL:
        return _moderate(seen)
    return _large(seen)


def _small(seen: Sample) -> tuple[Kind, ...]:
    bright = max(seen.ends)
    air = _AIR[0] <= bright <= _AIR[1] and bright >= _NEARLY * max(seen.high, seen.middle)
    both = min(seen.ends) >= _BOTH * bright
    as_transmission = air and both and seen.low >= -_ZERO
    if as_transmission != _rises_from_zero(seen):
        return ("transmission",) if as_transmission else ("attenuation",)
    return ("transmission", "attenuation")


def _moderate(seen: Sample) -> tuple[Kind, ...]:
    return ("attenuation",) if _rises_from_zero(seen) else ("counts", "attenuation")


def _large(seen: Sample) -> tuple[Kind, ...]:
    """Counts where air is bright; sums that were computed where it is exactly 0.

    Ends that are merely dark may be those of a beam narrower than the detector.
    """
    dark, bright = min(seen.ends), max(seen.ends)
    if bright >= _BRIGHT * seen.high and dark > _ZERO * seen.high and seen.middle <= bright:
        return ("counts",)
    if seen.zeros >= _COMPUTED:
        return ("attenuation",)
    return ("counts", "attenuation")


def _rises_from_zero(seen: Sample) -> bool:
    """Whether air reads zero at both ends, or at one of an object that reaches the other."""
    air = _ZERO * seen.high
    if seen.low < -_NOISE * seen.high:
        return False
    if max(seen.peaks) <= air:
        return True
    # An opaque object at one end of a view of air would look the same, but for the brightest.
    inside = _FILLED * seen.high <= seen.middle and max(seen.ends) < _NEARLY * seen.high
    return min(seen.peaks) <= air and inside


def named_kind(names: Sequence[str]) -> Kind | None:
    """The kind that names and units state, the first that states one; None where none does."""
    for name in names:
        spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
        words = set(re.findall("[a-z]+", spaced))
        stated = [kind for kind, known in _NAMES if known & words]
        if len(stated) == 1:
            return stated[0]
    return None
