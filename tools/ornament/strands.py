"""The ornament's fine parts as polylines: hairs, grass, gold strands, the wire ring.

Everything comes from one seed. Polylines and not B-splines: the tracer's B-spline curves crashed
in Mitsuba 3.9.1, its linear ones did not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PALE_HAIRS, GREEN_HAIRS, GRASS, GOLD = 110, 90, 100, 4
BASE_TOP, BASE_RADIUS = -1.0, 1.12
_KNOTS = 13


def strands(seed: int) -> dict[str, list[Floats]]:
    """All strands by kind; each is (knots, 4): x, y, z and the radius there."""
    random = np.random.default_rng((seed, 0x5742))
    return {
        "pale": [_hair(random) for _ in range(PALE_HAIRS)],
        "green": [_hair(random) for _ in range(GREEN_HAIRS)],
        "grass": [_blade(random) for _ in range(GRASS)],
        "gold": [_winding(random, turn) for turn in range(GOLD)],
        "ring": [_ring()],
    }


def write_strands(path: Path, lines: Sequence[Floats]) -> None:
    """Write polylines as the tracer reads them: a knot a line, an empty line between strands."""
    blocks = ("\n".join(" ".join(f"{x:.7g}" for x in knot) for knot in line) for line in lines)
    path.write_text("\n\n".join(blocks) + "\n", encoding="ascii")


def _direction(random: np.random.Generator, lowest: float) -> Floats:
    z = random.uniform(lowest, 0.97)
    angle = random.uniform(0, 2 * math.pi)
    around = math.sqrt(1 - z * z)
    return np.array([around * math.cos(angle), around * math.sin(angle), z])


def _tapered(points: Floats, radius: float) -> Floats:
    radii = radius * np.linspace(1, 0.35, len(points))
    return np.column_stack([points, radii])


def _hair(random: np.random.Generator) -> Floats:
    """A hair on the ball: it leaves at a slant and bends."""
    root = _direction(random, -0.75)
    aside = np.cross(root, random.normal(size=3))
    aside /= np.linalg.norm(aside)
    length, slant, bend = random.uniform(0.22, 0.6), random.uniform(0, 1.1), random.normal(0, 0.5)
    t = np.linspace(0, 1, _KNOTS)[:, None]
    path = (t * (root + slant * aside) + bend * t**2 * np.cross(root, aside)) * length
    path[:, 2] -= 0.12 * length * t[:, 0] ** 2
    return _tapered(0.99 * root + path, random.uniform(0.0025, 0.0065))


def _blade(random: np.random.Generator) -> Floats:
    """A blade of grass on the base."""
    around, far = random.uniform(0, 2 * math.pi), BASE_RADIUS * math.sqrt(random.uniform(0.05, 0.6))
    root = np.array([far * math.cos(around), far * math.sin(around), BASE_TOP])
    lean, length = random.normal(0, 0.7, 2), random.uniform(0.06, 0.2)
    t = np.linspace(0, 1, _KNOTS)
    path = np.column_stack([lean[0] * t**1.5, lean[1] * t**1.5, t]) * length
    return _tapered(root + path, random.uniform(0.003, 0.006))


def _winding(random: np.random.Generator, turn: int) -> Floats:
    """A gold strand once and a half round the ball, on a tilted circle that waves."""
    t = np.linspace(0, random.uniform(2.2, 3.4) * math.pi, 260)
    height = np.linspace(0.62, -0.62, GOLD)[turn] + 0.05 * np.sin(random.uniform(2, 4) * t)
    phase, tilt, toward = random.uniform(0, 2 * math.pi, 3)
    z = np.clip(height + 0.16 * math.cos(tilt) * np.sin(t + toward), -0.9, 0.9)
    around = np.sqrt(1 - z * z)
    lift = 1.025 + 0.035 * np.sin(random.uniform(4, 7) * t + phase) ** 2
    points = np.column_stack([around * np.cos(t + phase), around * np.sin(t + phase), z])
    return np.column_stack([lift[:, None] * points, np.full(len(t), 0.0115)])


def _ring() -> Floats:
    t = np.linspace(0, 2 * math.pi, 97)
    points = [np.zeros_like(t), 0.19 * np.cos(t), 1.33 + 0.19 * np.sin(t)]
    return np.column_stack([*points, np.full(len(t), 0.022)])
