"""Environment light: light from far away that all splats share, and what surfaces reflect of it.

The light is a sum of lobes exp(g (a_k . x - 1)) about K fixed directions a_k, a Fibonacci lattice,
with a radiance each; g = K / 2, so that neighbours overlap. A rough surface shows it blurred, about
the mirrored direction of the view:

    L(d) = w sum over k of radiance_k exp(s (a_k . r - 1)),   r = d - 2 (d . n) n,
    s = g kappa / (g + kappa),  w = s / g,
    reflected = (tint + grazing tint (1 - |d . n|)^5) L(d),

with the normal n and the sharpness kappa of the surface's own lobe: variances of Gaussians add
(Wang et al. 2009), and w keeps their integrals over a plane. Over the sphere 1 - exp(-2 s) of them
is left, since a dull lobe ends where it meets itself: 0.86 where s is 1, 0.98 where it is 2. The
last factor is Schlick's. Directions d lead from the camera to the splat; light comes from where r
leads to.

Of a splat the *reflectance* is 7 numbers: logits of the tint's three channels and of the grazing
tint's, and ln kappa. Of the light there are natural logarithms of the radiance, so that nothing is
ever negative. Rough surfaces of Beckmann roughness alpha have kappa of about 1 / (2 alpha^2).
"""

from __future__ import annotations

from functools import lru_cache
from math import log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Numbers of a splat's reflectance, and what they are at first: tint, grazing tint, sharpness.
REFLECTANCE = 7
_TINT, _GRAZING, _SHARPNESS = 0.12, 0.05, 30.0
# Radiance of each lobe at first: a surface of tint 0.12 then shows some 0.05 of it.
_RADIANCE = 0.22
MOST_LOBES = 4096
# ln kappa is held between these, as sharpness of lobes is.
MOST_LOG_SHARPNESS = log(1e4)
# Splats at a time; the least radiance that a light is taken to have, and steps towards one.
_PARTS, _DARKEST, _STEPS = 64, 1e-8, 60


@lru_cache(maxsize=8)
def environment_axes(count: int) -> Floats:
    """The directions (K, 3) of a light of ``count`` lobes: points of equal areas, read-only."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, pi * (3 - sqrt(5)) * k
    ring = np.sqrt(1 - z * z)
    axes = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], -1)
    axes.flags.writeable = False
    return axes


def lattice_sharpness(count: int) -> float:
    """The sharpness g of each of ``count`` lobes."""
    return count / 2


def start_environment(count: int) -> Floats:
    """Logarithms of the radiance of an even, dim light, (K, 3)."""
    return np.full((count, 3), log(_RADIANCE))


def start_reflectance(count: int) -> Floats:
    """The reflectance of splats that show a little of the light, (N, 7)."""
    logits = [log(share / (1 - share)) for share in (_TINT, _GRAZING)]
    return np.tile([*3 * logits[:1], *3 * logits[1:], log(_SHARPNESS)], (count, 1))


def light_from(environment: Floats, directions: Floats, like: int | None = None) -> Floats:
    """The light itself, (..., 3), that comes from directions (..., 3) of length one.

    Args:
        environment: (K, 3) logarithms of the radiance.
        directions: where it comes from.
        like: number of lobes of the light that it is as blurred as, at most K, so that it is what
            ``blunted`` mirrors show; K when not given.
    """
    count = len(environment)
    own, seen = lattice_sharpness(count), lattice_sharpness(like or count)
    near = directions @ environment_axes(count).T - 1
    return np.asarray(np.exp(seen * near) @ (np.exp(environment) * seen / own))


def reflected_light(
    normals: NDArray[np.floating],
    reflectance: NDArray[np.floating],
    environment: NDArray[np.floating],
    directions: Floats,
) -> Floats:
    """What splats reflect of the light, (N, D, 3).

    Args:
        normals: (N, 3), of any length but none; splats without one reflect nothing.
        reflectance: (N, 7).
        environment: (K, 3) logarithms of the radiance.
        directions: (D, 3) unit vectors from the camera to the splats, or (N, D, 3) to each.
    """
    count, found = len(environment), np.empty((len(normals), directions.shape[-2], 3))
    lattice, axes = lattice_sharpness(count), environment_axes(count)
    radiance = np.exp(environment.astype(float))
    for start in range(0, len(normals), _PARTS):
        here = slice(start, start + _PARTS)
        n, numbers = normals[here].astype(float), reflectance[here].astype(float)
        length = np.linalg.norm(n, axis=1, keepdims=True)
        n = n / np.where(length > 0, length, 1)
        d = directions[here] if directions.ndim == 3 else directions
        facing = (n[:, None] * d).sum(-1)
        mirrored = d - 2 * facing[..., None] * n[:, None]
        held = np.clip(numbers[:, 6], -MOST_LOG_SHARPNESS, MOST_LOG_SHARPNESS)
        kappa = np.exp(held)
        w = kappa / (lattice + kappa)
        lobes = np.exp((lattice * w)[:, None, None] * (mirrored @ axes.T - 1))
        shares = 1 / (1 + np.exp(-numbers[:, None, :6]))
        rim = np.maximum(1 - np.abs(facing), 0)[..., None] ** 5
        tint = shares[..., :3] + rim * shares[..., 3:]
        found[here] = np.where(length > 0, w[:, None], 0)[..., None] * tint * (lobes @ radiance)
    return found


def picture_lobes(count: int) -> int:
    """Lobes of a light that a picture gives to a scene whose own light has ``count``.

    Lobes as sharp as a fit's, on its own lattice, ripple: of a constant light they make 0.6 to 1.2
    of it. On a lattice of four times as many, the light is flat to 1.5 %. Beyond 1024 lobes of the
    scene there are fewer, since no light has more than 4096.
    """
    return min(4 * count, MOST_LOBES)


def blunted(reflectance: Floats, count: int, dense: int) -> Floats:
    """The reflectance (N, 7) that shows a light of ``dense`` lobes as blurred as one of ``count``.

    Lobes of a denser lattice are sharper; variances add, so that the surface takes over the rest.
    """
    found = np.array(reflectance, float)
    held = np.clip(found[:, 6], -MOST_LOG_SHARPNESS, MOST_LOG_SHARPNESS)
    rest = 1 / lattice_sharpness(count) - 1 / lattice_sharpness(dense)
    found[:, 6] = -np.log(np.exp(-held) + rest)
    return found


def environment_of(
    light: Floats, directions: Floats, weights: Floats, count: int, like: int | None = None
) -> Floats:
    """The logarithms of radiance (K, 3) whose light is nearest to a given one.

    Nearest by the Kullback-Leibler divergence, whose multiplicative steps (Richardson 1972, Lucy
    1974) keep every lobe positive and the sum of the light what it was: by least squares a lamp
    smaller than a lobe would give up to twice its light.

    Args:
        light: (M, 3) what comes from the directions, 0 or more.
        directions: (M, 3) of length one.
        weights: (M,) solid angles, to any factor.
        count: K.
        like: number of lobes of the light that is to be matched in sharpness, at most K, as
            ``blunted`` surfaces see it; K when not given.
    """
    own, seen = lattice_sharpness(count), lattice_sharpness(like or count)
    lobes = np.exp(seen * (directions @ environment_axes(count).T - 1))
    shares, wanted = weights / weights.sum(), light + _DARKEST
    each = (shares @ lobes)[:, None]
    radiance = np.tile(shares @ wanted / each.sum(), (count, 1))
    for _ in range(_STEPS):
        radiance *= lobes.T @ (shares[:, None] * wanted / (lobes @ radiance)) / each
    return np.asarray(np.log(np.maximum(radiance, _DARKEST) * own / seen))
