"""What is painted on the ornament: bands, zigzags, dots and stars, and the wood of the base.

Pictures are computed, so that the scene needs no file and its seed says all of it. They are in
display light (sRGB), uint8.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.uint8]
Floats = NDArray[np.float64]

_HEIGHT, _WIDTH = 1024, 2048
_SILVER, _TEAL, _GREEN = (0.93, 0.80, 0.90), (0.13, 0.60, 0.57), (0.55, 0.82, 0.16)
_MAGENTA, _BLUE, _RED = (0.70, 0.20, 0.74), (0.15, 0.33, 0.66), (0.66, 0.12, 0.16)


def ball() -> tuple[Codes, Codes]:
    """The ball's colours (rows from the upper pole, columns by azimuth) and where paint is.

    Returns:
        (height, width, 3) colours, and (height, width, 1) 255 where the metal is painted over.
    """
    latitude = 90 - (np.arange(_HEIGHT)[:, None] + 0.5) * 180 / _HEIGHT
    azimuth = (np.arange(_WIDTH)[None] + 0.5) * 360 / _WIDTH
    colors = np.broadcast_to(np.array(_SILVER), (_HEIGHT, _WIDTH, 3)).copy()
    painted = np.zeros((_HEIGHT, _WIDTH), bool)

    def paint(where: NDArray[np.bool_], color: tuple[float, float, float]) -> None:
        colors[where], painted[where] = color, True

    bands = ((24, 37, _MAGENTA), (-15, 11, _BLUE), (-44, -30, _RED))
    for low, high, color in bands:
        paint(np.broadcast_to((latitude > low) & (latitude < high), painted.shape), color)
    for middle, count, color in ((30.5, 22, _TEAL), (-37, 18, _TEAL)):
        paint(_dots(latitude, azimuth, middle, count) < 2.6, color)
    wave = 8 * np.abs((azimuth / 360 * 12) % 1 * 2 - 1) - 6
    paint(np.abs(latitude - wave) < 2.2, _GREEN)
    for middle, count in ((17.5, 8), (-22.5, 10), (52, 6)):
        paint(_stars(latitude, azimuth, middle, count), _TEAL)
    return codes(colors), codes(painted[..., None].astype(float))


def _offsets(latitude: Floats, azimuth: Floats, middle: float, count: int) -> tuple[Floats, Floats]:
    """Degrees across and upward from the nearest of ``count`` places on a circle of latitude."""
    pitch = 360 / count
    across = ((azimuth + pitch / 2) % pitch - pitch / 2) * math.cos(math.radians(middle))
    return np.broadcast_arrays(across, latitude - middle)  # type: ignore[return-value]


def _dots(latitude: Floats, azimuth: Floats, middle: float, count: int) -> Floats:
    return np.hypot(*_offsets(latitude, azimuth, middle, count))


def _stars(latitude: Floats, azimuth: Floats, middle: float, count: int) -> NDArray[np.bool_]:
    across, up = _offsets(latitude, azimuth, middle, count)
    inside = np.hypot(across, up) < 4.2
    arms = np.zeros(inside.shape, bool)
    for turn in (0, 60, 120):
        angle = math.radians(turn)
        arms |= np.abs(across * math.cos(angle) + up * math.sin(angle)) < 0.75
    return inside & arms


def base(seed: int) -> Codes:
    """The top of the base: columns from the middle outward, rows by azimuth."""
    random = np.random.default_rng((seed, 0xBA5E))
    far = (np.arange(512)[None] + 0.5) / 512
    turn = (np.arange(1024)[:, None] + 0.5) / 1024
    x, y = far * np.cos(2 * np.pi * turn), far * np.sin(2 * np.pi * turn)
    grain = np.zeros(x.shape)
    for wave in random.normal(0, 3.5, (5, 2)):
        grain += np.sin(wave[0] * x + wave[1] * y + random.uniform(0, 6))
    rings = 0.5 + 0.5 * np.sin(16 * (np.hypot(x + 0.3, y) + 0.12 * grain))
    colors = np.array([0.46, 0.30, 0.17]) + rings[..., None] * np.array([0.22, 0.17, 0.11])
    colors[(np.abs(far - 0.79) < 0.008) & (turn >= 0)] = (0.12, 0.10, 0.10)
    tiles = random.permutation(np.arange(30) % 4)[(turn * 30).astype(int)]
    inside = (np.abs(far - 0.9) < 0.045) & (np.abs(turn * 30 % 1 - 0.5) < 0.34)
    for number, color in enumerate((_MAGENTA, _BLUE, _GREEN, _RED)):
        colors[inside & (tiles == number)] = color
    return codes(colors)


def codes(values: Floats) -> Codes:
    """Numbers from 0 to 1 as codes of 8 bits."""
    return np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)
