"""Outgoing light that colours of splats have to show: thirteen lobes on the hemisphere.

The surface's normal is z; light falls in from the elevation that a seed draws. Every lobe is scaled
to a peak of one. Phong (1975); GGX with Smith's correlated shadowing
(Walter et al. 2007, Heitz 2014); Schlick's rim (1994).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Hemisphere:
    """Directions with weights that integrate over the hemisphere.

    Args:
        directions: (P, 3) unit vectors with z > 0.
        weights: (P,) solid angles, 2 pi in all.
    """

    directions: Floats
    weights: Floats

    @classmethod
    def gauss(cls, rings: int) -> Hemisphere:
        """Gauss and Legendre's heights, twice as many azimuths as rings."""
        z, weight = np.polynomial.legendre.leggauss(rings)
        z, weight = (z + 1) / 2, weight / 2
        phi = (np.arange(2 * rings) + 0.5) * np.pi / rings
        across = np.sqrt(1 - z**2)[:, None]
        shape = (rings, 2 * rings)
        x, y = across * np.cos(phi), across * np.sin(phi)
        grid = np.stack([x, y, np.broadcast_to(z[:, None], shape)], axis=-1)
        solid = np.broadcast_to((weight * np.pi / rings)[:, None], shape)
        return cls(grid.reshape(-1, 3), solid.ravel().copy())

    def rms(self, error: Floats) -> float:
        """Root of the mean square over the hemisphere."""
        return float(np.sqrt((self.weights * error**2).sum() / self.weights.sum()))


@dataclass(frozen=True, eq=False)
class Setting:
    """Where light comes from.

    Args:
        light: unit vector to the light.
        second: unit vector to another one.
        phase: azimuth of what has no light, in radians.
    """

    light: Floats
    second: Floats
    phase: float

    @classmethod
    def of(cls, seed: int) -> Setting:
        """Light from about 40 degrees beside the normal, the second from about 55."""
        random = np.random.default_rng([0x10BE, seed])
        first, second = np.radians(random.uniform((34, 49), (46, 61)))
        turn = random.uniform(0, 2 * np.pi)
        return cls(_toward(first, turn), _toward(second, turn + 1.9), turn)


def _toward(polar: float, azimuth: float) -> Floats:
    across = np.sin(polar)
    return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(polar)])


def phong(exponent: float) -> Callable[[Floats, Setting], Floats]:
    """A power of the cosine to the mirrored light."""

    def lobe(d: Floats, at: Setting) -> Floats:
        mirrored = at.light * (-1, -1, 1)
        return np.asarray(np.maximum(d @ mirrored, 0) ** exponent)

    return lobe


def ggx(along: float, across: float | None = None) -> Callable[[Floats, Setting], Floats]:
    """Microfacets of one roughness, or of two along and across the azimuth of the light."""

    def lobe(d: Floats, at: Setting) -> Floats:
        return _facets(d, at.light, along, along if across is None else across)

    return lobe


def _facets(d: Floats, light: Floats, along: float, across: float) -> Floats:
    half = d + light
    half = half / np.linalg.norm(half, axis=1, keepdims=True)
    side = np.array([light[0], light[1], 0.0]) / np.hypot(*light[:2])
    x, y = half @ side, half @ np.array([-side[1], side[0], 0.0])
    facing = 1 / (x**2 / along**2 + y**2 / across**2 + half[:, 2] ** 2) ** 2
    a2, seen, lit = along * across, d[:, 2], light[2]
    shadow = lit * np.sqrt(seen**2 * (1 - a2) + a2) + seen * np.sqrt(lit**2 * (1 - a2) + a2)
    return np.asarray(facing / shadow)


def _fresnel(d: Floats, at: Setting) -> Floats:
    return np.asarray((1 - d[:, 2]) ** 5)


def _mix(d: Floats, at: Setting) -> Floats:
    shine = _facets(d, at.light, 0.25, 0.25)
    return 0.3 + 0.5 * shine / shine.max() + 0.2 * _fresnel(d, at)


def _two(d: Floats, at: Setting) -> Floats:
    first, second = _facets(d, at.light, 0.2, 0.2), _facets(d, at.second, 0.35, 0.35)
    return np.asarray(first / first.max() + 0.6 * second / second.max())


def _skyline(d: Floats, at: Setting) -> Floats:
    phi = np.arctan2(d[:, 1], d[:, 0]) - at.phase
    edge = 0.45 + 0.15 * np.sin(2 * phi + 1) + 0.1 * np.sin(3 * phi)
    return np.asarray(1 / (1 + np.exp(-(d[:, 2] - edge) / 0.06)))


LOBES: dict[str, Callable[[Floats, Setting], Floats]] = {
    "phong 4": phong(4),
    "phong 16": phong(16),
    "phong 64": phong(64),
    "ggx 0.10": ggx(0.1),
    "ggx 0.20": ggx(0.2),
    "ggx 0.35": ggx(0.35),
    "ggx 0.60": ggx(0.6),
    "aniso 0.1 x 0.4": ggx(0.1, 0.4),
    "aniso 0.15 x 0.6": ggx(0.15, 0.6),
    "fresnel": _fresnel,
    "mix": _mix,
    "two lobes": _two,
    "skyline": _skyline,
}


@cache
def _peak(name: str, seed: int) -> float:
    return float(LOBES[name](Hemisphere.gauss(48).directions, Setting.of(seed)).max())


def lobe_values(name: str, directions: Floats, seed: int) -> Floats:
    """Values (P,) of one of ``LOBES`` towards directions (P, 3), with a peak of one."""
    return np.asarray(LOBES[name](directions, Setting.of(seed)) / _peak(name, seed))
