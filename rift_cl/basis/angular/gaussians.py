"""Sums of Gaussians on the sphere: isotropic ones, and anisotropic ones.

Isotropic: exp(s (d . a - 1)), Wang et al. 2009. Anisotropic: max(d . a, 0) exp(-l1 (d . t)^2 -
l2 (d . b)^2), Xu et al. 2013. A constant comes before the lobes.
"""

from __future__ import annotations

from math import log, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis.angular.frame import frames_of, quaternion_towards, unit_axes, unit_directions
from rift_cl.basis.angular.protocol import CONSTANT, AngularFunctions, Slopes, last_axis
from rift_cl.basis.numbers import whole

Floats = NDArray[np.float64]
MOST_LOBES = 35
# Sharpness is held between these: 1e4 is a lobe of 0.6 degrees, 1e-4 is a constant.
LEAST_SHARPNESS, MOST_SHARPNESS = 1e-4, 1e4
_LOG_LIMITS = (log(LEAST_SHARPNESS), log(MOST_SHARPNESS))


class _Lobes(AngularFunctions):
    """What both kinds share: K lobes of P numbers each, one after the other."""

    _numbers: int

    def __init__(self, lobes: int) -> None:
        name, hint = f"{type(self).__name__}: lobes", ", one less than there are functions"
        self.lobes = whole(lobes, name, 1, MOST_LOBES, hint)
        self.n_linear = 1 + self.lobes
        self.n_geometry = self._numbers * self.lobes

    @classmethod
    def of_count(cls, count: int) -> _Lobes:
        """The basis that has this many functions, the constant and its lobes.

        Raises:
            InputError: it is no whole number from 2 to 36.
        """
        return cls(whole(count, f"{cls.__name__}: functions", 2, MOST_LOBES + 1) - 1)

    def slopes(self, geometry: ArrayLike | None, directions: ArrayLike) -> Slopes:
        """All functions with their derivatives."""
        name = type(self).__name__
        shapes = last_axis(geometry, self.n_geometry, f"{name}: geometry")
        given = last_axis(directions, 3, f"{name}: directions")
        with np.errstate(all="ignore"):
            shapes = np.where(np.isfinite(shapes).all(-1, keepdims=True), shapes, np.nan)
            units = unit_directions(given)
            numbers = shapes.reshape(*shapes.shape[:-1], self.lobes, self._numbers)
            values, own, by_unit = self._lobe(numbers, units.vectors[..., None, :])
            by_directions = np.einsum("...ki,...ij->...kj", by_unit, units.slopes)
        # NaN of one lobe reaches all functions: the splat's colour cannot be said.
        spoilt = 0 * values.sum(-1, keepdims=True)
        by_geometry = np.zeros((*values.shape[:-1], self.n_linear, self.lobes, self._numbers))
        each = np.arange(self.lobes)
        by_geometry[..., 1 + each, each, :] = own
        return Slopes(
            np.concatenate([CONSTANT + spoilt, values + spoilt], -1),
            by_geometry.reshape(*values.shape[:-1], self.n_linear, self.n_geometry),
            np.concatenate([np.zeros_like(by_directions[..., :1, :]), by_directions], -2),
        )

    def _lobe(self, numbers: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
        """Each lobe's value (..., K), slopes by its own numbers and by the unit direction."""
        raise NotImplementedError

    def _start_axes(self, axes: ArrayLike) -> Floats:
        """(..., K, 3): the first lobe along each axis, the others spread over its hemisphere.

        Lobes that begin alike would stay alike. Points turn by the golden angle from ring to ring
        (Fibonacci's lattice), on rings of equal areas.
        """
        along = unit_directions(last_axis(axes, 3, f"{type(self).__name__}: axes")).vectors
        k = np.arange(self.lobes)
        z = 1 - k / self.lobes
        turn, ring = pi * (3 - 5**0.5) * k, np.sqrt(1 - z * z)
        points = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], -1)
        frames = frames_of(quaternion_towards(along)).matrices
        return np.asarray(np.einsum("...ij,kj->...ki", frames, points))

    def _start_log_sharpness(self) -> float:
        """So that the lobes, of solid angle 2 pi / s each, cover the hemisphere about once."""
        return log(max(2, self.lobes))


class SphericalGaussians(_Lobes):
    """A constant and K isotropic lobes.

    Args:
        lobes: K, 1 to 35. The geometry has 4 numbers to a lobe: the axis, of any length, and the
            logarithm of the sharpness.

    Raises:
        InputError: the number is none of these.
    """

    name = "sg"
    _numbers = 4

    def _lobe(self, numbers: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
        axes = unit_axes(numbers[..., :3])
        sharpness, free = _sharpness(numbers[..., 3])
        exponent = sharpness * ((d * axes.vectors).sum(-1) - 1)
        value = np.exp(exponent)
        steep = (sharpness * value)[..., None]
        by_axis = np.einsum("...i,...ij->...j", steep * d, axes.slopes)
        by_log = (exponent * value * free)[..., None]
        return value, np.concatenate([by_axis, by_log], -1), steep * axes.vectors

    def start_geometry(self, axes: ArrayLike) -> Floats:
        """Lobes over the hemisphere about each axis, the first along it."""
        places = self._start_axes(axes)
        sharpness = np.full((*places.shape[:-1], 1), self._start_log_sharpness())
        return np.concatenate([places, sharpness], -1).reshape(*places.shape[:-2], -1)


class AnisotropicSphericalGaussians(_Lobes):
    """A constant and K anisotropic lobes.

    Args:
        lobes: K, 1 to 35. The geometry has 6 numbers to a lobe: a quaternion (w, x, y, z) of any
            length, whose rotation's columns are t, b and the axis, then the logarithms of the
            sharpness along t and b.

    Raises:
        InputError: the number is none of these.
    """

    name = "asg"
    _numbers = 6

    def _lobe(self, numbers: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
        frames = frames_of(numbers[..., :4])
        sharpness, free = _sharpness(numbers[..., 4:])
        local = np.einsum("...ij,...i->...j", frames.matrices, d)
        parts = sharpness * local[..., :2] ** 2
        bell = np.exp(-parts.sum(-1))
        value = np.maximum(local[..., 2], 0) * bell
        by_two = -2 * value[..., None] * sharpness * local[..., :2]
        up = (np.where(local[..., 2] > 0, bell, 0 * bell))[..., None]
        by_local = np.concatenate([by_two, up], -1)
        by_quat = np.einsum("...j,...ija,...i->...a", by_local, frames.slopes, d)
        by_unit = np.einsum("...j,...ij->...i", by_local, frames.matrices)
        return value, np.concatenate([by_quat, -value[..., None] * parts * free], -1), by_unit

    def start_geometry(self, axes: ArrayLike) -> Floats:
        """Round lobes over the hemisphere about each axis, the first along it."""
        places = self._start_axes(axes)
        # exp(-l r^2) falls like exp(s (d . a - 1)) where l is half of s.
        two = np.full((*places.shape[:-1], 2), self._start_log_sharpness() - log(2))
        numbers = np.concatenate([quaternion_towards(places), two], -1)
        return numbers.reshape(*places.shape[:-2], -1)


def _sharpness(logs: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The sharpness as it is held, and where it is free to change."""
    low, high = _LOG_LIMITS
    return np.exp(np.clip(logs, low, high)), (logs > low) & (logs < high)
