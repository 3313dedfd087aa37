"""From a lens to a pinhole in three steps, each with what it leaves out. Figure 9 of the paper.

a) a prescription -> b) principal planes and pupils -> c) a thin lens with a stop -> d) a pinhole.
The paper takes the steps one after the other; here each is charged with its error, measured on the
lens that is given, in lengths and pixels that a person can judge. All lengths are in millimetres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rift_cl.errors import InputError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.optics.depth_of_field import diffraction_depth, sharp_range
from rift_cl.optics.gaussian_lens import GaussianLens, gaussian_lens
from rift_cl.optics.lens_prescription import LensPrescription
from rift_cl.optics.optical_transfer import check_positive, incoherent_cutoff
from rift_cl.optics.real_rays import chief_ray, pupil_rays, trace

# Rings of the pupil for the spot on the axis, each of the same area.
_RINGS = 24


@dataclass(frozen=True)
class Loss:
    """One thing that a step leaves out.

    Args:
        what: in words.
        value: how much.
        unit: of the value.
    """

    what: str
    value: float
    unit: str


@dataclass(frozen=True)
class Step:
    """One step of the reduction.

    Args:
        name: from what to what.
        losses: what it leaves out.
    """

    name: str
    losses: tuple[Loss, ...]


@dataclass(frozen=True)
class Reduction:
    """A lens with a sensor at all four stages.

    Args:
        prescription: stage a.
        gaussian: stage b.
        camera: stage c, a thin lens with a stop; without its aperture, stage d.
        distance: of the plane in focus, from the entrance pupil.
        steps: a to b, b to c, c to d.
    """

    prescription: LensPrescription
    gaussian: GaussianLens
    camera: CameraType
    distance: float
    steps: tuple[Step, Step, Step]


def reduce_camera(
    prescription: LensPrescription,
    distance: float,
    pixel: float,
    size: tuple[int, int],
    depth: float | None = None,
) -> Reduction:
    """Reduce a lens with a sensor to a pinhole and say what every step leaves out.

    Args:
        prescription: the lens.
        distance: of the plane in focus from the entrance pupil, millimetres.
        pixel: pitch of the sensor, millimetres.
        size: (height, width) of the sensor in pixels; its corner is the edge of the field.
        depth: of the target about the plane in focus; a tenth of the distance when None.

    Raises:
        InputError: the lens forms no real image of that plane, the target reaches to the lens, or
            a real ray does not come through; the error names the surface.
        ShapeError: the sensor has no pixels.
    """
    check_positive(distance=distance, pixel=pixel)
    depth = distance / 10 if depth is None else depth
    check_positive(depth=depth)
    if depth >= 2 * distance:
        raise InputError(f"depth is {depth:g} mm, the target reaches to the lens")
    gaussian = gaussian_lens(prescription)
    camera = gaussian.camera_type(pixel, size)
    steps = (
        Step("lens to principal planes", _paraxial(prescription, gaussian, camera, distance)),
        Step("principal planes to a stop", _thin(gaussian, camera, distance)),
        Step("stop to pinhole", _pinhole(gaussian, camera, distance, depth)),
    )
    return Reduction(prescription, gaussian, camera, distance, steps)


def _paraxial(
    lens: LensPrescription, gaussian: GaussianLens, camera: CameraType, distance: float
) -> tuple[Loss, ...]:
    """What real rays do that paraxial ones do not: aberrations."""
    image = lens.length + gaussian.image_position(distance)
    point = gaussian.entrance_pupil - distance
    # Rings of the same area each, and the edge itself.
    rings = np.append(np.sqrt((np.arange(_RINGS) + 0.5) / _RINGS), 1.0)
    pupil = np.stack([np.zeros_like(rings), rings], 1)
    behind = trace(lens, pupil_rays(gaussian, pupil, distance=distance))[-1]
    across, slope = behind.at(image)[:, 1], behind.direction[:, 1] / behind.direction[:, 2]
    marginal = -across[-1] / slope[-1]
    spot = math.sqrt(float(np.mean(across[:-1] ** 2)))
    airy = 1.22 * gaussian.wavelength * _working(gaussian, camera, distance)
    corner = math.hypot(*camera.size) * camera.pixel / 2
    tangent = corner / camera.image_distance(distance)
    landed = abs(float(chief_ray(lens, gaussian, tangent, distance)[-1].at(image)[0, 1]))
    colours = [_image_of(gaussian_lens(lens, w), point) for w in lens.wavelengths]
    return (
        Loss("spherical aberration, focus of the marginal ray", marginal, "mm"),
        Loss("radius of its spot on the axis, RMS", spot / camera.pixel, "pixels"),
        Loss("radius of the Airy disc, to compare", airy / camera.pixel, "pixels"),
        Loss("distortion at the corner", 100 * (landed / corner - 1), "%"),
        Loss("focus between the colours", max(colours) - min(colours), "mm"),
    )


def _image_of(colour: GaussianLens, point: float) -> float:
    """Where one colour has its image of a point that stands still; its pupil is its own."""
    return colour.image_position(colour.entrance_pupil - point)


def _thin(gaussian: GaussianLens, camera: CameraType, distance: float) -> tuple[Loss, ...]:
    """What is lost when both principal planes and both pupils become one plane."""
    P, m = gaussian.pupil_magnification, camera.magnification(distance)
    beyond = distance - gaussian.focal_length
    # A lens whose exit pupil is the larger one is sharp where one with equal pupils never is.
    simple = gaussian.focal_length / beyond if beyond > 0 else math.inf
    return (
        Loss("space between the principal planes, left out", gaussian.hiatus, "mm"),
        Loss(
            "centre of perspective before the front principal plane",
            gaussian.front_principal - gaussian.entrance_pupil,
            "mm",
        ),
        Loss("magnification, were the pupils taken as equal", 100 * (simple / m - 1), "%"),
        Loss(
            "working f-number, were the pupils taken as equal",
            100 * ((1 + m) / (1 + m / P) - 1),
            "%",
        ),
    )


def _pinhole(
    gaussian: GaussianLens, camera: CameraType, distance: float, depth: float
) -> tuple[Loss, ...]:
    """What a pinhole has no notion of: its cut-off is infinite, as is its depth of field."""
    A, wavelength, m = gaussian.pupil_diameter, gaussian.wavelength, camera.magnification(distance)
    focal = camera.image_distance(distance) / camera.pixel
    sharp = sharp_range(A, distance, 1.0, focal)
    near = distance - depth / 2
    return (
        Loss("cut-off of diffraction", incoherent_cutoff(A, distance, wavelength), "cycles/mm"),
        Loss("cut-off of the pixels", m / (2 * camera.pixel), "cycles/mm"),
        Loss("depth in which blur is below one pixel", sharp.depth, "mm"),
        Loss("depth of field of diffraction", diffraction_depth(A, distance, wavelength), "mm"),
        Loss(f"blur at {near:.4g} mm", A * focal * (1 / near - 1 / distance), "pixels"),
    )


def _working(gaussian: GaussianLens, camera: CameraType, distance: float) -> float:
    """Working f-number in the image."""
    return gaussian.f_number * (1 + camera.magnification(distance) / gaussian.pupil_magnification)
