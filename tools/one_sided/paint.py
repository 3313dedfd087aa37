"""What is painted on the wall, on the picture that hangs there, and on the shelf's things.

Computed from the seed, in display light (sRGB), uint8. No place looks like another, so that
programs that find poses have something to match.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ornament.paint import Codes, codes

Floats = NDArray[np.float64]

_INKS = np.array(
    [
        (0.72, 0.24, 0.20),
        (0.16, 0.42, 0.52),
        (0.86, 0.66, 0.22),
        (0.30, 0.48, 0.24),
        (0.44, 0.26, 0.48),
        (0.14, 0.16, 0.22),
    ]
)


def wallpaper(seed: int, size: tuple[int, int], marks: int) -> Codes:
    """Pale stripes, each of a tone of its own, with discs strewn over them.

    Args:
        seed: of tones and places.
        size: (height, width) of the texture.
        marks: how many discs.
    """
    random = np.random.default_rng((seed, 0x3A11))
    height, width = size
    stripes = random.uniform(-0.05, 0.05, (max(2, width // 40), 3))
    columns = np.arange(width) * len(stripes) // width
    colors = np.broadcast_to(np.array([0.78, 0.76, 0.70]) + stripes[columns], (height, width, 3))
    return codes(strewn(colors.copy(), random, marks, 0.012))


def canvas(seed: int, size: tuple[int, int]) -> Codes:
    """The picture on the wall: hills under a sky, and patches of paint."""
    random = np.random.default_rng((seed, 0xCA4))
    height, width = size
    y, x = np.indices(size) / np.array([[[height]], [[width]]])
    colors = np.stack([0.55 + 0.3 * y, 0.68 + 0.1 * y, 0.82 - 0.2 * y], axis=-1)
    for k, ink in enumerate(random.permutation(_INKS[1:5])):
        phase, waves = random.uniform(0, 6), random.uniform(1, 3)
        edge = 0.35 + 0.15 * k + 0.07 * np.sin(2 * np.pi * waves * x + phase)
        colors[y > edge] = 0.25 + 0.6 * ink
    return codes(strewn(colors, random, 60, 0.05))


def spine(seed: int, ink: int) -> Codes:
    """The back of a book: one colour, three bands, and marks that stand for letters."""
    random = np.random.default_rng((seed, ink, 0x500))
    colors = np.broadcast_to(0.12 + 0.75 * _INKS[ink % len(_INKS)], (256, 64, 3)).copy()
    for row in random.integers(20, 230, 3):
        colors[row : row + 8] = (0.86, 0.78, 0.55)
    return codes(strewn(colors, random, 14, 0.07))


def strewn(colors: Floats, random: np.random.Generator, marks: int, largest: float) -> Floats:
    """Discs of ink at random places; ``largest`` is their radius as a share of the width."""
    height, width = colors.shape[:2]
    for _ in range(marks):
        radius = largest * width * random.uniform(0.25, 1)
        row, column = random.uniform(0, height), random.uniform(0, width)
        top, left = max(0, int(row - radius)), max(0, int(column - radius))
        part = colors[top : int(row + radius) + 2, left : int(column + radius) + 2]
        y, x = np.indices(part.shape[:2])
        part[np.hypot(y + top - row, x + left - column) < radius] = random.choice(_INKS)
    return colors
