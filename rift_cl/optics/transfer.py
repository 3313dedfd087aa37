"""Which frequencies a lens and a sensor pass, and how much of each: cut-offs and MTFs.

These are the definitions; the kernels of coverage use the same formulas. Frequencies are in cycles
per unit of length, of the object unless said. J. W. Goodman, "Introduction to Fourier Optics",
chapter 6; the product of the MTFs is a model whose error ``pupil.defocused_otf`` tells.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number, positive_or_infinite, real_numbers

Floats = NDArray[np.float64]


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


def diffraction_mtf(v: ArrayLike) -> Floats:
    """MTF of a round pupil in focus at a share of the incoherent cut-off.

    (2 / pi) (acos v - v sqrt(1 - v^2)), 0 beyond the cut-off: the overlap of two discs.

    Args:
        v: frequencies over the cut-off, any shape; the sign does not count.
    """
    share = np.minimum(np.abs(frequencies("diffraction_mtf", v)), 1)
    return np.asarray(2 / np.pi * (np.arccos(share) - share * np.sqrt(1 - share**2)))


def pixel_mtf(k: ArrayLike, pixel: float) -> Floats:
    """MTF of a square pixel whose whole area sees, along its sides: |sin(pi a k) / (pi a k)|.

    Args:
        k: frequencies, any shape.
        pixel: a, its side where the frequencies are measured; 0 leaves it out.
    """
    return np.asarray(np.abs(np.sinc(frequencies("pixel_mtf", k) * _length("pixel", pixel))))


def defocus_mtf(k: ArrayLike, blur: float, cutoff: float = np.inf) -> Floats:
    """MTF of defocus alone: |2 J1(x) / x| with x = pi b k (1 - k / cutoff).

    Without a cut-off that is the geometric blur disc, right for large defocus and low frequencies.
    With it, it is P. A. Stokseth's approximation (J. Opt. Soc. Am. 59, 1314, 1969): times the
    diffraction MTF it is within 0.017 of the exact one for any defocus, where the blur disc is 0.25
    below it (at 0.35 wavelengths). ``pupil.defocused_otf`` is exact.

    Args:
        k: frequencies, any shape.
        blur: b, diameter of the disc where the frequencies are measured; 0 leaves it out.
        cutoff: the incoherent cut-off.

    Raises:
        InputError: a frequency is no number, blur is negative or cutoff not positive.
    """
    from scipy.special import j1

    wide = np.abs(frequencies("defocus_mtf", k))
    left = np.maximum(1 - wide / _cutoff(cutoff), 0)
    x = np.pi * _length("blur", blur) * wide * left
    safe = np.where(x > 1e-6, x, 1)
    return np.asarray(np.where(x > 1e-6, np.abs(2 * j1(safe) / safe), 1))


def system_mtf(
    k: ArrayLike, *, cutoff: float = np.inf, pixel: float = 0.0, blur: float = 0.0
) -> Floats:
    """MTF of lens and sensor: diffraction x pixel x defocus, as coverage counts it.

    Diffraction and defocus come from one pupil and do not really multiply; with the cut-off in
    ``defocus_mtf`` their product is within 0.017 of the exact one for any defocus.

    Args:
        k: frequencies, any shape.
        cutoff: incoherent, infinite without diffraction.
        pixel: side of the pixel, seen in the object.
        blur: diameter of the blur disc, seen in the object.

    Raises:
        InputError: a frequency is no number, or a length is negative.
    """
    values = frequencies("system_mtf", k)
    lens = diffraction_mtf(values / _cutoff(cutoff)) * defocus_mtf(values, blur, cutoff)
    return lens * pixel_mtf(values, pixel)


def polychromatic_mtf(
    k: ArrayLike,
    diameter: float,
    distance: float,
    wavelengths: Sequence[float],
    weights: Sequence[float] | None = None,
) -> Floats:
    """Diffraction MTF in light of several colours: the mean of theirs, weighted by their power.

    The paper integrates over wavelength after equation 4. Colours do not interfere, so that
    intensities add, and with them the OTFs; each has a cut-off of its own.

    Args:
        k: frequencies in the object, any shape.
        diameter: of the entrance pupil.
        distance: from the entrance pupil to the object.
        wavelengths: of the light.
        weights: relative power of each; all the same when None.

    Raises:
        InputError: a length is not positive, or the weights are none.
        ShapeError: there is no wavelength, or another number of weights.
    """
    powers = np.ones(len(wavelengths)) if weights is None else real_numbers(weights)
    if powers is None or powers.shape != (len(wavelengths),) or len(powers) == 0:
        raise ShapeError(
            f"polychromatic_mtf: weights are {weights!r}, wanted one for each of "
            f"{len(wavelengths)} wavelengths, of which there is at least one"
        )
    if not (np.isfinite(powers).all() and powers.min() >= 0 and powers.sum() > 0):
        raise InputError(
            f"polychromatic_mtf: weights are {weights!r}, wanted finite ones, not negative, not "
            "all zero"
        )
    values = frequencies("polychromatic_mtf", k)
    cutoffs = [incoherent_cutoff(diameter, distance, w) for w in wavelengths]
    each = np.stack([diffraction_mtf(values / cutoff) for cutoff in cutoffs])
    return np.asarray(np.tensordot(powers / powers.sum(), each, 1))


def frequencies(what: str, values: ArrayLike) -> Floats:
    """Frequencies as float64.

    Raises:
        InputError: they are no finite real numbers.
    """
    numbers = real_numbers(values)
    if numbers is None or not np.isfinite(numbers).all():
        raise InputError(f"{what}: frequencies are wanted as finite real numbers")
    return numbers


def check_positive(**values: float) -> None:
    """Refuse a value that is no positive finite number, by its name.

    Raises:
        InputError: one is not.
    """
    for name, value in values.items():
        if not one_number(value) > 0:
            raise InputError(f"{name} is {value!r}, wanted a positive number")


def _cutoff(value: float) -> float:
    number = positive_or_infinite(value)
    if not number > 0:
        raise InputError(f"cutoff is {value!r}, wanted a positive frequency or infinity")
    return number


def _length(name: str, value: float) -> float:
    number = one_number(value)
    if not number >= 0:
        raise InputError(f"{name} is {value!r}, wanted 0 or a length")
    return number
