"""Views of one row made ready for a search: evenly spread, cut where their mirror images end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.evidence import Complexes, Evidence

Floats = NDArray[np.float64]
Views = NDArray[np.float32]
Place = TypeVar("Place", float, NDArray[np.float64])

# Share of a window's half-width over which it falls off at its ends, and the least of that in bins.
_TAPER, _TAPER_BINS = 0.1, 8.0
# Bins over which the mean view is smoothed to tell rings from it.
_RING = 9
# Ends of the detector, as a share of its bins, where air is looked for; views over which they are
# averaged; and the level, as a share of strong line integrals, above which they are not air.
_END, _BLUR, _AIR = 0.01, 9, 0.04
_STRONG, _MOST = 99.0, 98.0
# Share of the frequencies up to Nyquist that tell of places. Views that were sampled at the bins'
# centres instead of averaged over them, as many simulated ones are, fold higher frequencies about
# Nyquist, so that the upper ones pull the axis to half a bin; of noisy views they say little. Of
# short windows so many are kept in any case, without which nothing could be told.
_SAMPLED, _FEWEST = 0.6, 8


@dataclass(frozen=True, eq=False)
class Row:
    """The line integrals of one detector row, in bins that may hold several of the detector's.

    Args:
        views: (angle, bin).
        bin: how many of the detector's bins one of them holds.
        cut: whether the object reaches beyond the detector, or air is not at zero.
        seen: (angle, 2) the first and the last place that each view holds; None where all hold all.
        level: whether the mean of a view in a window is subtracted where it is cut.
    """

    views: Views
    bin: int
    cut: bool
    level: bool = True
    seen: Floats | None = None

    def detector(self, place: Place) -> Place:
        """A place in these bins, in bins of the detector."""
        return place * self.bin + (self.bin - 1) / 2

    def place(self, detector: Place) -> Place:
        """A place in bins of the detector, in these bins."""
        return (detector - (self.bin - 1) / 2) / self.bin


def is_cut(views: Views) -> bool:
    """Whether some views of a row do not end in air at zero on both sides."""
    from scipy.ndimage import uniform_filter1d

    end = max(2, round(_END * views.shape[1]))
    ends = np.stack([views[:, :end].mean(axis=1), views[:, -end:].mean(axis=1)])
    level = np.percentile(np.abs(uniform_filter1d(ends, _BLUR, axis=1)), _MOST, axis=1)
    return bool(level.max() > _AIR * np.percentile(np.abs(views), _STRONG))


def without_rings(views: Views) -> Views:
    """Views less what stays at its bin in all of them and is narrow: the mean view's fine detail.

    Good enough for a search that rings confuse, not for a slice: what the object has in common
    over all directions goes as well.
    """
    from scipy.ndimage import median_filter

    mean = views.mean(axis=0)
    rings: Views = mean - median_filter(mean, _RING, mode="nearest")
    return views - rings


def binned(views: Views, count: int) -> Views:
    """Means over ``count`` bins; what is left over at the end is dropped."""
    if count == 1:
        return views
    whole = views.shape[1] // count * count
    means: Views = views[:, :whole].reshape(len(views), -1, count).mean(axis=2)
    return means


def evenly(angles: Floats, start: float, turn: float, count: int, average: int) -> Any:
    """The linear map from views in any directions to evenly spread ones.

    Args:
        angles: directions of the views, in radians.
        start: the first direction.
        turn: what the views go round: a whole turn, or half of one that begins at ``start``.
        count: of evenly spread views.
        average: how many directions are averaged for each, interpolated linearly.

    Returns:
        A sparse (count, angles.size) matrix. The views that it gives lie ``turn / count`` apart.
    """
    from scipy.sparse import coo_array

    ahead = np.mod(angles - start + 1e-9, 2 * np.pi) - 1e-9
    ahead, first = np.unique(np.round(ahead, 9), return_inverse=True)
    share = 1 / np.bincount(first)
    wanted = np.arange(count * average) * turn / (count * average)
    whole = turn > 1.5 * np.pi
    after = np.searchsorted(ahead, wanted - 1e-9)
    before = after - 1
    if whole:
        gap = np.mod(ahead[after % ahead.size] - ahead[before], 2 * np.pi)
        weight = np.mod(wanted - ahead[before], 2 * np.pi) / np.where(gap > 0, gap, 2 * np.pi)
    else:
        inside = (after > 0) & (after < ahead.size)
        before, after = np.clip(before, 0, None), np.clip(after, 0, ahead.size - 1)
        gap = np.where(inside, ahead[after] - ahead[before], 1)
        weight = np.where(inside, (wanted - ahead[before]) / np.where(gap > 0, gap, 1), 0.0)
    row = np.arange(wanted.size) // average
    merged = coo_array(
        (
            np.concatenate([1 - weight, weight]) / average,
            (np.tile(row, 2), np.concatenate([before % ahead.size, after % ahead.size])),
        ),
        shape=(count, ahead.size),
    ).tocsr()
    spread = coo_array(
        (share[first], (first, np.arange(angles.size))), shape=(ahead.size, angles.size)
    )
    return (merged @ spread.tocsr()).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Spectra:
    """Fourier transforms of views along the detector.

    Args:
        values: (angle, frequency), complex.
        frequencies: in radians per bin of the row.
        origin: the bin of the row that phases are counted from.
    """

    values: NDArray[np.complex64]
    frequencies: Floats
    origin: float

    def turned(self, center: float) -> NDArray[np.complex64]:
        """What conjugated spectra of views are multiplied with to turn them about a centre."""
        phase = np.exp(-2j * self.frequencies * (center - self.origin))
        turned: NDArray[np.complex64] = phase.astype(np.complex64)
        return turned

    def evidence(
        self,
        terms: Complexes,
        row: Row,
        freedom: float,
        groups: Complexes | None = None,
    ) -> Evidence:
        """Evidence in bins of the detector from terms that count centres from ``origin``."""
        shift = self.origin + (row.bin - 1) / (2 * row.bin)
        phase = np.exp(-2j * self.frequencies * shift)
        parts = None if groups is None else groups * phase
        return Evidence(self.frequencies / row.bin, terms * phase, freedom, parts)


def spectra(row: Row, center: float) -> Spectra:
    """Spectra of the part of views that lies as far to the left of a centre as to its right.

    Views that end in air are taken whole, with zeros beyond, since nothing is missing. Others are
    cut by a window that is symmetric about the centre, after their mean in it is subtracted, so
    that a step at the end of the window is not taken for a feature that turns with the object.
    Of rows whose views end at places of their own (``seen``), a window ends there, and its views
    are scaled so that their noise is that of the others.
    """
    from scipy.fft import next_fast_len

    bins = row.views.shape[1]
    last = bins - 1
    if row.seen is not None:
        windows = _window(np.arange(bins), row.seen.mean(axis=1), np.ptp(row.seen, axis=1) / 2)
        part = row.views - (row.views * windows).sum(axis=1, keepdims=True) / _sums(windows)
        part = part * windows / np.sqrt(_sums(windows**2))
        return _transformed(part, next_fast_len(bins, real=True), 0)
    if not row.cut:
        length = next_fast_len(int(2 * max(center, last - center)) + 2, real=True)
        return _transformed(row.views, length, 0)
    half = max(min(center, last - center), 4.0)
    first, end = max(0, int(np.ceil(center - half))), min(bins, int(center + half) + 1)
    window = _window(np.arange(first, end), np.array([center]), np.array([half]))[0]
    part = row.views[:, first:end]
    if row.level:
        part = part - (part @ window / window.sum())[:, None]
    part = part * window
    length = next_fast_len(end - first, real=True)
    return _transformed(part, length, first)


def _window(places: NDArray[np.int64], middle: Floats, half: Floats) -> Views:
    """Windows, (middle, place), that fall off towards their ends; 0 where they are empty."""
    half = np.maximum(half, 1e-6)[:, None]
    away = np.abs(places - middle[:, None]) / half
    taper = np.clip(_TAPER_BINS / half, _TAPER, 1.0)
    windows: Views = (np.sin(np.pi / 2 * np.clip((1 - away) / taper, 0, 1)) ** 2).astype(np.float32)
    return windows


def _sums(windows: Views) -> Views:
    """Their sums, (window, 1); never 0."""
    sums: Views = np.maximum(windows.sum(axis=1, keepdims=True), np.float32(1e-6))
    return sums


def _transformed(part: Views, length: int, first: int) -> Spectra:
    """Without frequency zero, which tells nothing of places, and those that may be folded."""
    from scipy.fft import rfft

    least = min((length + 1) // 2, 1 + _FEWEST)
    inner = slice(1, max(least, int(_SAMPLED * length / 2)))
    frequencies = 2 * np.pi * np.arange(length // 2 + 1) / length
    return Spectra(rfft(part, length, axis=1)[:, inner], frequencies[inner], float(first))
