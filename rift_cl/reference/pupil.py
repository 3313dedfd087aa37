"""The exact OTF of a pupil: its autocorrelation. The oracle of the simple products.

In light of a scene, the OTF is the autocorrelation of the pupil over the pupil's area (Goodman,
"Introduction to Fourier Optics", 6.3); out of focus, the pupil carries a quadratic phase. It is 1
at frequency 0 and nowhere larger, whatever the pupil: an aperture may flatten the band, but never
passes high frequencies better than low ones. Only a difference of two exposures can.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number, positive_or_infinite, real_numbers
from rift_cl.optics.optical_transfer import Floats, check_positive, incoherent_cutoff

# A pupil of this many samples across is an autocorrelation of 1 GiB.
_MOST_SAMPLES = 4096
# Beyond, a camera sees only a blur; bounds the quadrature.
_MOST_WAVES = 1e4


def diffraction_mtf(v: ArrayLike) -> Floats:
    """MTF of a round pupil in focus at a share of the incoherent cut-off.

    (2 / pi) (acos v - v sqrt(1 - v^2)), 0 beyond the cut-off: the overlap of two discs.

    Args:
        v: frequencies over the cut-off, any shape; the sign does not count.
    """
    share = np.minimum(np.abs(frequencies("diffraction_mtf", v)), 1)
    return np.asarray(2 / np.pi * (np.arccos(share) - share * np.sqrt(1 - share**2)))


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


def defocus_waves(diameter: float, depth: ArrayLike, focus: float, wavelength: float) -> Floats:
    """Defocus W20 in wavelengths at the edge of the pupil: A^2 / (8 wavelength) (1/z - 1/focus).

    Args:
        diameter: A, of the entrance pupil.
        depth: z of the object from the entrance pupil, any shape.
        focus: distance of the plane in focus; may be infinite.
        wavelength: of the light.

    Raises:
        InputError: a length is not positive.
    """
    check_positive(diameter=diameter, wavelength=wavelength)
    z, distance = frequencies("defocus_waves: depth", depth), positive_or_infinite(focus)
    if not (z > 0).all() or not distance > 0:
        raise InputError(f"defocus_waves: depths and focus ({focus!r}) are wanted as positive")
    return np.asarray(diameter**2 / (8 * wavelength) * (1 / z - 1 / distance))


def defocused_otf(v: ArrayLike, waves: float) -> Floats:
    """Exact incoherent OTF of a round pupil out of focus.

    The autocorrelation of a disc with a quadratic phase (H. H. Hopkins, Proc. R. Soc. A 231, 91,
    1955), with x + v = sin t so that the integrand is smooth:
    (4 / pi) int cos(8 pi W v (sin t - v)) cos^2 t dt from asin v to pi / 2. Real, and negative
    where contrast is reversed.

    Args:
        v: frequencies over the incoherent cut-off, any shape.
        waves: W, defocus at the edge of the pupil in wavelengths.

    Raises:
        InputError: a frequency is no number, or the defocus is beyond 10,000 wavelengths.
    """
    amount = one_number(waves)
    if not abs(amount) <= _MOST_WAVES:
        raise InputError(f"defocused_otf: waves is {waves!r}, wanted at most {_MOST_WAVES:g}")
    share = np.minimum(np.abs(frequencies("defocused_otf", v)), 1)
    # The phase turns by 4 W v (1 - v) <= W circles; 32 nodes are enough for four of them.
    turns = 4 * abs(amount) * float(np.max(share * (1 - share), initial=0))
    nodes, weights = np.polynomial.legendre.leggauss(32)
    pieces = 1 + int(turns / 4)
    low = np.arcsin(share)
    half = (np.pi / 2 - low) / (2 * pieces)
    total = np.zeros(share.shape)
    for piece in range(pieces):
        for node, weight in zip(nodes, weights, strict=True):
            t = low + half * (2 * piece + 1 + node)
            phase = 8 * np.pi * amount * share * (np.sin(t) - share)
            total += weight * np.cos(phase) * np.cos(t) ** 2
    return np.asarray(4 / np.pi * half * total)


def annular_mtf(v: ArrayLike, obstruction: float) -> Floats:
    """MTF of a ring-shaped pupil in focus: overlaps of discs, summed (E. L. O'Neill, 1956).

    Args:
        v: frequencies over the cut-off of the full pupil, any shape.
        obstruction: inner radius over outer, from 0 to below 1.

    Raises:
        InputError: the obstruction is none.
    """
    inner = one_number(obstruction)
    if not 0 <= inner < 1:
        raise InputError(f"annular_mtf: obstruction is {obstruction!r}, wanted 0 to below 1")
    share = np.abs(frequencies("annular_mtf", v))
    if inner == 0:
        return diffraction_mtf(share)
    whole = diffraction_mtf(share) + inner**2 * diffraction_mtf(share / inner)
    return np.asarray((whole - 2 * _disc_overlap(2 * share, inner)) / (1 - inner**2))


def _disc_overlap(apart: Floats, inner: float) -> Floats:
    """Area that discs of radius 1 and ``inner`` share, over pi, with centres so far apart."""
    d = np.clip(apart, 1 - inner, 1 + inner)
    one = np.arccos(np.clip((d**2 + 1 - inner**2) / (2 * d), -1, 1))
    other = np.arccos(np.clip((d**2 + inner**2 - 1) / (2 * d * inner), -1, 1))
    square = (1 + inner - d) * (d + inner - 1) * (d + 1 - inner) * (d + 1 + inner)
    area = one + inner**2 * other - np.sqrt(np.maximum(square, 0)) / 2
    return np.asarray(area / np.pi)


def numerical_otf(pupil: NDArray[np.complex128] | Floats) -> NDArray[np.complex128]:
    """OTF of any pupil: its autocorrelation by FFT, without wrapping round.

    Args:
        pupil: (n, n) amplitude with its phase, sampled over a square.

    Returns:
        (2n, 2n) OTF, 1 at [0, 0], frequencies in FFT order; n samples from there is the square's
        whole side, at which nothing overlaps any more.

    Raises:
        ShapeError: the pupil is not square, or too large.
        InputError: it is dark, or not finite.
    """
    field = np.asarray(pupil)
    if field.ndim != 2 or not 0 < field.shape[0] == field.shape[1] <= _MOST_SAMPLES:
        raise ShapeError(
            f"numerical_otf: pupil has shape {field.shape}, wanted (n, n) with n up to "
            f"{_MOST_SAMPLES}"
        )
    if field.dtype.kind not in "biufc" or not np.isfinite(field).all() or not field.any():
        raise InputError("numerical_otf: pupil is wanted as finite amplitudes, not all zero")
    spread = np.fft.fft2(field, [2 * side for side in field.shape])
    overlap = np.fft.ifft2(np.abs(spread) ** 2)
    return np.asarray(overlap / overlap[0, 0].real, np.complex128)


def worst_depth_cutoff(
    diameter: float, distance: float, depth: float, wavelength: float, level: float = 0.1
) -> float:
    """Frequency at which the MTF at a target's worst depth first falls to a level.

    By the exact OTF, in focus at ``distance`` and with the defocus that both ends of the target
    have to first order in depth / distance: A^2 depth / (16 wavelength z^2).

    Args:
        diameter: A, of the entrance pupil.
        distance: z of the target's middle.
        depth: of the target.
        wavelength: of the light.
        level: of the MTF, between 0 and 1.

    Returns:
        The frequency, in cycles per unit of length of the object.

    Raises:
        InputError: an argument is out of its range.
    """
    check_positive(diameter=diameter, distance=distance, depth=depth, wavelength=wavelength)
    if not 0 < one_number(level) < 1:
        raise InputError(f"level is {level!r}, wanted a number between 0 and 1")
    waves = diameter**2 * depth / (16 * wavelength * distance**2)
    # The OTF has its first zero before 1 / waves, at 0.15 / waves where there are many.
    v = np.linspace(0, min(1, 1 / waves), 2001)
    otf = defocused_otf(v, waves)
    first = int(np.argmax(otf < level))
    # Between the two samples, along the straight line through them.
    step = (otf[first - 1] - level) / (otf[first - 1] - otf[first])
    found = v[first - 1] + step * (v[first] - v[first - 1])
    return float(found) * incoherent_cutoff(diameter, distance, wavelength)


def frequencies(what: str, values: ArrayLike) -> Floats:
    """Frequencies as float64.

    Raises:
        InputError: they are no finite real numbers.
    """
    numbers = real_numbers(values)
    if numbers is None or not np.isfinite(numbers).all():
        raise InputError(f"{what}: frequencies are wanted as finite real numbers")
    return numbers


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
