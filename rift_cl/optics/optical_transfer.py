"""What a camera's optics pass of each frequency, with derivatives: for all that counts coverage.

    MTF(k) = MTF_diffraction(k / cutoff) |sinc(pixel k)| |2 J1(pi t) / (pi t)|,
    t = blur k (1 - k / cutoff),

of incoherent light (Goodman, Introduction to Fourier Optics, chapter 6): a round pupil, square
pixels, taken as equal in all directions, and defocus, which for small frequencies is the transform
of the blur disc; with Stokseth's factor (J. Opt. Soc. Am. 59, 1314, 1969) it stays within 0.02 of a
real pupil's up to the cut-off, where the bare disc is up to 0.25 too low. The coverage kernels use
the same formula (``kernels/include/sampling/coverage.h``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j0, j1

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number

Floats = NDArray[np.float64]
# Arguments below which quotients by them are taken from their series.
_SMALL = 1e-4


def coherent_cutoff(diameter: float, distance: float, wavelength: float) -> float:
    """Highest frequency that passes in coherent light: A / (2 wavelength z).

    That is the paper's equation 2 on the axis, the tilt of the ray to the pupil's edge.

    Args:
        diameter: A, of the entrance pupil.
        distance: z, from the entrance pupil to the object.
        wavelength: of the light.

    Raises:
        InputError: one of them is not positive.
    """
    check_positive(diameter=diameter, distance=distance, wavelength=wavelength)
    return diameter / (2 * wavelength * distance)


def incoherent_cutoff(diameter: float, distance: float, wavelength: float) -> float:
    """Highest frequency that passes in light of scenes: A / (wavelength z), twice the coherent one.

    Arguments and errors are those of ``coherent_cutoff``.
    """
    return 2 * coherent_cutoff(diameter, distance, wavelength)


def check_positive(**values: float) -> None:
    """Refuse a value that is no positive finite number, by its name.

    Raises:
        InputError: one is not.
    """
    for name, value in values.items():
        if not one_number(value) > 0:
            raise InputError(f"{name} is {value!r}, wanted a positive number")


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
