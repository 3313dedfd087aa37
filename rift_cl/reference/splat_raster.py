"""Compositing, pixel by pixel as it is defined: the twin of the splat_raster kernels.

Takes projected splats and tile lists as the kernels do, in float64, and works on one tile at a
time with all of its pixels side by side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

ALPHA_THRESHOLD, TRANSMITTANCE_THRESHOLD = 1 / 255, 1e-4
SMOOTH_EDGE, ADDED_EDGE = 4.5, 8.0


@dataclass(frozen=True)
class Rules:
    """What the kernels are told when they are built.

    Args:
        tile: edge of a tile in pixels.
        cap: largest alpha.
        additive: add line integrals in place of compositing.
        smooth: no thresholds, and a falloff that fades smoothly.
        median: the last feature is that of the splat that leaves half of the light.
    """

    tile: int = 16
    cap: float = 0.99
    additive: bool = False
    smooth: bool = False
    median: bool = False


def raster(
    screen: Floats,
    features: Floats,
    entries: Ints,
    starts: Ints,
    size: tuple[int, int],
    rules: Rules,
    background: Floats | None = None,
) -> tuple[Floats, Floats]:
    """The image (height, width, D) and what of the background is seen (height, width).

    Args:
        screen: (N, 8), see ``kernels/include/raster/alpha.h``.
        features: (N, D).
        entries: (M, 2), of which the first is the splat.
        starts: (tiles + 1,), where each tile's entries begin.
        size: (height, width).
        rules: how to draw.
        background: (D,), black if not given.
    """
    height, width = size
    image = np.zeros((height, width, features.shape[1]))
    transmittance = np.ones((height, width))
    across = -(-width // rules.tile)
    for tile in range(len(starts) - 1):
        y, x = tile // across * rules.tile, tile % across * rules.tile
        here = np.s_[y : min(y + rules.tile, height), x : min(x + rules.tile, width)]
        order = entries[starts[tile] : starts[tile + 1], 0]
        image[here], transmittance[here] = _tile(screen, features, order, here, rules)
    if background is not None and not rules.additive:
        image += transmittance[..., None] * background
    return image, transmittance


def _tile(
    screen: Floats, features: Floats, order: Ints, here: tuple[slice, slice], rules: Rules
) -> tuple[Floats, Floats]:
    y = np.arange(here[0].start, here[0].stop)[:, None] + 0.5
    x = np.arange(here[1].start, here[1].stop) + 0.5
    left = np.ones((y.shape[0], x.size))
    finished = np.zeros(left.shape, bool)
    color = np.zeros((*left.shape, features.shape[1]))
    for splat in order:
        mean_x, mean_y, a, b, c, weight = screen[splat, :6]
        dx, dy = mean_x - x, mean_y - y
        sigma = (a * dx**2 + c * dy**2) / 2 + b * dx * dy
        if rules.additive:
            color += (weight * _falloff(sigma, rules))[..., None] * features[splat]
            continue
        alpha = weight * _falloff(sigma, rules)
        if not rules.smooth:
            alpha = np.minimum(alpha, rules.cap)
            counts = (alpha >= ALPHA_THRESHOLD) & ~finished
            finished |= counts & (left * (1 - alpha) <= TRANSMITTANCE_THRESHOLD)
            alpha = np.where(counts & ~finished, alpha, 0)
        sums = features.shape[1] - rules.median
        color[..., :sums] += (alpha * left)[..., None] * features[splat, :sums]
        if rules.median:
            color[(alpha > 0) & (left > 0.5), sums] = features[splat, sums]
        left = left * (1 - alpha)
    return color, left


def _falloff(sigma: Floats, rules: Rules) -> Floats:
    plain: Floats = np.exp(-sigma)
    if rules.smooth:
        plain *= np.maximum(1 - sigma / SMOOTH_EDGE, 0) ** 2
    elif rules.additive:
        plain *= sigma <= ADDED_EDGE
    return plain
