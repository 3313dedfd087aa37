"""Compositing of splats with Hermite modes as it is defined: the twin of the raster kernels.

Takes projected splats, their modes on the screen and tile lists as the kernels do, in float64, and
works on one tile at a time with all of its pixels side by side. ``hermite_moments`` goes back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.reference.splat_raster import ALPHA_THRESHOLD, TRANSMITTANCE_THRESHOLD, Rules

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Window = tuple[slice, slice]

# Line integrals end at so many standard deviations, by order; nothing else is seen beyond _FAR.
EDGES = (4.0, 4.353, 4.619, 4.837, 5.020, 5.176, 5.306, 5.412, 5.491)
_FAR = 12.0


@dataclass(frozen=True, eq=False)
class HermiteSplats:
    """Splats with modes on the screen.

    Args:
        screen: (N, 8), of which the mean and the weight are read.
        whitening: (N, 3), i00, i10, i11 of L^-1.
        shape: (N, K2(S) - 1), modes of the density, graded, without the constant.
        features: (N, D).
        tint: (N, K2(T) - 1, C), modes of the first C channels.
    """

    screen: Floats
    whitening: Floats
    shape: Floats
    features: Floats
    tint: Floats


@dataclass(frozen=True)
class HermiteRules:
    """What the kernels are told when they are built.

    Args:
        rules: tile, cap, additive and smooth, as for Gaussians.
        activation: what density does to light.
    """

    rules: Rules = field(default_factory=Rules)
    activation: Literal["clamp", "exp", "square"] = "clamp"


def graded_pairs(order: int) -> list[tuple[int, int]]:
    """The modes of the plane: (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2) and so on."""
    return [(n - j, j) for n in range(order + 1) for j in range(n + 1)]


def hermite_modes(u1: Floats, u2: Floats, order: int) -> Floats:
    """All He~_i(u1) He~_j(u2) up to an order, the modes along the first axis."""
    first, second = _hermite(u1, order), _hermite(u2, order)
    return np.stack([first[i] * second[j] for i, j in graded_pairs(order)])


def hermite_raster(
    splats: HermiteSplats,
    entries: Ints,
    starts: Ints,
    size: tuple[int, int],
    how: HermiteRules,
    background: Floats | None = None,
) -> tuple[Floats, Floats]:
    """The image (height, width, D) and what of the background is seen (height, width).

    Args:
        splats: what is drawn.
        entries: (M, 2), of which the first is the splat.
        starts: (tiles + 1,), where each tile's entries begin.
        size: (height, width).
        how: how to draw.
        background: (D,), black if not given.
    """
    image, transmittance = np.zeros((*size, splats.features.shape[1])), np.ones(size)
    for order, here in tile_windows(entries, starts, size, how.rules.tile):
        for seen in look_through(splats, order, here, how):
            image[here] += seen.light[..., None] * seen.color
            transmittance[here] = seen.after
    if background is not None and not how.rules.additive:
        image += transmittance[..., None] * background
    return image, transmittance


def tile_windows(
    entries: Ints, starts: Ints, size: tuple[int, int], edge: int
) -> Iterator[tuple[Ints, Window]]:
    """Each tile's splats, front to back, and the pixels it has."""
    height, width = size
    across = -(-width // edge)
    for tile in range(len(starts) - 1):
        y, x = tile // across * edge, tile % across * edge
        here = np.s_[y : min(y + edge, height), x : min(x + edge, width)]
        yield entries[starts[tile] : starts[tile + 1], 0], here


@dataclass(frozen=True, eq=False)
class Seen:
    """What one splat does to the pixels of a tile, each array of their shape.

    Args:
        splat: which it is.
        modes: He~_m(u') to the order that gradients need, the modes along the first axis.
        lever: weight g, and times Q where E has its square: dE/dQ, or half of it.
        bend: d alpha / dE, zero where a threshold or the cap holds; 1 for line integrals.
        alpha: what it hides; zero for line integrals.
        before: transmittance in front of it.
        light: what its colour is multiplied with.
        color: (..., D), its colour.
    """

    splat: int
    modes: Floats
    lever: Floats
    bend: Floats
    alpha: Floats
    before: Floats
    light: Floats
    color: Floats

    @property
    def after(self) -> Floats:
        """Transmittance behind it."""
        return self.before * (1 - self.alpha)


def look_through(
    splats: HermiteSplats, order: Ints, here: Window, how: HermiteRules
) -> Iterator[Seen]:
    """Every splat of a tile in turn, front to back."""
    rules = how.rules
    y = np.arange(here[0].start, here[0].stop, dtype=np.float64)[:, None] + 0.5
    x = np.arange(here[1].start, here[1].stop, dtype=np.float64) + 0.5
    left = np.ones((y.shape[0], x.size))
    finished = np.zeros(left.shape, bool)
    for splat in order:
        modes, gauss = _on_pixels(splats, splat, x, y, rules)
        shape, tint = splats.shape[splat], splats.tint[splat]
        q = 1 + np.tensordot(shape, modes[1 : 1 + len(shape)], 1)
        color = np.broadcast_to(splats.features[splat], (*left.shape, splats.features.shape[1]))
        color = color.copy()
        color[..., : tint.shape[1]] += np.tensordot(modes[1 : 1 + len(tint)], tint, (0, 0))
        peak = splats.screen[splat, 5] * gauss
        if rules.additive:
            yield Seen(splat, modes, peak, np.ones_like(q), 0 * q, left, peak * q, color)
            continue
        lever = peak * q if how.activation == "square" else peak
        alpha, bend = _alpha(lever * q, how)
        if not rules.smooth:
            counts = (alpha >= ALPHA_THRESHOLD) & ~finished
            finished |= counts & (left * (1 - alpha) <= TRANSMITTANCE_THRESHOLD)
            alpha, bend = (np.where(counts & ~finished, v, 0) for v in (alpha, bend))
        yield Seen(splat, modes, lever, bend, alpha, left, alpha * left, color)
        left = left * (1 - alpha)


def _on_pixels(
    splats: HermiteSplats, splat: int, x: Floats, y: Floats, rules: Rules
) -> tuple[Floats, Floats]:
    """The modes at a tile's pixels, and the Gaussian."""
    i00, i10, i11 = splats.whitening[splat]
    dx, dy = x - splats.screen[splat, 0], y - splats.screen[splat, 1]
    u1, u2 = i00 * dx + 0 * dy, i10 * dx + i11 * dy
    shape, tint = order_of_others(splats.shape.shape[1]), order_of_others(splats.tint.shape[1])
    edge = EDGES[max(shape, tint)] if rules.additive and not rules.smooth else _FAR
    within = u1**2 + u2**2 <= edge**2
    u1, u2 = np.where(within, u1, 0), np.where(within, u2, 0)
    return hermite_modes(u1, u2, max(shape + 2, tint)), within * np.exp(-(u1**2 + u2**2) / 2)


def _alpha(density: Floats, how: HermiteRules) -> tuple[Floats, Floats]:
    """Alpha, and how much it changes with the density."""
    positive = np.maximum(density, 0)
    hidden = positive if how.activation == "clamp" else -np.expm1(-positive)
    bend = np.ones_like(hidden) if how.activation == "clamp" else 1 - hidden
    cap = how.rules.cap
    return np.minimum(hidden, cap), np.where((density > 0) & (hidden <= cap), bend, 0)


def order_of_others(others: int) -> int:
    """The order that has so many modes besides the constant one."""
    return next(n for n in range(9) if len(graded_pairs(n)) == others + 1)


def _hermite(x: Floats, order: int) -> list[Floats]:
    values = [np.ones_like(x), x]
    for n in range(1, order):
        values.append((x * values[n] - np.sqrt(n) * values[n - 1]) / np.sqrt(n + 1))
    return values
