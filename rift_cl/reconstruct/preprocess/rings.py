"""Ring artefacts removed before reconstruction, as the stripes that they are in a sinogram.

A detector bin that answers a little differently from its neighbours draws a straight stripe into
the sinogram and a ring into the slice. ``remove_rings`` applies one of the methods below, by name:

- ``vo`` (default): ``dead``, ``large`` and ``sorting`` in turn, with nothing to tune;
- ``sorting``, ``filtering``, ``fitting``, ``large``, ``dead``: algorithms 3, 2, 1, 5 and 6 of Vo,
  Atwood and Drakopoulos, "Superior techniques for eliminating ring artifacts in X-ray
  micro-tomography", Optics Express 26, 28396 (2018);
- ``wavelet-fft``: Münch, Trtik, Marone and Stampanoni, "Stripe and ring artifact removal with
  combined wavelet-Fourier filtering", Optics Express 17, 8567 (2009).

One thing is our own: as projections are line integrals, in which a bin's gain is a constant that is
added, stripes are compared and removed by differences where the papers take ratios, which mean
nothing in air.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.errors import InputError, checked_flag
from rift_cl.reconstruct.preprocess.columns import FEWEST_VIEWS, DetectorColumns, mend_columns
from rift_cl.reconstruct.preprocess.projection_array import as_projections
from rift_cl.reconstruct.preprocess.stripe_detection import (
    WINDOW,
    fluctuating,
    odd_window,
    offset,
    unevenness,
)

Floats = NDArray[np.float32]
StripeMethod = Callable[[Floats, Device], Floats]

_FEWEST_BINS = 16
# The median's window grows with the detector, by a bin for so many, as the object does: a wider
# window than needed blurs.
_BINS_PER_WINDOW, _LEAST_WINDOW = 100, 3
# Sorted windows of the median live in registers and caches.
_LARGEST_WINDOW = 127
# Each level of a wavelet transform doubles the length that it needs.
_MOST_LEVELS, _BINS_PER_LEVEL = 10, 40
# The lowest and the highest values of a bin that do not count for its level, as a share.
_DROPPED = 0.05


@dataclass(frozen=True)
class SortingFilter:
    """Algorithm 3: sort along the views, take the median across bins, sort back.

    Sorted, neighbouring bins of a slice hold nearly the same values, whatever the order of the
    views, so that the median takes away what is one bin's own.

    Args:
        window: bins of the median, odd, from 3 to 127; wider stripes need wider windows, which blur
            more. If not given, 21 on detectors of 2,000 bins and proportionally fewer on smaller.
    """

    window: int | None = None

    def __post_init__(self) -> None:
        """Check the window."""
        if self.window is None:
            return
        _demand_whole(_LEAST_WINDOW, _LARGEST_WINDOW, window=self.window)
        if self.window % 2 == 0:
            raise InputError(f"window is {self.window}, wanted an odd number of bins")

    def __call__(self, stack: Floats, device: Device) -> Floats:
        """Filter projections (view, row, bin)."""
        return mend_columns(stack, device, self.mend)

    def mend(self, columns: DetectorColumns) -> None:
        """Filter columns in place."""
        columns.sort()
        columns.median(self.window_for(columns.bins))
        columns.unsort()

    def window_for(self, bins: int) -> int:
        """Window in bins for a detector's width.

        Raises:
            InputError: the window that was asked for is wider than the detector.
        """
        if self.window is None:
            share = odd_window(WINDOW, bins // _BINS_PER_WINDOW * 8)
            return max(_LEAST_WINDOW, share)
        if self.window > bins:
            raise InputError(f"window is {self.window}, the detector has {bins} bins: take fewer")
        return self.window


@dataclass(frozen=True)
class LargeStripes:
    """Algorithm 5: replace bins whose level stands out, rank by rank, from their neighbours.

    Args:
        ratio: a stripe begins and ends with steps of the level so many times the usual one.
        normalise: also bring the level of every bin to the median of those around it.
    """

    ratio: float = 5.0
    normalise: bool = True

    def __post_init__(self) -> None:
        """Check the ratio."""
        _demand_above(1, ratio=self.ratio)
        checked_flag("LargeStripes", "normalise", self.normalise)

    def __call__(self, stack: Floats, device: Device) -> Floats:
        """Filter projections (view, row, bin)."""
        return mend_columns(stack, device, self.mend)

    def mend(self, columns: DetectorColumns) -> None:
        """Filter columns in place."""
        columns.sort()
        self.mend_sorted(columns)
        columns.unsort()

    def mend_sorted(self, columns: DetectorColumns) -> None:
        """Filter columns that are sorted, and stay so."""
        dropped = int(_DROPPED * columns.views)
        levels = columns.levels(dropped)
        columns.interpolate(np.stack([offset(level, self.ratio) for level in levels]))
        if self.normalise:
            columns.subtract(np.stack([unevenness(level) for level in columns.levels(dropped)]))


@dataclass(frozen=True)
class DeadStripes:
    """Algorithm 6: interpolate bins that follow no view, or jump from view to view.

    Args:
        ratio: how far a bin's roughness along the views has to stand out of the others'.
    """

    ratio: float = 3.0

    def __post_init__(self) -> None:
        """Check the ratio."""
        _demand_above(1, ratio=self.ratio)

    def __call__(self, stack: Floats, device: Device) -> Floats:
        """Filter projections (view, row, bin)."""
        return mend_columns(stack, device, self.mend)

    def mend(self, columns: DetectorColumns) -> None:
        """Filter columns in place."""
        roughness = columns.roughness()
        columns.interpolate(np.stack([fluctuating(rough, self.ratio) for rough in roughness]))


@dataclass(frozen=True)
class CombinedFilter:
    """Dead bins, large stripes, then the sorting filter for the rest: section 4 of the paper.

    Args:
        window: bins of the median; see ``SortingFilter``.
        large_ratio: see ``LargeStripes``.
        dead_ratio: see ``DeadStripes``.
        normalise: see ``LargeStripes``; it removes broad rings, and with them what the object has
            that is round about the axis.
    """

    window: int | None = None
    large_ratio: float = LargeStripes.ratio
    dead_ratio: float = DeadStripes.ratio
    normalise: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        SortingFilter(self.window)
        _demand_above(1, large_ratio=self.large_ratio, dead_ratio=self.dead_ratio)
        checked_flag("CombinedFilter", "normalise", self.normalise)

    def __call__(self, stack: Floats, device: Device) -> Floats:
        """Filter projections (view, row, bin)."""
        return mend_columns(stack, device, self._mend)

    def _mend(self, columns: DetectorColumns) -> None:
        DeadStripes(self.dead_ratio).mend(columns)
        columns.sort()
        LargeStripes(self.large_ratio, self.normalise).mend_sorted(columns)
        columns.median(SortingFilter(self.window).window_for(columns.bins))
        columns.unsort()


@dataclass(frozen=True)
class LowPassFilter:
    """Algorithm 2: apply the sorting filter to what varies slowly along the views.

    What changes from view to view is kept as it is, so that fine texture is not blurred.

    Args:
        smoothing: standard deviation of the Gaussian along the views, as a share of their number.
        window: bins of the median; see ``SortingFilter``.
    """

    smoothing: float = 0.05
    window: int | None = None

    def __post_init__(self) -> None:
        """Check the options."""
        _demand_above(0, smoothing=self.smoothing)
        SortingFilter(self.window)

    def __call__(self, stack: Floats, device: Device) -> Floats:
        """Filter projections (view, row, bin)."""
        slow = _gaussian(stack, self.smoothing * len(stack), axis=0)
        clean: Floats = stack - slow + SortingFilter(self.window)(slow, device)
        return clean


@dataclass(frozen=True)
class FittingFilter:
    """Algorithm 1: fit each bin by a polynomial of the view, and smooth the fits across bins.

    Right for low stripes in objects that vary slowly from view to view; an object with sharp edges
    is smoothed with them.

    Args:
        degree: of the polynomial.
        smoothing: standard deviation of the Gaussian across bins, as a share of their number.
    """

    degree: int = 2
    smoothing: float = 0.016

    def __post_init__(self) -> None:
        """Check the options."""
        _demand_above(0, smoothing=self.smoothing)
        _demand_whole(0, FEWEST_VIEWS - 1, degree=self.degree)

    def __call__(self, stack: Floats, device: Device) -> Floats:
        """Filter projections (view, row, bin)."""
        del device
        place = np.linspace(-1, 1, len(stack))
        basis, _ = np.linalg.qr(np.polynomial.legendre.legvander(place, self.degree))
        out = np.empty_like(stack)
        for row in range(stack.shape[1]):
            fit = basis @ (basis.T @ stack[:, row].astype(np.float64))
            smooth = _gaussian(fit, self.smoothing * stack.shape[2], axis=1)
            out[:, row] = stack[:, row] - (fit - smooth)
        return out


@dataclass(frozen=True)
class WaveletFourierFilter:
    """Damp the slow changes along the views of each vertical detail of a wavelet transform.

    Needs PyWavelets.

    Args:
        levels: of the transform, 1 to 10, for stripes of up to about 2^levels bins; more of them
            damp more of the object. If not given, 5 on 2,000 bins and one fewer on half as many.
        width: of the damped band, in samples of the Fourier transform along the views.
        wavelet: name in PyWavelets.
    """

    levels: int | None = None
    width: float = 1.0
    wavelet: str = "db9"

    def __post_init__(self) -> None:
        """Check the options."""
        _demand_above(0, width=self.width)
        if self.levels is not None:
            _demand_whole(1, _MOST_LEVELS, levels=self.levels)

    def __call__(self, stack: Floats, device: Device) -> Floats:
        """Filter projections (view, row, bin)."""
        del device
        rows = (self._filtered(stack[:, row]) for row in range(stack.shape[1]))
        return np.stack(list(rows), axis=1)

    def _filtered(self, sinogram: Floats) -> Floats:
        pywt = self._library()
        usual = max(1, (sinogram.shape[1] // _BINS_PER_LEVEL).bit_length() - 1)
        levels = usual if self.levels is None else self.levels
        # An axis that is too short for so many levels is mirrored until it is long enough.
        least = (pywt.Wavelet(self.wavelet).dec_len - 1) << levels
        margins = [max(0, -(-(least - count) // 2)) for count in sinogram.shape]
        longer = np.pad(sinogram, [(margin, margin) for margin in margins], "symmetric")
        coarse, *details = pywt.wavedec2(longer, self.wavelet, "symmetric", level=levels)
        damped = [(across, self._damped(along), both) for across, along, both in details]
        clean = pywt.waverec2([coarse, *damped], self.wavelet, "symmetric")
        inner = tuple(
            slice(margin, margin + count)
            for margin, count in zip(margins, sinogram.shape, strict=True)
        )
        return np.asarray(clean[inner], np.float32)

    def _damped(self, detail: NDArray[Any]) -> NDArray[Any]:
        """A detail that varies across bins, without what is constant along the views."""
        frequency = np.fft.rfftfreq(len(detail), 1 / len(detail))
        keep = 1 - np.exp(-(frequency**2) / (2 * self.width**2))
        spectrum = np.fft.rfft(detail, axis=0) * keep[:, None]
        damped: NDArray[Any] = np.fft.irfft(spectrum, len(detail), axis=0)
        return damped

    def _library(self) -> Any:
        try:
            import pywt
        except ImportError as error:
            raise InputError(
                "the method wavelet-fft needs PyWavelets, which is not installed: run "
                "'pip install PyWavelets', or take another method"
            ) from error
        if self.wavelet not in pywt.wavelist(kind="discrete"):
            raise InputError(f"wavelet is {self.wavelet!r}, wanted a discrete one such as 'db9'")
        return pywt


STRIPE_METHODS: dict[str, Callable[..., StripeMethod]] = {
    "vo": CombinedFilter,
    "sorting": SortingFilter,
    "filtering": LowPassFilter,
    "fitting": FittingFilter,
    "large": LargeStripes,
    "dead": DeadStripes,
    "wavelet-fft": WaveletFourierFilter,
}


def remove_rings(
    projections: Any, *, method: str = "vo", device: Device | None = None, **options: Any
) -> Floats:
    """Remove stripes from line integrals, so that slices have no rings.

    Every row is treated by itself: the result does not depend on how rows are grouped.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin).
        method: a name in ``STRIPE_METHODS``.
        device: where to compute; the default device if not given.
        options: of the method; see its class.

    Returns:
        float32 projections of the same shape, a new array. A scan of fewer than 16 views or bins is
        returned as it is: there, a stripe cannot be told from the object.

    Raises:
        ShapeError: the array has other axes.
        NonFiniteError: a value is NaN or infinite.
        InputError: there is no such method, or it has no such option or value.
    """
    stripe_method = _method(method, options)
    stack = as_projections(projections, name="projections")
    if stack.shape[0] < FEWEST_VIEWS or stack.shape[-1] < _FEWEST_BINS or not stack.size:
        return stack.copy()
    rows = stack if stack.ndim == 3 else stack[:, None]
    return stripe_method(rows, device or default_device()).reshape(stack.shape)


def _method(name: str, options: dict[str, Any]) -> StripeMethod:
    if name not in STRIPE_METHODS:
        raise InputError(f"method is {name!r}, wanted one of {', '.join(STRIPE_METHODS)}")
    kind: Any = STRIPE_METHODS[name]
    known = [field.name for field in dataclasses.fields(kind)]
    for option in options:
        if option not in known:
            raise InputError(f"method {name!r} has no option {option!r}, only {', '.join(known)}")
    made: StripeMethod = kind(**options)
    return made


def _demand_above(least: float, **values: Any) -> None:
    for name, value in values.items():
        if (
            not isinstance(value, (int, float, np.floating, np.integer))
            or not least < value < np.inf
        ):
            raise InputError(f"{name} is {value!r}, wanted a number above {least}")


def _demand_whole(least: int, most: int, **values: Any) -> None:
    for name, value in values.items():
        if not isinstance(value, (int, np.integer)) or not least <= value <= most:
            raise InputError(f"{name} is {value!r}, wanted a whole number from {least} to {most}")


def _gaussian(values: NDArray[Any], deviation: float, *, axis: int) -> NDArray[Any]:
    """Values smoothed by a Gaussian (width in samples), mirrored at the ends.

    The cosine transform is that of the values mirrored without end.
    """
    from scipy.fft import dct, idct

    count = values.shape[axis]
    response = np.exp(-((np.pi * deviation / count * np.arange(count)) ** 2) / 2)
    shape = [count if number == axis else 1 for number in range(values.ndim)]
    weights = response.astype(values.dtype).reshape(shape)
    smooth: NDArray[Any] = idct(dct(values, axis=axis) * weights, axis=axis)
    return smooth
