"""Filters along the detector: the ramp and its windows, a tunable high-pass, any response.

A filter is designed on the host as a convolution kernel in real space and applied on the device
without wrap-around; each view may have a response of its own. The ramp is built from its exact
samples in real space (Ramachandran and Lakshminarayanan 1971; Kak and Slaney, Principles of
Computerized Tomographic Imaging, eq. 3.61), so that its value at frequency zero, and with it the
level of a reconstruction, is right: about 1 / (pi^2 bins pitch), the part of the infinite kernel
that lies beyond the detector, which is small and not zero.
"""

from __future__ import annotations

import math
import warnings
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from numbers import Real
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import check_array, check_host, cut_evenly, plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.cl.host_arrays import check_finite
from rift_cl.errors import InputError, ResourceLimitError, ShapeError, check_type
from rift_cl.geometry import Parallel
from rift_cl.operators.filters.row_convolution import SHORT_ROW, RowConvolution
from rift_cl.operators.fourier.row_transform import RowTransform
from rift_cl.operators.linear import Chunk, LinearOperator
from rift_cl.registry import Registry

Floats = NDArray[np.float64]
Gains = ArrayLike | Callable[[Floats], ArrayLike]

# Windows over u = frequency / (cutoff * Nyquist), 0 <= u <= 1.
WINDOWS: dict[str, Callable[[Floats], Floats]] = {
    "ram-lak": np.ones_like,
    "shepp-logan": lambda u: np.sinc(u / 2),
    "cosine": lambda u: np.cos(np.pi * u / 2),
    "hamming": lambda u: 0.54 + 0.46 * np.cos(np.pi * u),
    "hann": lambda u: 0.5 + 0.5 * np.cos(np.pi * u),
}
HIGH_PASS = "high-pass"
# A response that is no ramp is sampled this many times finer than the detector can tell apart.
_OVERSAMPLING = 16
# What the design of a filter takes on the host for each bin: some arrays four times as long.
_HOST_BYTES = 128
# A response that keeps less than such a part of the ramp, or differs from it by more than such a
# factor where both begin, is hardly meant so. Factors that come of another convention (2, pi / 2,
# the root of 2) are greater; less are windows that end low, and a ramp whose exact samples were
# transformed and interpolated, 1.18 times the ramp between zero and the first frequency.
_LEAST_OF_RAMP, _LEVEL = 1e-3, 1.25


@runtime_checkable
class Filter(Protocol):
    """Anything that gives its convolution kernel is a filter."""

    def taps(self, bins: int, pitch: float) -> Floats:
        """Convolution kernel h[-(bins-1)] .. h[bins-1], symmetric, in 1 / length^2.

        Args:
            bins: of the detector.
            pitch: distance between bins.
        """
        ...


@dataclass(frozen=True)
class Ramp:
    """The ramp |f| under a window: what makes filtered backprojection quantitative.

    Args:
        window: ``ram-lak`` (none), ``shepp-logan``, ``cosine``, ``hamming`` or ``hann``.
        cutoff: where the window ends, as a fraction of the detector's Nyquist frequency.
    """

    window: str = "ram-lak"
    cutoff: float = 1.0

    def __post_init__(self) -> None:
        """Check the window's name and cutoff."""
        check_type("Ramp", "window", self.window, str)
        check_type("Ramp", "cutoff", self.cutoff, Real)
        object.__setattr__(self, "cutoff", float(self.cutoff))
        if self.window not in WINDOWS:
            raise InputError(f"window is {self.window!r}, wanted one of {', '.join(WINDOWS)}")
        if not 0 < self.cutoff <= 1:
            raise InputError(f"cutoff is {self.cutoff}, wanted a fraction of Nyquist, 0 < c <= 1")

    def taps(self, bins: int, pitch: float) -> Floats:
        """Convolution kernel h[-(bins-1)] .. h[bins-1], in 1 / length^2."""
        length = 1 << (2 * bins).bit_length()
        n = np.abs(np.fft.fftfreq(length, 1 / length))
        exact = np.where(n % 2 == 1, -1 / (np.pi * np.maximum(n, 1)) ** 2, 0.0)
        exact[0] = 0.25  # at position zero; what is at frequency zero is the sum of all taps
        u = 2 * np.fft.rfftfreq(length) / self.cutoff
        window = WINDOWS[self.window](np.minimum(u, 1))
        if self.cutoff < 1:
            # A frequency of the transform stands for those half a step about it, so that the one
            # at which the window ends counts for the part that is within.
            window[1:] *= np.clip((1 - u[1:]) / u[1] + 0.5, 0, 1)
        kernel = np.fft.irfft(np.fft.rfft(exact) * window, length)[:bins] / pitch**2
        return np.concatenate([kernel[:0:-1], kernel])


@dataclass(frozen=True)
class HighPass:
    """The tunable high-pass |f|^exponent: 1 is the ramp, 0 passes everything alike.

    Between the two it removes a part of the low-frequency bias of views on an orbit.
    The response is scaled to meet the ramp at the Nyquist frequency, where both pass the most.

    Args:
        exponent: 0 or more.
    """

    exponent: float = 1.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        check_type("HighPass", "exponent", self.exponent, Real)
        object.__setattr__(self, "exponent", float(self.exponent))
        if not 0 <= self.exponent < np.inf:
            raise InputError(f"exponent is {self.exponent}, wanted a number >= 0")

    def taps(self, bins: int, pitch: float) -> Floats:
        """Convolution kernel h[-(bins-1)] .. h[bins-1], in 1 / length^2."""
        nyquist = 0.5 / pitch
        return Response(lambda f: nyquist * (f / nyquist) ** self.exponent).taps(bins, pitch)


@dataclass(frozen=True)
class Response:
    """Any response that depends on the magnitude of frequency alone.

    Args:
        function: the response (1 / length, as the ramp's is) at frequencies given in cycles per
            unit of length, an array of them at a time, from 0 to the detector's Nyquist: a share
            of that is ``f / f.max()``.
    """

    function: Callable[[Floats], ArrayLike]

    def taps(self, bins: int, pitch: float) -> Floats:
        """Convolution kernel h[-(bins-1)] .. h[bins-1]: the cosine transform of the response."""
        from scipy.fft import dct

        count = _OVERSAMPLING * bins
        frequencies = self._frequencies(bins, pitch)
        kernel = 0.5 / pitch / count * dct(self._values(frequencies), type=2)[:bins]
        return np.concatenate([kernel[:0:-1], kernel])

    def doubt(self, bins: int, pitch: float) -> str | None:
        """Why an image would not have the object's values, in a sentence; None where it may.

        Where the response falls short of the ramp at the lowest frequencies, levels are wrong;
        where it keeps next to nothing of the ramp, its frequencies were meant in another unit.
        """
        frequencies = self._frequencies(bins, pitch)
        ratios = self._values(frequencies) / frequencies
        kept = float(np.sum(np.abs(ratios) * frequencies) / np.sum(frequencies))
        if kept < _LEAST_OF_RAMP:
            return (
                f"filter {self._name} keeps {100 * kept:.2g} % of the ramp up to the detector's "
                f"Nyquist frequency, {0.5 / pitch:.4g} cycles per unit of length: are its "
                "frequencies meant in cycles per bin?"
            )
        level = float(np.median(ratios[:_OVERSAMPLING]))
        if not 1 / _LEVEL <= level <= _LEVEL:
            return (
                f"filter {self._name} is {level:.3g} times the ramp |f| at the lowest frequencies: "
                "values will not be the object's"
            )
        return None

    @property
    def _name(self) -> str:
        return repr(getattr(self.function, "__name__", type(self.function).__name__))

    @staticmethod
    def _frequencies(bins: int, pitch: float) -> Floats:
        count = _OVERSAMPLING * bins
        middles: Floats = (np.arange(count, dtype=np.float64) + 0.5) * (0.5 / pitch / count)
        return middles

    def _values(self, frequencies: Floats) -> Floats:
        try:
            # A copy, since the function may change its argument, which is compared with the result.
            values = np.asarray(self.function(frequencies.copy()))
        except TypeError as error:
            raise InputError(
                f"filter {self._name}: its response cannot be called with an array of frequencies "
                f"alone ({error})"
            ) from error
        wanted = f"wanted one finite number for each of the {len(frequencies)} frequencies"
        if values.dtype.kind not in "fiub" or values.shape != frequencies.shape:
            raise InputError(
                f"filter {self._name}: its response is of type {values.dtype} and shape "
                f"{values.shape}, {wanted}"
            )
        bad = ~(np.abs(values) <= np.finfo(np.float32).max)
        if bad.any():
            at = int(np.argmax(bad))
            raise InputError(
                f"filter {self._name}: its response is {values[at]:.4g} at {frequencies[at]:.4g} "
                f"cycles per unit of length, {wanted}"
            )
        return values.astype(np.float64)


def warn_of_doubt(filter: Filter, scan: Parallel) -> None:
    """Warn whoever called the caller of what speaks against a response; see ``Response.doubt``."""
    if isinstance(filter, Response) and (doubt := filter.doubt(scan.bins, scan.pitch)):
        warnings.warn(doubt, stacklevel=3)


@dataclass(frozen=True)
class Finer:
    """A filter on bins that were read between wider ones: it passes what these can hold.

    Args:
        filter: as it is on the wider bins.
        times: how many of the finer bins stand in the place of one.
    """

    filter: Filter
    times: int

    def taps(self, bins: int, pitch: float) -> Floats:
        """Convolution kernel h[-(bins-1)] .. h[bins-1], that of the wider bins, band-limited."""
        half = 2 * bins
        wide = self.filter.taps(half, self.times * pitch)[half - 1 :]
        response = np.fft.rfft(np.concatenate([wide, [0.0], wide[:0:-1]])).real
        # The Nyquist frequency of the wider bins is one of two signs on the finer.
        response[-1] /= 2
        kernel = self.times * np.fft.irfft(response, 2 * half * self.times)[:bins]
        return np.concatenate([kernel[:0:-1], kernel])


FilterLike = str | Filter | Callable[[Floats], ArrayLike]
FILTERS: Registry[Filter] = Registry(
    "filter", {**{window: Ramp(window) for window in WINDOWS}, HIGH_PASS: HighPass()}
)


def register_filter(
    name: str, filter: Filter | Callable[[Floats], ArrayLike], *, replace: bool = False
) -> None:
    """Make a filter known by a name, for ``fbp(filter=name)`` and ``--filter name``.

    Args:
        name: what it is called from now on, in this process.
        filter: a filter, or a response function as ``Response`` takes it.
        replace: take the place of one that was registered by that name before.

    Raises:
        InputError: the name is taken, or the filter is neither of the two.
    """
    if isinstance(filter, str):
        raise InputError(f"register_filter: {filter!r} is a name, wanted a filter or a function")
    FILTERS.add(name, as_filter(filter), replace=replace)


def as_filter(filter: FilterLike) -> Filter:
    """A filter from its name, itself, or a response function.

    Raises:
        InputError: it is none of these, or the name is unknown.
    """
    if isinstance(filter, str):
        return FILTERS[filter]
    if isinstance(filter, Filter):
        return filter
    if callable(filter):
        return Response(filter)
    raise InputError(f"filter is {filter!r}, wanted a name, a filter or a function of frequency")


class ViewFilter(LinearOperator):
    """A filter along the detector, applied to every row of every view.

    Args:
        scan: the scan whose views are filtered.
        filter: the filter.
        rows: detector rows in a view, None for a sinogram of (angles, bins).
        gains: what the response is multiplied by in each view, (angles,); 1 if not given. Or a
            function that takes frequencies, (n,) from 0 to the detector's Nyquist in cycles per
            unit of length, to gains of (angles, n); what it gives at zero is the gain of the
            filter's exact value there.
        device: the device to use; the default device if not given.
        dtype: float32 or float64.

    Domain and range are (angles, bins) or (angles, rows, bins). The operator is its own adjoint.
    A filter that all views share is applied in real space to short rows; long rows, and views with
    responses of their own, are filtered in the Fourier domain.

    Raises:
        InputError: gains have another shape or are not finite.
    """

    def __init__(
        self,
        scan: Parallel,
        filter: Filter,
        *,
        rows: int | None = None,
        gains: Gains | None = None,
        device: Device | None = None,
        dtype: DTypeLike = np.float32,
    ) -> None:
        shape = (len(scan.angles), *(() if rows is None else (rows,)), scan.bins)
        super().__init__(shape, shape, device or default_device(), dtype)
        if rows is not None and rows < 1:
            raise ShapeError(f"rows is {rows}, wanted at least 1 detector row")
        check_host(_HOST_BYTES * scan.bins, what=f"a filter of {scan.bins} bins")
        self.filter = filter
        self._views, self._rows, self._given_gains = scan, rows, gains
        self._factors, self._taps = _factors_and_taps(scan, filter, gains)
        self._taps *= scan.pitch

    @cached_property
    def _gains(self) -> DeviceArray:
        return self.device.array(self._factors, self.dtype)

    @cached_property
    def _convolve(self) -> RowConvolution | RowTransform:
        if len(self._taps) == 1 and self.domain[-1] <= SHORT_ROW:
            return RowConvolution(self.device, self._taps, self.dtype)
        return RowTransform(self.device, self._taps, math.prod(self.domain[:-1]), self.dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        settled = partial(
            ViewFilter,
            rows=self._rows,
            gains=self._given_gains,
            device=self.device,
            dtype=self.dtype,
        )
        return settled, (self._views, self.filter)

    def _facts(self) -> list[str]:
        gains = [] if self._given_gains is None else ["gains of each view"]
        return [repr(self.filter), *gains]

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        self._convolve(x, out, self._gains, x.shape[1] if len(x.shape) == 3 else 1)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        self._apply(y, out)

    @property
    def scratch(self) -> int:
        """Bytes needed besides the views that go in and come out."""
        return self._convolve.scratch

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array besides the views."""
        return self._convolve.largest_array

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        """Some views, where all are filtered alike; else some rows of all, or views by theirs."""
        if self._alike:
            chunks = self._parts(self.domain[0], budget, what="view")
            return [Chunk((chunk,), (chunk,)) for chunk in chunks]
        try:
            if len(self.domain) == 2:
                self._parts(1, budget, what="sinogram with gains of its views")
                return [Chunk((), ())]
            chunks = self._parts(self.domain[1], budget, what="row of every view")
            return [Chunk((slice(None), chunk), (slice(None), chunk)) for chunk in chunks]
        except ResourceLimitError:
            return self._runs_of_views(budget)

    def _adjoint_chunks(self, budget: int) -> Iterable[Chunk]:
        return self._chunks(budget)

    @property
    def _alike(self) -> bool:
        """Whether any views may stand in the place of any others."""
        return len(self._taps) == 1 and bool((self._factors == self._factors[:1]).all())

    def _parts(self, count: int, budget: int, *, what: str) -> list[slice]:
        """Cut an axis of so many samples."""
        array = self.dtype.itemsize * (math.prod(self.domain) // max(count, 1))
        largest = self.device.traits.allocation
        check_array(self.largest_scratch, largest, what="the responses of all views")
        return plan_chunks(
            count, 2 * array, self.scratch, budget, what=what, array=array, largest=largest
        )

    def _runs_of_views(self, budget: int) -> Iterator[Chunk]:
        """Views with the gains and responses of their own, in one filter after the other.

        Raises:
            ResourceLimitError: not even one view fits.
        """
        views, largest = self.domain[0], self.device.traits.allocation

        def fits(count: int) -> bool:
            run = self.of_views(slice(0, count))
            array = self.dtype.itemsize * math.prod(run.domain)
            enough = 2 * array + run.scratch <= budget
            return enough and max(array, run.largest_scratch) <= largest

        most = bisect_left(range(1, views + 1), True, key=lambda count: not fits(count))
        self.of_views(slice(0, max(most, 1)))._parts(1, budget, what="view with its gain")
        for run in cut_evenly(views, most):
            yield Chunk((run,), (run,), self.of_views(run))

    def of_views(self, run: slice) -> ViewFilter:
        """The filter of some views."""
        part = ViewFilter.__new__(ViewFilter)
        shape = (run.stop - run.start, *self.domain[1:])
        LinearOperator.__init__(part, shape, shape, self.device, self.dtype)
        part._factors = self._factors[run]
        part._taps = self._taps if len(self._taps) == 1 else self._taps[run]
        return part

    def of_rows(self, count: int) -> ViewFilter:
        """The filter of so many rows of each view, whichever they are."""
        part = ViewFilter.__new__(ViewFilter)
        shape = (self.domain[0], count, self.domain[-1])
        LinearOperator.__init__(part, shape, shape, self.device, self.dtype)
        part._factors, part._taps = self._factors, self._taps
        return part


def _factors_and_taps(scan: Parallel, filter: Filter, gains: Gains | None) -> tuple[Floats, Floats]:
    """A factor for each view, and halves of kernels: one for all views, or one for each."""
    views, bins = len(scan.angles), scan.bins
    if not callable(gains):
        factors = np.ones(views) if gains is None else np.asarray(gains, dtype=np.float64)
        if factors.shape != (views,):
            raise ShapeError(f"gains has shape {factors.shape}, wanted one for each of {views}")
        check_finite(factors, name="gains")
        return factors, filter.taps(bins, scan.pitch)[None, bins - 1 :].copy()
    # Twice as fine as the object's size asks for; the filter's own taps reach as far, so that its
    # value at zero is right.
    half = 2 << (bins - 1).bit_length()
    kernel = filter.taps(half, scan.pitch)
    response = np.fft.rfft(np.concatenate([kernel[half - 1 :], [0], kernel[: half - 1]])).real
    frequencies = np.arange(half + 1) / (2 * half * scan.pitch)
    factors = np.asarray(gains(frequencies), dtype=np.float64)
    if factors.shape != (views, half + 1):
        raise ShapeError(
            f"gains gives shape {factors.shape}, wanted one for each of {views} views and "
            f"{half + 1} frequencies"
        )
    check_finite(factors, name="gains")
    taps = np.empty((views, bins))
    for view in range(views):
        taps[view] = np.fft.irfft(response * factors[view], 2 * half)[:bins]
    return np.ones(views), taps
