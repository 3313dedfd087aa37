"""Random flat objects with a spectrum that is the same in all directions, or drawn out in one.

Half are sums of soft ellipses, half are fields with a power-law spectrum; all fade out towards the
edge of a disc, so that no sharp edge of their own gives them power in every direction.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# The disc's radius and the width of its edge, in sides of the picture.
RADIUS, _FADE = 0.46, 0.12
# Along which objects are drawn out, in radians from x.
ALONG = 0.5
_ELLIPSES, _VARY = 10, 0.2


def random_objects(count: int, edge: int, stretch: float, seed: int) -> Floats:
    """Objects (count, edge, edge) that vary by 0.2 in the disc, one standard deviation.

    Args:
        count: how many.
        edge: samples along a side.
        stretch: how many times longer details are along ``ALONG`` than across it; 1 for objects
            that look the same in every direction.
        seed: what they are drawn from.
    """
    across = (np.arange(edge) + 0.5) / edge - 0.5
    x, y = across[None], across[:, None]
    fade = np.clip((RADIUS - np.hypot(x, y)) / _FADE, 0, 1)
    fade = fade * fade * (3 - 2 * fade)
    made = np.empty((count, edge, edge))
    for index in range(count):
        random = np.random.default_rng([seed, index])
        drawn = _field(random, edge, stretch) if index % 2 else _ellipses(random, x, y, stretch)
        made[index] = fade * (drawn - np.average(drawn, weights=fade))
    inside = np.hypot(x, y) < RADIUS
    return np.asarray(_VARY * made / np.sqrt((made[:, inside] ** 2).mean(1))[:, None, None])


def _ellipses(random: np.random.Generator, x: Floats, y: Floats, stretch: float) -> Floats:
    """Ellipses with edges a hundredth of the picture wide."""
    total = np.zeros((y.size, x.size))
    for _ in range(_ELLIPSES):
        turn = random.uniform(0, np.pi) if stretch == 1 else random.normal(ALONG, 0.1)
        level, (cx, cy) = random.choice([-1, 1]) * random.uniform(0.3, 1), _place(random)
        a, b = random.uniform(0.05, 0.18, 2) * [stretch**0.5, stretch**-0.5]
        u = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
        v = (y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)
        total += level * np.clip((1 - np.hypot(u / a, v / b)) * min(a, b) * 100 + 0.5, 0, 1)
    return total


def _place(random: np.random.Generator) -> Floats:
    radius, angle = 0.33 * np.sqrt(random.uniform()), random.uniform(0, 2 * np.pi)
    return radius * np.array([np.cos(angle), np.sin(angle)])


def _field(random: np.random.Generator, edge: int, stretch: float) -> Floats:
    """A field whose power falls as the cube of the frequency."""
    line = np.fft.fftfreq(edge, 1 / edge)
    kx, ky = line[None], line[:, None]
    u = (kx * np.cos(ALONG) + ky * np.sin(ALONG)) * stretch**0.5
    v = (ky * np.cos(ALONG) - kx * np.sin(ALONG)) * stretch**-0.5
    amplitude = np.maximum(np.hypot(u, v), 1) ** -1.5 * (np.hypot(kx, ky) < edge / 4)
    return np.asarray(
        np.fft.ifft2(np.fft.fft2(random.standard_normal((edge, edge))) * amplitude)
    ).real


def mean_power(objects: Floats, isotropic: bool) -> Floats:
    """Their mean ``|FFT|^2`` over the number of samples, (edge, edge), frequency zero first.

    Where they are alike in all directions, the mean over those is taken too. No power is below a
    millionth of the largest.
    """
    edge = objects.shape[-1]
    power = (np.abs(np.fft.fft2(objects)) ** 2).mean(0) / edge**2
    if isotropic:
        line = np.fft.fftfreq(edge, 1 / edge)
        shell = np.rint(np.hypot(line[:, None], line)).astype(np.intp)
        power = (np.bincount(shell.ravel(), power.ravel()) / np.bincount(shell.ravel()))[shell]
    return np.asarray(np.maximum(power, 1e-6 * power.max()))
