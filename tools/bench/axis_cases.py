"""Sinograms whose rotation axis is known: sums of ellipses, projected by their formula.

A bin measures the mean of the line integrals over its width, computed in closed form from the
chord of an ellipse, so that no projector of any package has a part in them. Three kinds of object:
a porous one (a body with many small holes), one of a few large parts, and a textured one that is
wider than the detector. Bodies are drawn so wide that, with the axis far from the middle, some of
them leave the detector on one side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Fan

Floats = NDArray[np.float64]
Kind = Literal["porous", "parts", "texture"]
KINDS: tuple[Kind, ...] = ("porous", "parts", "texture")
# Views per bin of a half turn.
VIEWS = 1.4


@dataclass(frozen=True)
class AxisCase:
    """One sinogram: what is in it, and where its axis is.

    Args:
        bins: of the detector.
        offset: of the axis from the detector's middle, as a share of the bins.
        kind: of object.
        noise: standard deviation, as a share of the greatest line integral.
        turn: in degrees.
        seed: of the object and of the noise.
    """

    bins: int
    offset: float
    kind: Kind
    noise: float
    turn: int
    seed: int

    @property
    def center(self) -> float:
        """The true axis, in bins."""
        return (self.bins - 1) / 2 + self.offset * self.bins

    @property
    def angles(self) -> Floats:
        """Directions of the views, in radians; the end of the turn is left out."""
        views = round(VIEWS * self.bins * self.turn / 180)
        return np.arange(views) * np.deg2rad(self.turn) / views

    def fan(self, half_angle: float) -> Fan:
        """A fan to so many degrees on either side, half a turn longer by its whole angle."""
        span = 2 * np.pi if self.turn == 360 else np.pi + 2.6 * np.deg2rad(half_angle)
        views = round(VIEWS * self.bins * span / np.pi)
        detector = 1.5 * self.bins / 2 / np.tan(np.deg2rad(half_angle))
        angles = np.arange(views) * span / views
        return Fan(angles, self.bins, 1.5, detector / 1.5, detector, self.center)

    def fan_sinogram(self, half_angle: float) -> NDArray[np.float32]:
        """Noisy line integrals of that fan, (angle, bin)."""
        random = np.random.default_rng(self.seed)
        ellipses = _objects(self.kind, self.bins, random)
        return _noisy(fan_project(ellipses, self.fan(half_angle)), self.noise, random)

    def sinogram(self, angles: Floats | None = None) -> NDArray[np.float32]:
        """Noisy line integrals, (angle, bin)."""
        angles = self.angles if angles is None else angles
        random = np.random.default_rng(self.seed)
        ellipses = _objects(self.kind, self.bins, random)
        clean = project(ellipses, angles, self.bins, self.center)
        return _noisy(clean, self.noise, random)


def fan_project(ellipses: Floats, fan: Fan) -> Floats:
    """Line integrals of a sum of ellipses along a fan's rays, the mean of two in each bin.

    Args:
        ellipses: as for ``project``.
        fan: its bins are one apart at the axis.

    Returns:
        (angle, bin), in values times bins.
    """
    fine = replace(fan, bins=2 * fan.bins, pitch=fan.pitch / 2, center=2 * fan.center + 0.5)
    gamma = fine.fan_angles()
    angles = fan.angles[:, None] - gamma
    t = fan.source_to_axis * np.sin(gamma)
    total = np.zeros(angles.shape)
    for value, x, y, long, short, turned in ellipses:
        square = (long * np.cos(angles - turned)) ** 2 + (short * np.sin(angles - turned)) ** 2
        away = t - x * np.cos(angles) - y * np.sin(angles)
        total += 2 * value * long * short * np.sqrt(np.maximum(square - away**2, 0)) / square
    means: Floats = total.reshape(fan.views, fan.bins, 2).mean(axis=2)
    return means


def project(ellipses: Floats, angles: Floats, bins: int, center: float) -> Floats:
    """Line integrals of a sum of ellipses, each the mean over a bin.

    Args:
        ellipses: (n, 6): value, x, y, both half axes (bins) and the direction of the first.
        angles: directions of the views, in radians.
        bins: of the detector.
        center: bin of the rotation axis.

    Returns:
        (angle, bin), in values times bins.
    """
    total = np.zeros((angles.size, bins + 1))
    views = np.arange(angles.size)[:, None]
    for value, x, y, long, short, turned in ellipses:
        half = np.hypot(long * np.cos(angles - turned), short * np.sin(angles - turned))
        middle = center + x * np.cos(angles) + y * np.sin(angles)
        reach = int(np.ceil(half.max())) + 1
        first = np.floor(middle).astype(int) - reach
        edges = first[:, None] + np.arange(2 * reach + 3)
        u = np.clip((edges - 0.5 - middle[:, None]) / half[:, None], -1, 1)
        # The area of an ellipse to the left of a line, pi long short in all.
        area = value * long * short * (u * np.sqrt(1 - u * u) + np.arcsin(u))
        mean = np.diff(area, axis=1)
        inside = (edges[:, :-1] >= 0) & (edges[:, :-1] < bins)
        np.add.at(
            total,
            (np.broadcast_to(views, inside.shape), np.where(inside, edges[:, :-1], bins)),
            mean,
        )
    return total[:, :bins]


def _noisy(clean: Floats, noise: float, random: np.random.Generator) -> NDArray[np.float32]:
    noisy = clean + noise * clean.max() * random.standard_normal(clean.shape)
    return noisy.astype(np.float32)


def _objects(kind: Kind, bins: int, random: np.random.Generator) -> Floats:
    """Ellipses about the axis, in bins."""
    if kind == "parts":
        return _parts(bins, random)
    if kind == "porous":
        return _filled(random.uniform(0.25, 0.42) * bins, bins, random.integers(60, 200), random)
    return _filled(random.uniform(0.6, 0.8) * bins, bins, random.integers(800, 1400), random)


def _filled(radius: float, bins: int, count: int, random: np.random.Generator) -> Floats:
    """A body with small holes and grains all over it."""
    flat = random.uniform(0.8, 1)
    x, y = random.uniform(-0.04, 0.04, 2) * bins
    body = [1.0, x, y, radius, flat * radius, random.uniform(0, np.pi)]
    away, turn = (
        flat * radius * np.sqrt(random.uniform(0, 0.95, count)),
        random.uniform(0, 7, count),
    )
    size = bins * random.uniform(0.004, 0.02, (2, count))
    value = np.where(random.uniform(size=count) < 0.7, -1.0, 0.6) * random.uniform(0.4, 1, count)
    holes = [value, x + away * np.cos(turn), y + away * np.sin(turn), *size]
    return np.concatenate([[body], np.stack([*holes, random.uniform(0, np.pi, count)], axis=1)])


def _parts(bins: int, random: np.random.Generator) -> Floats:
    """Three to seven large ellipses, side by side or within each other."""
    count = random.integers(3, 8)
    away, turn = bins * random.uniform(0, 0.22, count), random.uniform(0, 7, count)
    long, short = bins * random.uniform(0.04, 0.17, (2, count))
    value, turned = random.uniform(0.3, 1, count), random.uniform(0, np.pi, count)
    return np.stack([value, away * np.cos(turn), away * np.sin(turn), long, short, turned], axis=1)
