"""Filters along the detector: convolution kernels from their definitions, rows one by one.

The kernel of a response R that depends on the magnitude of frequency alone, sampled at the bins,
is ``h[n] = 2 * integral from 0 to Nyquist of R(f) cos(2 pi f n pitch) df`` with Nyquist
``1 / (2 pitch)``. The closed forms are Kak and Slaney, Principles of Computerized Tomographic
Imaging, eq. 3.61 (ramp) and Shepp and Logan (IEEE Trans. Nucl. Sci. 21, 1974), eq. 20.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def ramp_taps(bins: int, pitch: float) -> Floats:
    """The ramp's kernel h[-(bins-1)] .. h[bins-1]: 1/4, -1/(pi n)^2 where n is odd, else 0."""
    n = np.arange(-(bins - 1), bins)
    taps = np.zeros(len(n))
    taps[n % 2 == 1] = -1 / (np.pi * n[n % 2 == 1]) ** 2
    taps[n == 0] = 1 / 4
    return taps / pitch**2


def shepp_logan_taps(bins: int, pitch: float) -> Floats:
    """The kernel of the ramp under the window sinc(f pitch)."""
    n = np.arange(-(bins - 1), bins)
    return -2 / (np.pi**2 * (4.0 * n**2 - 1)) / pitch**2


def response_taps(
    response: Callable[[Floats], Floats], bins: int, pitch: float, *, cutoff: float = 1.0
) -> Floats:
    """The kernel h[-(bins-1)] .. h[bins-1] of any response, by Gauss-Legendre quadrature.

    Args:
        response: smooth function of the frequency, in cycles per unit of length.
        bins: number of detector bins.
        pitch: distance between bins.
        cutoff: fraction of Nyquist above which the response is zero.
    """
    nodes, weights = np.polynomial.legendre.leggauss(16)
    width = cutoff * 0.5 / pitch / bins
    f = (np.arange(bins)[:, None] + (nodes + 1) / 2).ravel() * width
    measure = np.tile(weights / 2 * width, bins)
    n = np.arange(-(bins - 1), bins)
    taps: Floats = 2 * np.cos(2 * np.pi * pitch * np.outer(n, f)) @ (response(f) * measure)
    return taps


def filter_rows(
    sinogram: ArrayLike, taps: Floats, pitch: float, gains: ArrayLike | None = None
) -> Floats:
    """Convolve every detector row with its kernel; outside the detector a row counts as zero.

    Args:
        sinogram: (angles, bins) or (angles, rows, bins).
        taps: h[-(bins-1)] .. h[bins-1], in 1 / length^2; or one kernel for each view,
            (angles, 2 bins - 1).
        pitch: distance between bins, the measure of the convolution's sum.
        gains: (angles,) factors of the views.
    """
    views = np.array(sinogram, dtype=np.float64)
    bins = views.shape[-1]
    kernels = np.broadcast_to(taps, (len(views), 2 * bins - 1))
    for index in np.ndindex(views.shape[:-1]):
        kernel = kernels[index[0]]
        views[index] = pitch * np.convolve(views[index], kernel)[bins - 1 : 2 * bins - 1]
    if gains is not None:
        views *= np.reshape(gains, (-1,) + (1,) * (views.ndim - 1))
    return views


def weigh_rays(
    projections: ArrayLike, pixels: ArrayLike, views: ArrayLike, before: int = 0
) -> Floats:
    """Lay projections onto a wider detector and multiply them by its factors.

    Args:
        projections: (views, rows, bins).
        pixels: (rows, wider bins) factors of the wider detector's pixels, or (1, wider bins).
        views: (views, wider bins) factors, or (1, wider bins).
        before: bins of the wider detector before the first of ``projections``.
    """
    narrow = np.asarray(projections, dtype=np.float64)
    factors: Floats = np.asarray(pixels)[None] * np.asarray(views, dtype=np.float64)[:, None]
    after = factors.shape[-1] - narrow.shape[-1] - before
    return factors * np.pad(narrow, [(0, 0), (0, 0), (before, after)])
