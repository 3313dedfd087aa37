"""The exact Fourier transform of ellipsoids: what magnetic resonance measures of them.

A unit ball has the transform ``(4 pi / 3) * 3 j1(q) / q`` at ``q = 2 pi |k|``, and a unit disc
``pi * 2 J1(q) / q`` (Bracewell, The Fourier Transform and Its Applications, chapter on Hankel
transforms; Koay, Sarlls and Oezarslan, Magn. Reson. Med. 58, 430, 2007, for the ellipsoid).
Stretching the ball by its semi-axes stretches k instead and multiplies by their product, and a
shift turns the phase.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import ShapeError
from rift_cl.phantom.ellipsoid import Ellipsoid, Reals

# Below this the quotients are 1 to rounding; it keeps zero away from the denominators.
_SMALL = 1e-5


def spectrum(ellipsoids: Sequence[Ellipsoid], frequencies: ArrayLike) -> NDArray[np.complex128]:
    """The Fourier transform, integral of f(x) exp(-2 pi i k x) dx, of a sum of ellipsoids.

    Args:
        ellipsoids: the parts; in two dimensions their equatorial sections.
        frequencies: (..., 3) of (kz, ky, kx), or (..., 2) of (ky, kx) for the plane, in cycles
            per unit of length.

    Returns:
        (...) complex values: density times volume, or times area in the plane.

    Raises:
        ShapeError: the last axis has neither two nor three entries.
    """
    k = np.asarray(frequencies, dtype=np.float64)
    if k.ndim < 1 or k.shape[-1] not in (2, 3):
        raise ShapeError(f"spectrum: frequencies has shape {k.shape}, wanted (..., 2) or (..., 3)")
    total = np.zeros(k.shape[:-1], dtype=np.complex128)
    for part in ellipsoids:
        q = 2 * np.pi * _stretched(part, k)
        phase = -2 * np.pi * (k @ np.array(part.center[-k.shape[-1] :]))
        total += (
            part.value * _measure(part, k.shape[-1]) * _profile(q, k.shape[-1]) * np.exp(1j * phase)
        )
    return total


def _stretched(part: Ellipsoid, k: Reals) -> Reals:
    """|k| in units in which the ellipsoid is the unit ball."""
    cos, sin = math.cos(part.angle), math.sin(part.angle)
    c, b, a = part.semi_axes
    along, across = cos * k[..., -1] + sin * k[..., -2], cos * k[..., -2] - sin * k[..., -1]
    square = (a * along) ** 2 + (b * across) ** 2
    if k.shape[-1] == 3:
        square = square + (c * k[..., 0]) ** 2
    length: Reals = np.sqrt(square)
    return length


def _measure(part: Ellipsoid, dimensions: int) -> float:
    c, b, a = part.semi_axes
    return 4 / 3 * math.pi * a * b * c if dimensions == 3 else math.pi * a * b


def _profile(q: Reals, dimensions: int) -> Reals:
    """The unit ball's transform, or the unit disc's, over its value at zero."""
    from scipy.special import j1, spherical_jn

    far = np.maximum(q, _SMALL)
    if dimensions == 2:
        return np.where(q < _SMALL, 1.0, 2 * j1(far) / far)
    return np.where(q < _SMALL, 1.0, 3 * spherical_jn(1, far) / far)
