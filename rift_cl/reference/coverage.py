"""Which frequencies views sample, and how well: the twin of ``coverage.cl``, from definitions.

A view along n is a projection, and so knows the plane n . k = 0 of the target's spectrum (the slice
theorem); a target of diameter D smears that plane to a slab about 1 / D thick, and optics weaken
what lies far out in it. All views together have at k the coverage

    L(k) = sum_j w_j MTF_j(|k_perp|)^2 rho(n_j . k)^2,       k_perp^2 = k^2 - (n . k)^2,

with rho(u) = exp(-(u / SD)^2), SD = 0.5 / D, a smooth stand-in for the spectrum of the target's
window. It is taken at a point of the target, since directions, distances and blur of a perspective
camera differ from point to point. Optics pass

    MTF(k) = MTF_diffraction(k / cutoff) |sinc(pixel k)| |2 J1(pi t) / (pi t)|,
    t = blur k (1 - k / cutoff),

of incoherent light (Goodman, Introduction to Fourier Optics, chapter 6): a round pupil, square
pixels, taken as equal in all directions, and defocus, which for small frequencies is the transform
of the blur disc; with Stokseth's factor (J. Opt. Soc. Am. 59, 1314, 1969) it stays within 0.02 of a
real pupil's up to the cut-off, where the bare disc is up to 0.25 too low.

Float64 throughout: what plans views optimises small problems with these functions.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j0, j1

Floats = NDArray[np.float64]
# Exponents of rho^2 beyond which nothing is left: exp(-30) is 1e-13.
_FAR = 30.0
# Arguments below which quotients by them are taken from their series.
_SMALL = 1e-4
# Least share of a frequency's square across the line of sight: rounding leaves that much, and
# gradients are divided by it.
_ACROSS = 1e-14


class ObservationsLike(Protocol):
    """Views of points, as ``rift_cl.sampling.Observations`` holds them."""

    @property
    def direction(self) -> Floats:
        """(V, P, 3) unit vectors along the lines of sight."""

    @property
    def weight(self) -> Floats:
        """(V, P) relative photons."""

    @property
    def pixel(self) -> Floats:
        """(V, P) edges of pixels in object space."""

    @property
    def cutoff(self) -> Floats:
        """(V, P) cut-offs of diffraction."""

    @property
    def blur(self) -> Floats:
        """(V, P) diameters of the disc of defocus in object space."""


class Transfer(NamedTuple):
    """What optics pass, and its derivatives; all of one shape.

    Args:
        value: 0 .. 1.
        pixel: derivative by the pixel's edge.
        cutoff: by the cut-off.
        blur: by the diameter of the disc of defocus.
        square: by the square of the frequency.
    """

    value: Floats
    pixel: Floats
    cutoff: Floats
    blur: Floats
    square: Floats


class ObservationsGradient(NamedTuple):
    """The gradient of a number by what looks hold, in their shapes.

    Args:
        direction: (V, P, 3) across the line of sight: a unit vector moves only so.
        weight: (V, P), as are the rest.
        pixel: by the pixel's edge.
        cutoff: by the cut-off of diffraction.
        blur: by the diameter of the disc of defocus.
    """

    direction: Floats
    weight: Floats
    pixel: Floats
    cutoff: Floats
    blur: Floats


def optical_transfer(
    k_perp: ArrayLike, pixel: ArrayLike, cutoff: ArrayLike, blur: ArrayLike
) -> Transfer:
    """Modulation transfer of a camera's optics for incoherent light, with its derivatives.

    Args:
        k_perp: frequencies across the line of sight, in cycles per unit of length, >= 0; this and
            the others of shapes that broadcast.
        pixel: edge of a pixel in object space; 0 for none.
        cutoff: incoherent cut-off of diffraction; inf for none.
        blur: diameter of the disc of defocus in object space; 0 for none.
    """
    k, a, c, b = np.broadcast_arrays(
        *(np.asarray(given, np.float64) for given in (k_perp, pixel, cutoff, blur))
    )
    diffraction, fall = _diffraction(k / c)
    square, square_slope = _sinc(a * k)
    left = np.maximum(1 - k / c, 0)
    disc, disc_slope = _jinc(b * k * left)
    sign = np.sign(square) * np.sign(disc)
    by_pixel = sign * diffraction * square_slope * disc
    by_blur = sign * diffraction * square * disc_slope
    by_cutoff = np.abs(square * disc) * fall
    by_k = by_pixel * a + by_blur * b * (1 - 2 * k / c) + by_cutoff / c
    return Transfer(
        value=diffraction * np.abs(square * disc),
        pixel=by_pixel * k,
        cutoff=by_blur * b * (k / c) ** 2 - by_cutoff * (k / c) / c,
        blur=by_blur * k * left,
        square=by_k / np.maximum(2 * k, 1e-150),
    )


def coverage(observations: ObservationsLike, k: ArrayLike, diameter: float) -> Floats:
    """The coverage L, (P, K), of frequencies (K, 3) by views of a target of that diameter."""
    return np.stack(
        [_near(observations, p, k, diameter).coverage() for p in range(_points(observations))]
    )


def coverage_grad(
    observations: ObservationsLike, k: ArrayLike, diameter: float, grad: ArrayLike
) -> ObservationsGradient:
    """The gradient of E by the looks, from dE/dL (P, K)."""
    upstream = np.asarray(grad, np.float64)
    by_point = [
        _near(observations, p, k, diameter).gradient(upstream[p])
        for p in range(_points(observations))
    ]
    return ObservationsGradient(*(np.stack(parts, axis=1) for parts in zip(*by_point, strict=True)))


def _points(observations: ObservationsLike) -> int:
    return int(observations.weight.shape[1])


class _Near(NamedTuple):
    """The pairs of a view and a frequency in its slab, for one point; N of them.

    Args:
        k: (K, 3) all frequencies.
        normals: (V, 3) all directions.
        view: (N,) which view.
        place: (N,) which frequency.
        u: (N,) n . k.
        steepness: 2 / SD^2, of rho^2 = exp(-steepness u^2).
        window: (N,) rho^2.
        weight: (N,) of the view.
        transfer: (N,) of its optics.
    """

    k: Floats
    normals: Floats
    view: NDArray[np.intp]
    place: NDArray[np.intp]
    u: Floats
    steepness: float
    window: Floats
    weight: Floats
    transfer: Transfer

    def coverage(self) -> Floats:
        parts = self.weight * self.window * self.transfer.value**2
        return _summed(self.place, parts, len(self.k))

    def gradient(self, upstream: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """By direction (V, 3), weight, pixel, cutoff and blur (V,)."""
        passed, g = self.transfer, upstream[self.place] * self.window
        by_value = 2 * g * self.weight * passed.value
        # k_perp^2 falls by 2 u du as the slab turns towards k.
        by_u = -2 * self.u * (by_value * passed.square)
        by_u -= 2 * self.u * self.steepness * g * self.weight * passed.value**2
        across = self.k[self.place] - self.u[:, None] * self.normals[self.view]
        turned = by_u[:, None] * across
        return (
            np.stack([self._by_view(turned[:, axis]) for axis in range(3)], axis=1),
            self._by_view(g * passed.value**2),
            self._by_view(by_value * passed.pixel),
            self._by_view(by_value * passed.cutoff),
            self._by_view(by_value * passed.blur),
        )

    def _by_view(self, values: Floats) -> Floats:
        return _summed(self.view, values, len(self.normals))


def _near(
    observations: ObservationsLike, point: int, frequencies: ArrayLike, diameter: float
) -> _Near:
    k, normals = np.asarray(frequencies, np.float64), observations.direction[:, point]
    steepness = 2 * (diameter / 0.5) ** 2
    products = normals @ k.T
    view, place = np.nonzero(steepness * products**2 < _FAR)
    u = products[view, place]
    square = (k**2).sum(1)[place]
    k_perp = np.sqrt(np.maximum(square - u**2, _ACROSS * square))
    optics = (observations.pixel, observations.cutoff, observations.blur)
    transfer = optical_transfer(k_perp, *(values[view, point] for values in optics))
    window, weight = np.exp(-steepness * u**2), observations.weight[view, point]
    return _Near(k, normals, view, place, u, steepness, window, weight, transfer)


def _summed(group: NDArray[np.intp], values: Floats, count: int) -> Floats:
    return np.bincount(group, values, minlength=count).astype(np.float64, copy=False)


def _diffraction(v: Floats) -> tuple[Floats, Floats]:
    """The overlap of two discs at v of the cut-off, and its derivative by v."""
    if not v.any():
        return np.ones_like(v), np.full_like(v, -4 / np.pi)
    v = np.minimum(v, 1)
    height = np.sqrt((1 - v) * (1 + v))
    return 2 / np.pi * (np.arccos(v) - v * height), -4 / np.pi * height


def _sinc(t: Floats) -> tuple[Floats, Floats]:
    """sin(pi t) / (pi t) and its derivative by t."""
    if not t.any():
        return np.ones_like(t), np.zeros_like(t)
    value = np.sinc(t)
    slope = (np.cos(np.pi * t) - value) / np.where(t < _SMALL, 1, t)
    return value, np.where(t < _SMALL, -(np.pi**2) * t / 3, slope)


def _jinc(t: Floats) -> tuple[Floats, Floats]:
    """2 J1(pi t) / (pi t) and its derivative by t."""
    if not t.any():
        return np.ones_like(t), np.zeros_like(t)
    y = np.pi * t
    nonzero = np.where(t < _SMALL, 1, y)
    value = np.where(t < _SMALL, 1 - y**2 / 8, 2 * j1(nonzero) / nonzero)
    # (J1(y) / y)' = -J2(y) / y, with J2 = 2 J1 / y - J0.
    slope = np.where(t < _SMALL, -y / 4, -2 * (value - j0(nonzero)) / nonzero)
    return value, np.pi * slope
