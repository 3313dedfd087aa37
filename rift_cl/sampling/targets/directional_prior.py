"""Priors that favour directions: by how much, and with less trust in which.

A plan that follows a spectrum into a few directions loses where the spectrum is wrong. A share of
the same power without any direction, or directions that are blurred, cost little where it is right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.sampling.targets.prior import PowerLaw, Prior, directions_for
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Directions and radii at which power is averaged, and the width, in radians, over which it is
# smoothed before its spread is taken: what a measured spectrum has of speckle is finer.
_WAYS, _RADII, _SMOOTH = 120, 24, 0.35
# Nodes along the normal distribution by which directions are blurred.
_NODES = 7


@dataclass(frozen=True)
class Trusted:
    """A prior of which a share is believed, and the rest taken to have the same in all directions.

    Args:
        prior: what is believed.
        trust: the share, from 0 to 1.
        blur: radians, the standard deviation of what directions may be wrong by.
        axes: 2 for a flat target, 3 for one in space.

    Raises:
        InputError: the trust is not from 0 to 1, or the blur negative.
    """

    prior: Prior
    trust: float = 1.0
    blur: float = 0.0
    axes: int = 3

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not 0 <= one_number(self.trust) <= 1:
            raise InputError(f"Trusted: trust is {self.trust!r}, wanted 0 to 1")
        if not 0 <= one_number(self.blur) <= math.pi:
            raise InputError(f"Trusted: blur is {self.blur!r}, wanted radians from 0 to pi")

    def power(self, k: Any, diameter: float) -> Floats:
        """``trust`` times the blurred power at k, and the rest times its mean over directions."""
        at = np.asarray(k, np.float64)
        found = np.zeros(len(at))
        if self.trust > 0:
            found += self.trust * self._blurred(at, diameter)
        if self.trust < 1:
            found += (1 - self.trust) * self._level(at, diameter)
        return found

    def _blurred(self, k: Floats, diameter: float) -> Floats:
        if self.blur == 0:
            return np.asarray(self.prior.power(k, diameter), np.float64)
        nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
        weights = weights / weights.sum()
        # In space a turn about one axis leaves alone what lies along it; three move everything.
        axes = np.eye(3)[2:] if self.axes == 2 else np.eye(3)
        total = np.zeros(len(k))
        for axis in axes:
            for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
                turn = _about(axis, self.blur * node)
                total += weight / len(axes) * self.prior.power(k @ turn.T, diameter)
        return total

    def _level(self, k: Floats, diameter: float) -> Floats:
        radius = np.linalg.norm(k, axis=1)
        high = float(radius.max(initial=0)) or 1 / diameter
        radii = np.linspace(0, high, 4 * _RADII)
        mean = _by_direction(self.prior, radii, diameter, self.axes).mean(axis=1)
        return np.asarray(np.interp(radius, radii, mean))


@dataclass(frozen=True, eq=False)
class Turned:
    """A prior that is turned.

    Args:
        prior: what it was.
        turn: (3, 3) rotation.
    """

    prior: Prior
    turn: Floats

    def power(self, k: Any, diameter: float) -> Floats:
        """The prior's power at k turned back."""
        return self.prior.power(np.asarray(k, np.float64) @ self.turn, diameter)


def turned(prior: Prior, axis: ArrayLike, angle: float) -> Turned:
    """A prior turned about an axis (3,) of length 1, by an angle in radians."""
    return Turned(prior, _about(np.asarray(axis, np.float64), angle))


def anisotropy(target: Target) -> float:
    """By how much the power of a target depends on the direction: spread over mean.

    It is smoothed over 20 degrees, and averaged over frequencies with the power that each has of
    the whole; 0 for a power law.
    """
    prior = target.prior
    if isinstance(prior, PowerLaw):
        return 0.0
    axes = 2 if target.is_flat or target.mode == "surface" else 3
    radii = np.linspace(1 / target.diameter, target.highest, _RADII)
    power = _by_direction(prior, radii, target.diameter, axes)
    mean = power.mean(axis=1, keepdims=True)
    held = mean[:, 0] > 0
    profile = (power[held] / mean[held]).mean(axis=0)
    ways = directions_for(axes, _WAYS)
    near = np.exp(-((np.arccos(np.clip(np.abs(ways @ ways.T), 0, 1)) / _SMOOTH) ** 2) / 2)
    smooth = near @ profile / near.sum(axis=1)
    return float(smooth.std() / smooth.mean())


def _by_direction(prior: Prior, radii: Floats, diameter: float, axes: int) -> Floats:
    """(radii, ways) power all round."""
    ways = directions_for(axes, _WAYS)
    k = (radii[:, None, None] * ways).reshape(-1, 3)
    return np.asarray(prior.power(k, diameter)).reshape(len(radii), _WAYS)


def _about(axis: Floats, angle: float) -> Floats:
    """Rotation about a unit vector (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)
