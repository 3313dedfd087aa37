"""How densely slices lie in the Fourier domain: what is measured, and the laws that it follows.

A slice is a line through zero in the plane and a plane through zero in space. Bounded sampling
over-represents low frequencies (Figure 4 of the RiFT paper): slices all meet at zero, so that their
density falls as 1 / |k|, and what falls so is levelled by a ramp. K views have the density

- K / (pi |k|) over angles that fill half a turn, in the plane (slices per length across them);
- K / (2 |k|) along directions that fill the sphere, in space;
- K / (pi sqrt(kx^2 + ky^2)) along a ring about z: too many are only those near the axis, a line,
  so that the ramp is that of each detector row, |k_r|, and not |k|.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.device import Device
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.sampling.coverage.device import coverage
from rift_cl.sampling.coverage.work import Views
from rift_cl.sampling.targets.prior import directions_for
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]


def window_width(diameter: float) -> float:
    """The integral of rho^2 across a slice: what one slice's coverage adds up to.

    With rho(u) = exp(-(u / SD)^2) and SD = 0.5 / diameter it is SD sqrt(pi / 2).
    """
    return 0.5 / diameter * math.sqrt(math.pi / 2)


def density(
    views: Views,
    target: Target,
    k: ArrayLike | None = None,
    *,
    weights: ArrayLike | None = None,
    device: Device | None = None,
) -> NDArray[np.float32]:
    """Slices per length across them, (P, K), at frequencies (K, 3): coverage over its window.

    Arguments and errors are those of ``rift_cl.sampling.coverage.device``.
    """
    found = coverage(views, target, k, weights=weights, device=device)
    return found / np.float32(window_width(target.diameter))


def sphere_density(views: float, k: ArrayLike) -> Floats:
    """K / (2 |k|) at frequencies (..., 3): directions that fill the sphere; inf at zero."""
    return _law(views, 2 * np.linalg.norm(_vectors(k), axis=-1))


def ring_density(views: float, k: ArrayLike) -> Floats:
    """K / (pi sqrt(kx^2 + ky^2)) at frequencies (..., 3): a ring about z, or angles of a plane.

    It is infinite along the axis.
    """
    return _law(views, np.pi * np.linalg.norm(_vectors(k)[..., :2], axis=-1))


def mean_density(
    views: Views,
    target: Target,
    radii: ArrayLike,
    *,
    samples: int = 2048,
    weights: ArrayLike | None = None,
    device: Device | None = None,
) -> Floats:
    """The mean density over spheres of frequencies, or over circles for a flat target.

    Args:
        views: as for ``coverage``.
        target: its first point counts.
        radii: (n,) of the spheres, in cycles per unit of length.
        samples: frequencies on each.
        weights: (V,) relative photons of cameras.
        device: where to compute.

    Returns:
        (n,).

    Raises:
        InputError: a radius is not positive and finite, or samples no number of them; and what
            ``coverage`` raises.
    """
    lengths = real_numbers(radii)
    if lengths is None or lengths.ndim != 1 or not len(lengths):
        raise InputError(f"radii is {radii!r}, wanted positive frequencies (n,)")
    if not ((lengths > 0) & np.isfinite(lengths)).all():
        raise InputError(f"radii is {radii!r}, wanted positive finite frequencies")
    if not one_number(samples) >= 1 or samples != int(samples):
        raise InputError(f"samples is {samples!r}, wanted a whole number of frequencies, 1 or more")
    units = half_circle(samples) if target.is_flat else half_sphere(samples)
    k = (lengths[:, None, None] * units).reshape(-1, 3)
    found = density(views, target, k, weights=weights, device=device)[0]
    return np.asarray(found.reshape(len(lengths), samples).mean(1, dtype=np.float64))


def power_slope(k: ArrayLike, values: ArrayLike) -> float:
    """The exponent of a power law through points: the slope of a line in the log-log plane.

    Raises:
        ShapeError: there are not two points or more, or unlike numbers of k and values.
        InputError: one of them is not positive.
    """
    x, y = real_numbers(k), real_numbers(values)
    if x is None or y is None or x.ndim != 1 or x.shape != y.shape or len(x) < 2:
        raise ShapeError("power_slope: wanted as many frequencies as values, two or more")
    if not (min(x.min(), y.min()) > 0):
        raise InputError("power_slope: wanted positive frequencies and values")
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def half_sphere(count: int) -> Floats:
    """Unit vectors that fill the half-sphere z > 0 evenly, from the pole down, (count, 3)."""
    return directions_for(3, count)


def half_circle(count: int) -> Floats:
    """Unit vectors evenly along the half-circle y > 0, z = 0, (count, 3)."""
    return directions_for(2, count)


def _law(views: Any, across: Any) -> Floats:
    if not one_number(views) > 0:
        raise InputError(f"views is {views!r}, wanted a positive number")
    with np.errstate(divide="ignore"):
        return np.asarray(one_number(views) / across)


def _vectors(k: ArrayLike) -> Floats:
    vectors = real_numbers(k)
    if vectors is None or vectors.ndim < 1 or vectors.shape[-1] != 3:
        raise ShapeError(f"k has shape {np.shape(k)}, wanted (..., 3)")
    if not one_number(np.abs(vectors).sum()) > 0:
        raise InputError("k: wanted finite frequencies that are not all zero")
    return vectors
