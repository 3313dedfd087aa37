"""The kernel that spreads spectral samples over a regular grid, and how good it is.

A sample between the grid's points is spread with the weights of a Kaiser-Bessel kernel, and what
that does to the image is divided out in real space (J. I. Jackson et al., IEEE Trans. Medical
Imaging 10, 473, 1991). What is left is what the grid's period folds back into the image. For the
pixel at u of n, on a grid of m, it is exactly

    E(u)^2 = sum over k != 0 of |S(u / m + k) / S(u / m)|^2,

S being the kernel's spectrum: the root mean square over where a sample may stand, relative to the
sample. It is worst in the image's last pixel. The kernel's parameter is the one that makes this
worst error least, and width and padding are the cheapest that keep it below a named error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError

Floats = NDArray[np.float64]

LOG2_ROWS = 9
TABLE_PITCH = 8
# Repetitions that are summed on either side; what is left falls as their square.
_REPETITIONS = 64
_STEP = 8
# Less padding asks for kernels whose compensation multiplies rounding by hundreds.
_LEAST_PADDING, _MOST_PADDING = 1.25, 2.3
# What a cell of the padded image costs, in units of a kernel's row at a sample.
_CELL_COST, _ROWS_FOR_NOTHING = 6.0, 4.0


@dataclass(frozen=True)
class Gridding:
    """A Kaiser-Bessel kernel and the padding it is made for.

    Args:
        width: cells that it reaches along an axis.
        beta: its shape parameter.
        edges: samples of the padded image along (y, x).
        error: what it does to an image at most, relative to it.
    """

    width: int
    beta: float
    edges: tuple[int, int]
    error: float

    def table(self) -> NDArray[np.float32]:
        """Row r: the weights of the cells whose first lies r / 2^LOG2_ROWS above the lower end."""
        rows = 1 << LOG2_ROWS
        places = np.arange(rows + 1)[:, None] / rows + np.arange(self.width) - self.width / 2
        table = np.zeros((rows + 1, TABLE_PITCH), np.float32)
        table[:, : self.width] = kaiser_bessel(places, self.width, self.beta)
        return table

    def compensation(self, axis: int, samples: Floats) -> Floats:
        """What an image is multiplied by along an axis, at so many samples from the middle."""
        return 1 / spectrum(samples / self.edges[axis], self.width, self.beta)


def kaiser_bessel(places: Floats, width: int, beta: float) -> Floats:
    """The kernel at distances in cells from its middle, zero from half a width on."""
    inside = np.maximum(0, 1 - (2 * places / width) ** 2)
    values: Floats = np.where(inside > 0, np.i0(beta * np.sqrt(inside)) / np.i0(beta), 0)
    return values


def spectrum(frequencies: Floats, width: int, beta: float) -> Floats:
    """The kernel's spectrum, frequencies in cycles per cell."""
    root = np.sqrt(np.asarray(beta**2 - (np.pi * width * frequencies) ** 2, np.complex128))
    safe = np.where(np.abs(root) < 1e-9, 1e-9, root)
    values: Floats = width * (np.sinh(safe) / safe).real / float(np.i0(beta))
    return values


def choose(shape: tuple[int, int], samples: int, error: float) -> Gridding:
    """The cheapest kernel and padding for an error.

    Args:
        shape: (ny, nx) of the image.
        samples: samples that are spread.
        error: what is allowed, relative.

    Raises:
        InputError: no kernel is as good as that.
    """
    # Two axes, and twice as good: samples of one place or image are not spread evenly.
    each = error / (2 * math.sqrt(2))
    found = []
    for width in range(2, TABLE_PITCH + 1):
        edges = [_least_edge(n, width, each) for n in shape]
        if None in edges:
            continue
        ny, nx = (edge for edge in edges if edge is not None)
        cost = samples * (width + _ROWS_FOR_NOTHING) + _CELL_COST * ny * nx
        found.append((cost, width, (ny, nx)))
    if not found:
        raise InputError(f"error is {error:g}, wanted a number from 1e-6 to 0.1")
    _, width, sizes = min(found)
    paddings = [edge / n for edge, n in zip(sizes, shape, strict=True)]
    beta, worst = _best(width, round(min(paddings), 4))
    return Gridding(width, beta, sizes, worst * math.sqrt(2))


def fast_lengths(least: int, multiple: int) -> list[int]:
    """Lengths that transform fast, products of twos and threes, from ``least`` to 2.3 times it."""
    threes = [3**k for k in range(least.bit_length() + 2)]
    most = max(int(_MOST_PADDING * least), 2 * multiple)
    lengths = {
        multiple * three << twos for three in threes for twos in range(most.bit_length() + 1)
    }
    return sorted(n for n in lengths if least <= n <= most)


def _least_edge(n: int, width: int, error: float) -> int | None:
    """The least padded edge with which a kernel of this width keeps to an error."""
    for edge in fast_lengths(max(math.ceil(_LEAST_PADDING * n), 2 * TABLE_PITCH), _STEP):
        if _best(width, round(edge / n, 4))[1] <= error:
            return edge
    return None


@lru_cache(maxsize=4096)
def _best(width: int, padding: float) -> tuple[float, float]:
    """The parameter whose worst error is least for a padding, and that error."""
    end = np.pi * width * (1 - 0.5 / padding)
    candidates = end * np.linspace(0.8, 1.02, 23)
    errors = [_worst_error(width, float(beta), padding) for beta in candidates]
    best = int(np.argmin(errors))
    return float(candidates[best]), errors[best]


def _worst_error(width: int, beta: float, padding: float) -> float:
    last = min(0.5, 0.5 / padding)
    repetitions = np.arange(1, _REPETITIONS + 1)
    places = last + np.concatenate([-repetitions, repetitions])
    ratios = spectrum(places, width, beta) / spectrum(np.array(last), width, beta)
    return float(np.sqrt(np.sum(ratios**2)))
