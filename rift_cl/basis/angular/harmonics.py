"""Real spherical harmonics to degree 4, with the signs of 3D Gaussian Splatting (Kerbl et al.).

Function l^2 + l + m is Q_lm(z) Re (x + i y)^m for m >= 0 and l^2 + l - m is Q_lm(z) Im (x + i y)^m,
where Q_lm is the m-th derivative of Legendre's polynomial with the norm and Condon and
Shortley's sign.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import factorial, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis.angular.frame import unit_directions
from rift_cl.basis.angular.protocol import AngularFunctions, Slopes, last_axis
from rift_cl.basis.numbers import whole
from rift_cl.errors import InputError

Floats = NDArray[np.float64]
_HIGHEST = 4


class SphericalHarmonics(AngularFunctions):
    """All harmonics to a degree: (degree + 1)^2 functions and no geometry.

    Args:
        degree: 0 to 4.

    Raises:
        InputError: the degree is none of these.
    """

    name = "sh"
    n_geometry = 0

    def __init__(self, degree: int) -> None:
        self.degree = whole(degree, "SphericalHarmonics: degree", 0, _HIGHEST)
        self.n_linear = (self.degree + 1) ** 2

    @classmethod
    def of_count(cls, count: int) -> SphericalHarmonics:
        """The harmonics of which there are this many.

        Raises:
            InputError: no degree has this number.
        """
        counts = [(degree + 1) ** 2 for degree in range(_HIGHEST + 1)]
        if count not in counts:
            raise InputError(
                f"SphericalHarmonics: there are {count!r} coefficients, wanted 1, 4, 9, 16 or 25"
            )
        return cls(counts.index(count))

    def slopes(self, geometry: ArrayLike | None, directions: ArrayLike) -> Slopes:
        """All functions with their derivatives; the geometry is not looked at."""
        given = last_axis(directions, 3, "SphericalHarmonics: directions")
        with np.errstate(all="ignore"):
            units = unit_directions(given)
            x, y, z = np.moveaxis(units.vectors, -1, 0)
            values = np.empty((*z.shape, self.n_linear))
            by_unit = np.empty((*z.shape, self.n_linear, 3))
            for order in range(self.degree + 1):
                for m in range(-order, order + 1):
                    at = order * order + order + m
                    values[..., at], by_unit[..., at, :] = _harmonic(order, m, x, y, z)
            slopes = np.einsum("...ki,...ij->...kj", by_unit, units.slopes)
        return Slopes(values, np.empty((*values.shape, 0)), slopes)

    def functions(self, geometry: ArrayLike | None, directions: ArrayLike) -> Floats:
        """All functions alone, many times sooner than with their derivatives; see ``slopes``."""
        given = last_axis(directions, 3, "SphericalHarmonics: directions")
        with np.errstate(all="ignore"):
            x, y, z = np.moveaxis(unit_directions(given).vectors, -1, 0)
            values = np.empty((self.n_linear, *z.shape))
            power = np.ones(z.shape, complex)
            for n in range(self.degree + 1):
                for order in range(n, self.degree + 1):
                    height, at = np.polynomial.polynomial.polyval(z, _height(order, n)), order**2
                    values[at + order + n] = height * power.real
                    if n:
                        values[at + order - n] = height * power.imag
                power = power * (x + 1j * y)
        return np.ascontiguousarray(np.moveaxis(values, 0, -1))

    def start_geometry(self, axes: ArrayLike) -> Floats:
        """Harmonics have no geometry: (..., 0)."""
        return np.empty((*last_axis(axes, 3, "SphericalHarmonics: axes").shape[:-1], 0))


def _harmonic(order: int, m: int, x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats]:
    """One function, and its derivatives (..., 3) off the sphere as well as along it."""
    n = abs(m)
    height: Callable[[Floats], Any] = np.polynomial.Legendre.basis(order).deriv(n)
    steep: Callable[[Floats], Any] = np.polynomial.Legendre.basis(order).deriv(n + 1)
    q, slope = _norm(order, n) * height(z), _norm(order, n) * steep(z)
    power, below = (x + 1j * y) ** n, n * (x + 1j * y) ** max(n - 1, 0)
    turn, by_x, by_y = (
        (power.real, below.real, -below.imag) if m >= 0 else (power.imag, below.imag, below.real)
    )
    return q * turn, np.stack([q * by_x, q * by_y, slope * turn], -1)


def _norm(order: int, n: int) -> float:
    """The factor of Q_ln, with its sign."""
    norm = (2 * order + 1) / (4 * pi) * factorial(order - n) / factorial(order + n)
    return float((-1) ** n * sqrt(norm * (2 if n else 1)))


@cache
def _height(order: int, n: int) -> Floats:
    """Q_ln as a polynomial: coefficients of 1, z, z^2 and so on."""
    plain = np.polynomial.Legendre.basis(order).deriv(n).convert(kind=np.polynomial.Polynomial)
    return _norm(order, n) * np.asarray(plain.coef, float)
