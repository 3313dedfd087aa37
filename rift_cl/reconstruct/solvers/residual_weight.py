"""How strongly each frequency of the residual counts: the preconditioners of the solvers.

A solver that descends along ``A'(A x - y)`` sets low frequencies right at once and high ones late,
since every view sees the low ones. With a self-adjoint positive F it descends along
``A' F (A x - y)`` instead and minimises ``|F^(1/2) (A x - y)|^2``; with F the ramp, A' F A is next
to a multiple of the identity, and a few steps do.

The ramp lifts noise as well, and where noise is most of the data that costs more than it gains. So
where the noise's standard deviation is given, the ramp is multiplied by the square of the share of
the signal that a Wiener filter would keep,

    share(f) = d S(f) / (d S(f) + noise^2),      d = max(1, views / (pi f diameter)),

S the power of the data less that of the noise, taken for falling with frequency, and d how often
the views see a frequency of the image (Crowther, DeRosier and Klug 1970). Squared, since a few
steps multiply what passes at first: after n the response is ``1 - (1 - share^2)^n``.

What is spared stays in the residual, so that a fit that cannot follow the data there, because it
must not be negative or an edge is sharp, may never come down to the noise. SIRT then looks at the
weighted residual as well; total variation does no harm then, and goes on until the count ends it.

F is dimensionless, and its gain to white noise, the mean of its diagonal, is 1: the residual of a
solution has the same weighted size with and without it, and with it the weight of a regularisation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.host_arrays import download, is_device_array
from rift_cl.errors import DeviceError, DTypeError, InputError, ShapeError
from rift_cl.geometry import Parallel, at_axis
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.ramp_filters import Ramp, Response, ViewFilter
from rift_cl.operators.linear import LinearOperator

Floats = NDArray[np.float64]
Precondition = str | LinearOperator | None
Share = Callable[[Floats], Floats]

# The least share: its square keeps F from being singular in float32.
_LEAST = 0.1
# Rows of the data that are looked at, evenly spaced.
_ROWS = 2048
# Samples of the spectrum that are averaged, as far as they are independent.
_AVERAGED = 256
# Frequencies for each bin over which the gain to white noise is averaged.
_FINE, _COARSE = 16, 2
NAMES = ("ramp", *COMPENSATIONS)


def residual_weight(
    A: LinearOperator, y: Any, precondition: Precondition, noise: float | None
) -> LinearOperator | None:
    """The operator F on the residual, or None for the plain one.

    Args:
        A: the operator that is inverted.
        y: the data, of shape ``A.range``, on the device or on the host.
        precondition: None, ``ramp``, a compensation such as ``capped-voronoi`` (each view's ramp
            times what it alone knows, for views that lie unevenly), or a self-adjoint positive
            operator on ``A.range``, which is taken as it is.
        noise: standard deviation of the data's noise, if known.

    Raises:
        InputError: the name is unknown, or A is no projector of a scan.
        ShapeError: the operator is not one on ``A.range``.
        DTypeError: it works in another type than A.
        DeviceError: it works on another device than A.
    """
    if precondition is None:
        return None
    if isinstance(precondition, LinearOperator):
        return _checked(A, precondition)
    if not isinstance(precondition, str) or precondition not in NAMES:
        raise InputError(
            f"precondition is {precondition!r}, wanted None, one of {', '.join(NAMES)}, or a "
            "LinearOperator on A.range"
        )
    scan = A.scan
    if scan is None:
        raise InputError(
            f"precondition is {precondition!r}, but A ({type(A).__name__}) has no scan to build it "
            "for: pass a LinearOperator on A.range"
        )
    rows = at_axis(scan)
    return _ramp(A, rows, precondition, _kept_share(A, rows, y, noise))


def _checked(A: LinearOperator, F: LinearOperator) -> LinearOperator:
    if (F.domain, F.range) != (A.range, A.range):
        raise ShapeError(
            f"precondition maps {F.domain} to {F.range}, wanted an operator on A.range {A.range}"
        )
    if F.dtype != A.dtype:
        raise DTypeError(f"precondition works in {F.dtype}, A in {A.dtype}: make both alike")
    if F.device is not A.device:
        raise DeviceError(
            f"precondition works on {F.device.name}, A on {A.device.name}: make both on one Device"
        )
    return F


def _ramp(A: LinearOperator, scan: Parallel, name: str, share: Share) -> LinearOperator:
    """The ramp times the square of a share, with a mean gain of 1."""
    # A compensation is a table of views and frequencies, in float64: fewer do for its mean.
    count = (_FINE if name == "ramp" else _COARSE) * scan.bins
    middle = np.arange(0.5, count) * (0.5 / scan.pitch / count)
    given: dict[str, Any] = {
        "rows": A.range[1] if len(A.range) == 3 else None,
        "device": A.device,
        "dtype": A.dtype,
    }
    if name == "ramp":
        mean = float(np.mean(middle * share(middle) ** 2))
        return ViewFilter(scan, Response(lambda f: f * share(f) ** 2 / mean), **given)
    views = Compensation(scan.angles, name, _diameter(A, scan))
    total = float(np.mean(middle * share(middle) ** 2 * views(middle)))

    def gains(f: Floats) -> Floats:
        return views(f) * share(f) ** 2 / total

    return ViewFilter(scan, Ramp(), gains=gains, **given)


def _kept_share(A: LinearOperator, scan: Parallel, y: Any, noise: float | None) -> Share:
    """Factor of each frequency, as a function of frequencies in cycles per length."""
    # Beyond these a square is no number any more.
    variance = 0.0 if noise is None else min(noise, 1e150) ** 2
    if variance == 0:
        return np.ones_like
    host = download(A.device, y) if is_device_array(y) else y
    frequencies, power = mean_power(host, scan.pitch)
    signal = np.minimum.accumulate(np.maximum(power - variance, 0))
    diameter = _diameter(A, scan)

    def share(f: Floats) -> Floats:
        seen = len(scan.angles) / (math.pi * np.maximum(f, 1e-6 / diameter) * diameter)
        found = np.maximum(seen, 1) * np.interp(f, frequencies, signal)
        return np.maximum(found / (found + variance), _LEAST)

    return share


def _diameter(A: LinearOperator, scan: Parallel) -> float:
    """Of the object: the grid's longer edge, as far as the detector sees it."""
    seen = scan.bins * scan.pitch
    if A.grid is None:
        return seen
    plane = A.grid.slice()
    longest = max(n * h for n, h in zip(plane.shape, plane.spacing, strict=True))
    return min(seen, float(longest))


def mean_power(y: NDArray[Any], pitch: float) -> tuple[Floats, Floats]:
    """The mean power of a detector's rows at frequencies along it, smoothed.

    Args:
        y: data (angles, bins) or (angles, rows, bins).
        pitch: distance between bins.

    Returns:
        Frequencies in cycles per length, from 0 to Nyquist, and the power per bin there, which for
        white noise is its variance. The fewer rows there are the more neighbours are averaged.
    """
    rows = y.reshape(-1, y.shape[-1])
    rows = rows[:: -(-len(rows) // _ROWS)].astype(np.float64)
    bins = rows.shape[1]
    length = 1 << (4 * bins - 1).bit_length()
    power = np.mean(np.abs(np.fft.rfft(rows, length, axis=1)) ** 2, axis=0) / bins
    # So many values that the mean of white noise is good to some per cent.
    reach = math.ceil(_AVERAGED * length / bins / len(rows) / 2)
    reach = min(max(reach, length // bins // 2), len(power) // 8)
    padded = np.pad(power, reach, mode="symmetric")
    sums = np.concatenate([[0.0], np.cumsum(padded)])
    smooth = (sums[2 * reach + 1 :] - sums[: -2 * reach - 1]) / (2 * reach + 1)
    return np.asarray(np.fft.rfftfreq(length, pitch), np.float64), np.asarray(smooth)
