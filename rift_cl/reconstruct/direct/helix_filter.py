"""What is done to views from a helix before they are backprojected by Katsevich's method.

A point in the volume lies on one chord between two places of the source less than a turn apart, and
the views between these two, which see it within the window of Tam and Danielsson, determine it
(Katsevich, Theoretically exact filtered backprojection-type inversion algorithm for spiral CT, SIAM
J. Appl. Math. 62, 2012, 2002). Steps and names are those of Noo, Pack and Heuscher (Exact helical
reconstruction using native cone-beam geometries, Phys. Med. Biol. 48, 3787, 2003):

1. the derivative of rays by the source's place, at a constant direction, and their cosine;
2. the Hilbert transform along curves on the detector, its cuts with planes through three places of
   the source at equal steps: rows are read there, convolved, and read back;
3. the window, whose edge takes its share of a pixel.

Derivatives are taken halfway between views and between bins. The convolution comes back to bins,
and makes up for what differences of bins lose of a derivative: windows are those of the ramp. All
steps are alike in every view. They are done on the host: each is a sparse matrix, or a convolution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone
from rift_cl.operators.filters.ramp_filters import WINDOWS, Filter, Ramp

Floats = NDArray[np.float64]

# Angles and heights may be off an even helix by this share of the step between views, and of a row.
_EVEN, _ROW = 0.05, 0.1
# The widest step between views, in radians, that turns can be counted with.
_WIDEST = np.pi / 4
# Curves on the detector for each of its rows.
_CURVES = 2
# Rows that are read at a place, from the one below it.
_TAPS = (-1, 0, 1, 2)
# Views that are filtered at the same time.
_VIEWS = 16


@dataclass(frozen=True)
class Helix:
    """The path of a source that rises evenly.

    Args:
        order: views from the lowest angle on.
        angles: of these views, ascending.
        heights: of these views.
        rise: of the source in a radian; negative where it falls.
    """

    order: NDArray[np.intp]
    angles: Floats
    heights: Floats
    rise: float

    @classmethod
    def of(cls, scan: Cone) -> Helix:
        """The helix of a scan.

        Raises:
            InputError: views are not evenly spaced, or heights do not rise in proportion to them.
        """
        order = np.argsort(scan.heights, kind="stable")
        angles = np.unwrap(scan.angles[order])
        steps = np.diff(angles)
        if angles[-1] < angles[0]:
            order, angles, steps = order[::-1], angles[::-1], -steps[::-1]
        step = (angles[-1] - angles[0]) / max(len(angles) - 1, 1)
        if not 0 < step < _WIDEST or np.abs(steps - step).max() > _EVEN * step:
            raise InputError("views of a helix are wanted at even steps of less than 45 degrees")
        heights = scan.heights[order]
        rise = (heights[-1] - heights[0]) / (angles[-1] - angles[0])
        off = np.abs(heights - heights[0] - rise * (angles - angles[0])).max()
        if off > _ROW * scan.pitch[0] / scan.magnification:
            raise InputError(f"heights are up to {off:.3g} off a helix")
        return cls(order, angles, heights, float(rise))

    @property
    def step(self) -> float:
        """Angle between views in radians."""
        return float((self.angles[-1] - self.angles[0]) / (len(self.angles) - 1))


class HelixFilter:
    """Filters views of a helix, of which it makes one less.

    Args:
        scan: an even helix.
        helix: that of its source.
        filter: the ramp whose window the Hilbert transform has.
        half_fan: of the rays that matter, in radians.
    """

    def __init__(self, scan: Cone, helix: Helix, filter: Filter, half_fan: float) -> None:
        from scipy import sparse
        from scipy.fft import rfft

        rows, bins = scan.rows, scan.bins
        self._shape, self._order = (rows, bins), helix.order
        full = _Columns.of(scan, 0.0, bins)
        half = _Columns.of(scan, 0.5, bins - 1)
        # Which w a curve has on a column, in rows: of the columns between bins, and of bins.
        advance = scan.source_to_detector * helix.rise / scan.source_to_axis
        per_row = abs(advance) / scan.pitch[0]
        highest = np.pi / 2 + half_fan
        count = 2 * int(np.ceil(_CURVES * per_row * highest)) + 3
        psi = np.linspace(-highest, highest, count)
        average = sparse.diags_array([0.5, 0.5], offsets=[0, 1], shape=(bins - 1, bins))
        between = sparse.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(bins - 1, bins))
        along_z = _slopes(rows)
        eye = sparse.diags_array(np.ones(rows))
        mean, across = sparse.kron(eye, average), sparse.kron(eye, between)
        down = sparse.kron(along_z, average)
        v: Floats = (np.arange(rows, dtype=np.float64) - scan.center[0])[:, None] * scan.pitch[0]
        S = scan.source_to_detector
        if scan.curved:
            by_bin, by_row = np.full((rows, bins - 1), S), np.zeros((rows, bins - 1))
            cosine = S / np.sqrt(S**2 + v**2) * np.ones(bins - 1)
        else:
            u = S * half.tangents
            by_bin = (S**2 + u**2) / S * np.ones((rows, 1))
            by_row = u * v / S
            cosine = S / np.sqrt(S**2 + u**2 + v**2)
        slope = _scaled(by_bin / scan.pitch[1], across) + _scaled(by_row / scan.pitch[0], down)
        read = _reader(half.curves(psi, advance) / scan.pitch[0] + scan.center[0], rows)
        read = read @ sparse.diags_array(cosine.ravel())
        self._change = (read @ mean / helix.step).tocsr()
        self._slope = (read @ slope / 2).tocsr()
        back = full.curve_at(v, psi, advance)
        share = full.window(v, scan.pitch[0], advance)
        lengths = np.sqrt(1 + (v / S) ** 2 + (0 if scan.curved else full.tangents**2))
        factor = helix.step / (2 * np.pi * scan.source_to_axis) * share / lengths
        self._back = _scaled(factor, _reader(back, count)).tocsr()
        self._curves = count
        kernel, self._length = _hilbert(bins, full.step if scan.curved else 0.0, filter)
        self._spectrum = rfft(kernel)

    def __call__(self, views: NDArray[Any], gain: float) -> NDArray[Any]:
        """Filtered views, (views - 1, rows, bins), from lower angles to higher.

        Args:
            views: (views, rows, bins) in the scan's order.
            gain: what they are multiplied by.
        """
        from scipy.fft import irfft, rfft

        rows, bins = self._shape
        out = np.empty((len(views) - 1, rows, bins), views.dtype)
        for first in range(0, len(out), _VIEWS):
            count = min(_VIEWS, len(out) - first)
            run = views[self._order[first : first + count + 1]].reshape(count + 1, -1).T
            before, after = run[:, :-1], run[:, 1:]
            rays = self._change @ (after - before) + self._slope @ (after + before)
            lines = np.ascontiguousarray(rays.T).reshape(count, self._curves, bins - 1)
            turned = irfft(rfft(lines, self._length) * self._spectrum, self._length)[..., :bins]
            flat = np.ascontiguousarray(turned.reshape(count, -1).T)
            out[first : first + count] = (gain * (self._back @ flat)).T.reshape(count, rows, bins)
        return out

    def adjoint(self, filtered: NDArray[Any], gain: float) -> NDArray[Any]:
        """The transpose."""
        from scipy.fft import irfft, rfft

        rows, bins = self._shape
        views = np.zeros((len(filtered) + 1, rows, bins), filtered.dtype)
        for first in range(0, len(filtered), _VIEWS):
            count = min(_VIEWS, len(filtered) - first)
            flat = np.ascontiguousarray(filtered[first : first + count].reshape(count, -1).T)
            turned = (gain * (self._back.T @ flat)).T.reshape(count, self._curves, bins)
            spectrum = rfft(turned, self._length) * self._spectrum.conj()
            lines = irfft(spectrum, self._length)[..., : bins - 1].reshape(count, -1).T
            lines = np.ascontiguousarray(lines)
            change, slope = self._change.T @ lines, self._slope.T @ lines
            ends = self._order[first : first + count + 1]
            views[ends[1:]] += (slope + change).T.reshape(count, rows, bins)
            views[ends[:-1]] += (slope - change).T.reshape(count, rows, bins)
        return views


@dataclass(frozen=True)
class _Columns:
    """Columns of the detector.

    Args:
        angles: their fan angles.
        curved: whether rows are arcs.
        step: fan angle from one to the next, on an arc.
    """

    angles: Floats
    curved: bool
    step: float

    @classmethod
    def of(cls, scan: Cone, first: float, count: int) -> _Columns:
        step = scan.pitch[1] / scan.source_to_detector
        u: Floats = (np.arange(count, dtype=np.float64) + first - scan.center[1]) * step
        return cls(u if scan.curved else np.arctan(u), scan.curved, step)

    @property
    def tangents(self) -> Floats:
        """Of the fan angles."""
        tangents: Floats = np.tan(self.angles)
        return tangents

    def curves(self, psi: Floats, advance: float) -> Floats:
        """Where curves cross the columns, (psi, columns), from the orbit's row on."""
        cotangent = np.where(psi == 0, 1.0, psi / np.tan(np.where(psi == 0, 1.0, psi)))[:, None]
        heights = psi[:, None] + cotangent * self.tangents
        return advance * (heights * np.cos(self.angles) if self.curved else heights)

    def curve_at(self, v: Floats, psi: Floats, advance: float) -> Floats:
        """Which curve goes through pixels, as a fractional number, (rows, columns)."""
        crossed = self.curves(psi, advance) * np.sign(advance)
        found, middle = np.empty((len(v), len(self.angles))), len(psi) // 2
        for column, heights in enumerate(crossed.T):
            rising = np.diff(heights) > 0
            # Of the curves through a pixel that of the least angle.
            above = middle + np.argmin(np.append(rising[middle:], False))
            below = middle - np.argmin(np.append(rising[:middle][::-1], False))
            numbers = np.arange(below, above + 1)
            wanted = v[:, 0] * np.sign(advance)
            found[:, column] = np.interp(wanted, heights[below : above + 1], numbers)
        return found

    def window(self, v: Floats, pitch: float, advance: float) -> Floats:
        """What of a pixel lies in the window of Tam and Danielsson, (rows, columns)."""
        stretch = 1 / np.cos(self.angles) ** (1 if self.curved else 2)
        ends = advance * stretch * np.stack([-np.pi / 2 - self.angles, np.pi / 2 - self.angles])
        low, high = np.sort(ends, axis=0)
        above = np.clip((high - v) / pitch + 0.5, 0, 1)
        below = np.clip((v - low) / pitch + 0.5, 0, 1)
        shares: Floats = above + below - 1
        return shares


def _slopes(rows: int) -> Any:
    """Central differences between rows, one-sided at the ends."""
    from scipy import sparse

    slopes = sparse.lil_array((rows, rows))
    for row in range(rows):
        low, high = max(row - 1, 0), min(row + 1, rows - 1)
        if high > low:
            slopes[row, high], slopes[row, low] = 1 / (high - low), -1 / (high - low)
    return slopes.tocsr()


def _scaled(factors: Floats, matrix: Any) -> Any:
    from scipy import sparse

    return sparse.diags_array(factors.ravel()) @ matrix


def _reader(places: Floats, rows: int) -> Any:
    """The matrix that reads columns of so many rows at places, (n, columns), by Keys' cubic."""
    from scipy import sparse

    count, columns = places.shape
    places = np.clip(places, 0, rows - 1)
    low = np.minimum(places.astype(int), max(rows - 2, 0))
    t = places - low
    shares = (
        (2 * t**2 - t - t**3) / 2,
        (3 * t**3 - 5 * t**2 + 2) / 2,
        (4 * t**2 + t - 3 * t**3) / 2,
        (t**3 - t**2) / 2,
    )
    read = [np.clip(low + step, 0, rows - 1) * columns + np.arange(columns) for step in _TAPS]
    at = np.tile(np.arange(count * columns), len(_TAPS)), np.concatenate(read, axis=None)
    values = np.concatenate(shares, axis=None)
    return sparse.csr_array((values, at), shape=(count * columns, rows * columns))


def _hilbert(bins: int, angle: float, filter: Filter) -> tuple[Floats, int]:
    """Hilbert transform from between bins to bins, round a circle, and the circle's length.

    Raises:
        InputError: the filter is no ramp under a window.
    """
    if not isinstance(filter, Ramp):
        raise InputError(f"filter is {filter!r}, of a helix a window's name is wanted")
    length = 1 << (2 * bins).bit_length()
    n = np.fft.fftfreq(length, 1 / length) - 0.5
    kernel = 1 / (np.pi * n) if not angle else angle / (np.pi * np.sin(np.clip(n * angle, -3, 3)))
    kernel[np.abs(n) > bins] = 0
    u = 2 * np.fft.rfftfreq(length)
    below = np.minimum(u / filter.cutoff, 1)
    window = np.where(u <= filter.cutoff, WINDOWS[filter.window](below), 0.0)
    # The difference of neighbouring bins falls behind the derivative by a sinc.
    window /= np.sinc(u / 2)
    return np.fft.irfft(np.fft.rfft(kernel) * window, length), length


def complete_depth(radius: float, scan: Cone, helix: Helix) -> float:
    """How far within the source's range of heights slices are complete up to a radius."""
    R = scan.source_to_axis
    half = np.linspace(np.arccos(min(radius / R, 1)), np.pi - np.arccos(min(radius / R, 1)), 401)
    chord = np.sqrt(np.maximum(radius**2 - (R * np.cos(half)) ** 2, 0)) / (R * np.sin(half))
    return float(abs(helix.rise) * (half * (1 + chord)).max())
