"""Where additive splats begin: the first of one sequence of places, whatever the basis.

Halton's sequence, scrambled by the seed, so that few places are a part of many and either fill the
region evenly. Splats are round, of a size that follows from how many there are.
"""

from __future__ import annotations

import numpy as np

from bases.additive import Geometry

# Standard deviation in gaps, the side of a splat's share of the region.
_SIZE = 0.55


def flat_start(count: int, size: tuple[int, int], seed: int) -> Geometry:
    """Splats in the plane z = 0 over a picture of (height, width) pixels."""
    height, width = size
    means = np.zeros((count, 3))
    means[:, :2] = _places(count, 2, seed) * (width, height) - np.array([width, height]) / 2
    scale = _SIZE * np.sqrt(height * width / count)
    # Across the plane it is no matter: what is seen along z is divided out by the coefficients.
    return _round(means, np.array([scale, scale, 1.0]))


def slice_start(count: int, radius: float, height: float, thin: float, seed: int) -> Geometry:
    """Splats in a disc of one slice at a height, ``thin`` across it."""
    turn = _places(count, 2, seed)
    r, phi = radius * np.sqrt(turn[:, 0]), 2 * np.pi * turn[:, 1]
    means = np.stack([r * np.cos(phi), r * np.sin(phi), np.full(count, height)], axis=1)
    scale = _SIZE * np.sqrt(np.pi / count) * radius
    return _round(means, np.array([scale, scale, thin]))


def ball_start(count: int, radius: float, seed: int) -> Geometry:
    """Splats in a ball about the origin."""
    place = _places(count, 3, seed)
    z, phi = 2 * place[:, 1] - 1, 2 * np.pi * place[:, 2]
    across = np.sqrt(1 - z**2)
    unit = np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=1)
    means = radius * np.cbrt(place[:, :1]) * unit
    return _round(means, np.full(3, _SIZE * np.cbrt(4 / 3 * np.pi / count) * radius))


def _places(count: int, dim: int, seed: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    from scipy.stats.qmc import Halton

    return np.asarray(Halton(dim, scramble=True, seed=seed).random(count))


def _round(
    means: np.ndarray[tuple[int, int], np.dtype[np.float64]],
    scales: np.ndarray[tuple[int], np.dtype[np.float64]],
) -> Geometry:
    count = len(means)
    quats = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    return Geometry(means, quats, np.tile(np.log(scales), (count, 1)))
