"""Equations 1 to 5 of the RiFT paper, as they hold for a camera that looks at a scene.

Each function names its equation, says what is printed and what was changed, and why. Light of a
scene is incoherent: its intensities add, not its fields, so that what an image samples is the
autocorrelation of the pupil, with twice the band of the field. Frequencies are in cycles per unit
of length, lengths in one unit, that of the world.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.optics.optical_transfer import (
    Floats,
    check_positive,
    coherent_cutoff,
    incoherent_cutoff,
)
from rift_cl.reference.pupil import frequencies


class PassedBand(NamedTuple):
    """The frequencies of the object that reach the picture (equation 2).

    Args:
        carrier: (..., 2) frequency of the field from a point off the axis.
        coherent: highest frequency about the carrier that the field brings.
        incoherent: highest frequency about zero that the intensity brings: twice that.
    """

    carrier: Floats
    coherent: float
    incoherent: float


def chief_ray(point: ArrayLike, aperture: ArrayLike) -> Floats:
    """Equation 1: the unit vector from a point of the object to the aperture.

    As printed. It is also the direction n of the slice n . k = 0 that a picture takes of the
    spectrum near that point; in perspective, n differs from point to point.

    Args:
        point: (..., 3) x_0, y_0, z_0.
        aperture: (..., 3) x_a, y_a, z_a, the centre of the entrance pupil.

    Returns:
        (..., 3) unit vectors.

    Raises:
        ShapeError: one is not (..., 3) real numbers, or they do not broadcast.
        InputError: a point lies in the aperture.
    """
    way = _way(point, aperture)
    length = np.linalg.norm(way, axis=-1, keepdims=True)
    if not (length > 0).all():
        raise InputError("chief_ray: a point lies in the aperture, wanted some distance")
    return np.asarray(way / length)


def passed_band(
    point: ArrayLike, aperture: ArrayLike, diameter: float, wavelength: float
) -> PassedBand:
    """Equation 2: the frequencies of the object that pass the aperture.

    Printed is xi = (x_a + A/2 - x_0) / (wavelength (z_a - z_0)): the paraxial tilt of the ray to
    the pupil's edge. Its two parts are kept apart here. (x_a - x_0) / (wavelength z) is the
    carrier of a field that comes in at an angle; it does not move the spectrum of an intensity, it
    only turns the slice (equation 1). A / (2 wavelength z) = NA / wavelength is the cut-off of
    coherent light; that of a scene is twice as far, A / (wavelength z), about zero.

    Args:
        point: (..., 3) x_0, y_0, z_0; the axis of the camera is along z.
        aperture: (3,) the centre of the entrance pupil.
        diameter: A, of the entrance pupil.
        wavelength: of the light.

    Raises:
        ShapeError: a point is no (..., 3) real numbers.
        InputError: points have different depths or none, or a length is not positive.
    """
    way = _way(point, aperture)
    depths = np.abs(way[..., 2])
    if depths.size == 0 or not 0 < depths.max() <= depths.min() * (1 + 1e-9):
        raise InputError("passed_band: points are wanted at one depth, away from the aperture")
    z = float(depths.max())
    cutoffs = [cut(diameter, z, wavelength) for cut in (coherent_cutoff, incoherent_cutoff)]
    carrier = way[..., :2] / (wavelength * z)
    return PassedBand(np.asarray(carrier), *cutoffs)


def image_cutoff(f_number: float, magnification: float, wavelength: float, P: float = 1.0) -> float:
    """Equation 3: the cut-off in the image, 1 / (wavelength N_w), N_w = N (1 + |m| / P).

    Printed is xi' = ||x_a - x_0| - x_i| / (wavelength f/# m A). With f/# = f / A its denominator
    is wavelength f m, but the image lies at z' = f (1 + |m|), not at f m: as printed it
    contradicts equations 2 and 4, unless f/# is read as z / A, the working number on the object's
    side. The image distance is put right here; the nested absolute values, which lose the sign,
    and x_i, which only moves the image, are dropped. Incoherent; half of it is the coherent one.

    Args:
        f_number: N = f / A.
        magnification: m, any sign; 0 for an object at infinity.
        wavelength: of the light.
        P: diameter of the exit pupil over that of the entrance pupil.

    Raises:
        InputError: a number is not positive, or m is none.
    """
    check_positive(f_number=f_number, wavelength=wavelength, P=P)
    m = one_number(magnification)
    if not math.isfinite(m):
        raise InputError(f"magnification is {magnification!r}, wanted a finite number")
    return 1 / (wavelength * f_number * (1 + abs(m) / P))


def to_image_frequency(frequency: ArrayLike, magnification: float) -> Floats:
    """Equation 4, m xi' = xi, solved for xi': as printed, with the sign of m kept.

    Args:
        frequency: in the object, any shape.
        magnification: m, negative where the image is upside down.

    Raises:
        InputError: m is 0 or no number, or a frequency is none.
    """
    return np.asarray(frequencies("to_image_frequency", frequency) / _magnification(magnification))


def to_object_frequency(frequency: ArrayLike, magnification: float) -> Floats:
    """Equation 4, m xi' = xi: as printed; arguments as for ``to_image_frequency``."""
    return np.asarray(frequencies("to_object_frequency", frequency) * _magnification(magnification))


def axial_frequency(
    xi: ArrayLike, eta: ArrayLike, wavelength: float, medium: float = 1.0
) -> Floats:
    """Equation 5: zeta of a field, from 1 / wavelength^2 = xi^2 + eta^2 + zeta^2.

    As printed, with the index of the medium. It binds the *field* of one colour in the space of
    the object (Ewald's sphere), not the intensity that a picture samples: for that, take
    ``axial_band``. The paper concludes that a smaller aperture brings more information along the
    axis since zeta grows; but its *range* on the cap shrinks, and with it the axial band. The
    depth of field grows because of that: the slab of the spectrum thins to a slice.

    Args:
        xi: frequency across, any shape.
        eta: the other one, any shape that fits.
        wavelength: in vacuum.
        medium: index of refraction.

    Returns:
        zeta >= 0; NaN where the wave is evanescent and does not reach a camera.

    Raises:
        InputError: the wavelength or the index is not positive, or a frequency is no number.
    """
    check_positive(wavelength=wavelength, medium=medium)
    across = frequencies("axial_frequency: xi", xi) ** 2
    across = across + frequencies("axial_frequency: eta", eta) ** 2
    left = (medium / wavelength) ** 2 - across
    return np.asarray(np.where(left >= 0, np.sqrt(np.maximum(left, 0)), np.nan))


def axial_band(
    rho: ArrayLike, numerical_aperture: float, wavelength: float, medium: float = 1.0
) -> Floats:
    """Half-extent of the incoherent 3D OTF along the axis (what equation 5 leaves to a picture).

    The 3D OTF is the autocorrelation of the cap that the pupil cuts from Ewald's sphere
    (B. R. Frieden, J. Opt. Soc. Am. 57, 56, 1967). Two points of the cap that lie rho apart across
    differ along the axis by at most sqrt(K^2 - (a - rho)^2) - sqrt(K^2 - a^2), with
    K = medium / wavelength and a = NA / wavelength: 0 at rho = 0 (the missing cone), greatest at
    rho = a, where it is (medium - sqrt(medium^2 - NA^2)) / wavelength, and 0 at the cut-off 2 a.

    Args:
        rho: frequency across, any shape.
        numerical_aperture: NA = medium x sin theta.
        wavelength: in vacuum.
        medium: index of refraction.

    Returns:
        The half-extent, 0 beyond the cut-off.

    Raises:
        InputError: a number is not positive, or NA is not below the index.
    """
    check_positive(numerical_aperture=numerical_aperture, wavelength=wavelength, medium=medium)
    if numerical_aperture >= medium:
        raise InputError(
            f"numerical_aperture is {numerical_aperture:g}, wanted one below the index {medium:g}"
        )
    a, K = numerical_aperture / wavelength, medium / wavelength
    inner = a - np.minimum(np.abs(frequencies("axial_band", rho)), 2 * a)
    # A difference of roots would lose the digits of a narrow cone.
    return np.asarray((a**2 - inner**2) / (np.sqrt(K**2 - inner**2) + math.sqrt(K**2 - a**2)))


def missing_cone(numerical_aperture: float, medium: float = 1.0) -> float:
    """Angle in radians about the axis in which the 3D OTF is zero: pi/2 - asin(NA / medium).

    Raises:
        InputError: a number is not positive, or NA is not below the index.
    """
    check_positive(numerical_aperture=numerical_aperture, medium=medium)
    if numerical_aperture >= medium:
        raise InputError(
            f"numerical_aperture is {numerical_aperture:g}, wanted one below the index {medium:g}"
        )
    return math.acos(numerical_aperture / medium)


def _magnification(value: float) -> float:
    m = one_number(value)
    if not (math.isfinite(m) and m != 0):
        raise InputError(f"magnification is {value!r}, wanted a number other than 0")
    return m


def _way(point: ArrayLike, aperture: ArrayLike) -> Floats:
    start, end = _points("point", point), _points("aperture", aperture)
    try:
        return np.asarray(end - start)
    except ValueError as error:
        raise ShapeError(
            f"point has shape {start.shape} and aperture {end.shape}, wanted shapes that fit"
        ) from error


def _points(name: str, values: ArrayLike) -> Floats:
    points = real_numbers(values)
    if points is None or points.ndim == 0 or points.shape[-1] != 3:
        raise ShapeError(f"{name} is wanted as (..., 3) real numbers")
    if not np.isfinite(points).all():
        raise NonFiniteError(f"{name} holds NaN or infinity")
    return points
