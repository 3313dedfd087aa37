"""Rays through a prescription by Snell's law alone: what the first-order model is measured by.

Every ray is followed from surface to surface without approximation (W. T. Welford, "Aberrations of
Optical Systems", chapter 4: a quadratic for the intersection with a conic, the vector form of the
law of refraction).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import positive_or_infinite
from rift_cl.optics.gaussian_lens import GaussianLens
from rift_cl.optics.lens_prescription import LensPrescription, Surface

Floats = NDArray[np.float64]
# How close to the middle of the stop a chief ray comes, as a share of its radius.
_CENTRED = 1e-9


class Rays(NamedTuple):
    """Where rays are and where they go.

    Args:
        position: (R, 3) x, y across and z along the axis, millimetres.
        direction: (R, 3) unit vectors.
    """

    position: Floats
    direction: Floats

    def at(self, z: float) -> Floats:
        """(R, 2) where the rays cross the plane z."""
        way = (z - self.position[:, 2:]) / self.direction[:, 2:]
        return np.asarray(self.position[:, :2] + way * self.direction[:, :2])


def trace(lens: LensPrescription, rays: Rays, wavelength: float | None = None) -> list[Rays]:
    """Follow rays from surface to surface.

    Args:
        lens: the prescription; its first vertex is at z = 0.
        rays: before the first surface, anywhere along their lines.
        wavelength: millimetres; the primary one when None.

    Returns:
        The rays on each surface, going on behind it. Semi-diameters and the stop clip nothing.

    Raises:
        InputError: a ray misses a surface or is reflected totally; the error names the surface.
    """
    indices = lens.indices(lens.wavelength if wavelength is None else wavelength)
    found, vertex = [], 0.0
    for index, surface in enumerate(lens.surfaces):
        rays, lost = _refract(rays, surface, vertex, indices[index], indices[index + 1])
        if lost:
            raise InputError(
                f"lens {lens.name!r}: a ray {lost} surface {index + 1} of {len(lens.surfaces)}; "
                "the opening or the field is too wide for this lens"
            )
        found.append(rays)
        vertex += surface.thickness
    return found


def _refract(
    rays: Rays, surface: Surface, vertex: float, n: float, behind: float
) -> tuple[Rays, str]:
    """The rays behind a surface, and what happened to a ray that is not there."""
    c, squash = surface.curvature, np.array([1.0, 1.0, 1 + surface.conic])
    at_vertex = np.array([0.0, 0.0, vertex])
    start, go = rays.position - at_vertex, rays.direction
    # From the vertex plane, where the root that is wanted is the near one.
    start = start - go * (start[:, 2:] / go[:, 2:])
    a = c * np.sum(squash * go * go, 1)
    b = c * np.sum(squash * start * go, 1) - go[:, 2]
    rest = c * np.sum(squash * start * start, 1)
    root = b * b - a * rest
    if not (root >= 0).all():
        return rays, "misses"
    hit = start + go * (rest / (-b + np.sqrt(root)))[:, None]
    normal = np.array([0.0, 0.0, 1.0]) - c * squash * hit
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cosine, ratio = np.sum(normal * go, 1), n / behind
    inside = 1 - ratio**2 * (1 - cosine**2)
    if not ((inside >= 0) & (cosine > 0)).all():
        return rays, "cannot leave" if n > behind else "misses"
    bent = ratio * go + (np.sqrt(inside) - ratio * cosine)[:, None] * normal
    return Rays(hit + at_vertex, bent), ""


def pupil_rays(
    gaussian: GaussianLens, pupil: ArrayLike, *, distance: float = math.inf, slope: float = 0.0
) -> Rays:
    """Rays from one point through places of the entrance pupil.

    Args:
        gaussian: the lens.
        pupil: (R, 2) places in the pupil; 1 is its edge.
        distance: of the point from the pupil along the axis; may be infinite.
        slope: tangent of the field angle: the point lies ``slope * distance`` above the axis.

    Raises:
        InputError: the distance is not positive.
    """
    away = positive_or_infinite(distance)
    if not away > 0:
        raise InputError(f"distance is {distance!r}, wanted a positive length in front of the lens")
    across = np.asarray(pupil, np.float64).reshape(-1, 2) * gaussian.pupil_diameter / 2
    position = np.concatenate([across, np.full((len(across), 1), gaussian.entrance_pupil)], 1)
    go = np.tile([0.0, -slope, 1.0], (len(across), 1))
    go[:, :2] += across / away
    return Rays(position, go / np.linalg.norm(go, axis=1, keepdims=True))


def chief_ray(
    lens: LensPrescription, gaussian: GaussianLens, slope: float, distance: float = math.inf
) -> list[Rays]:
    """The ray of a field point through the middle of the stop itself, by secant steps.

    Args:
        lens: the prescription.
        gaussian: its reduction at the primary wavelength.
        slope: tangent of the field angle at the entrance pupil.
        distance: of the field point.

    Returns:
        The one ray on each surface.

    Raises:
        InputError: there is no such ray.
    """
    stop = sum(surface.thickness for surface in lens.surfaces[: lens.stop])

    def missed(height: float) -> tuple[float, list[Rays]]:
        rays = pupil_rays(gaussian, [[0.0, height]], distance=distance, slope=slope)
        found = trace(lens, rays)
        before = found[lens.stop - 1] if lens.stop else rays
        return float(before.at(stop)[0, 1]), found

    low, high = 0.0, 1e-3
    off_low, found = missed(low)
    for _ in range(30):
        off_high, tried = missed(high)
        if off_high == off_low:
            break
        low, high = high, high - off_high * (high - low) / (off_high - off_low)
        off_low, found = off_high, tried
        if abs(off_low) < 1e-12 * gaussian.stop_radius:
            break
    if not abs(off_low) < _CENTRED * gaussian.stop_radius:
        raise InputError(
            f"lens {lens.name!r}: no ray that comes in at the slope {slope:g} was found to go "
            "through the middle of the stop; the field is too wide for this lens"
        )
    return found
