"""Total variation from its definition, in float64: forward differences, their adjoint, the ball.

An image x of samples with spacing h has the gradient ``(D x)_a[i] = (x[i + e_a] - x[i]) / h_a``,
zero at the last sample along axis a, and the isotropic total variation ``sum |D x|`` times the
volume of a sample, which approximates the integral of ``|grad x|``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def gradient(image: ArrayLike, spacing: Sequence[float]) -> Floats:
    """Forward differences (axes, ...) of an image (y, x) or volume (z, y, x)."""
    x = np.asarray(image, np.float64)
    field = np.zeros((x.ndim, *x.shape))
    for axis, h in enumerate(spacing):
        np.moveaxis(field[axis], axis, 0)[:-1] = np.moveaxis(np.diff(x, axis=axis) / h, axis, 0)
    return field


def gradient_adjoint(field: ArrayLike, spacing: Sequence[float]) -> Floats:
    """The adjoint of ``gradient``: minus a divergence."""
    u = np.asarray(field, np.float64)
    image = np.zeros(u.shape[1:])
    for axis, h in enumerate(spacing):
        inner = np.moveaxis(u[axis], axis, 0)[:-1] / h
        moved = np.moveaxis(image, axis, 0)
        moved[:-1] -= inner
        moved[1:] += inner
    return image


def into_ball(field: ArrayLike, radius: float) -> Floats:
    """The nearest field whose vectors, one per sample, are no longer than the radius."""
    u = np.asarray(field, np.float64)
    length = np.sqrt((u**2).sum(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(length > radius, radius / length * u, u)


def total_variation(image: ArrayLike, spacing: Sequence[float]) -> float:
    """The isotropic total variation, in the image's unit times length^(axes - 1)."""
    lengths = np.sqrt((gradient(image, spacing) ** 2).sum(axis=0))
    return float(lengths.sum()) * math.prod(spacing)


def denoise(
    image: ArrayLike, weight: float, spacing: Sequence[float], steps: int, *, nonnegative: bool
) -> tuple[Floats, Floats]:
    """The minimiser of ``|x - image|^2 / 2 + weight * sum |D x|`` and its dual field.

    By the accelerated projected gradient of Beck and Teboulle (IEEE Trans. Image Process. 18,
    2009) on the dual, which is what the kernels do as well.
    """
    b = np.asarray(image, np.float64)
    step = 1 / (4 * sum(1 / h**2 for h in spacing))
    previous = ahead = np.zeros((b.ndim, *b.shape))
    t = 1.0
    for _ in range(steps):
        x = b - gradient_adjoint(ahead, spacing)
        x = np.maximum(x, 0) if nonnegative else x
        moved = into_ball(ahead + step * gradient(x, spacing), weight)
        following = (1 + math.sqrt(1 + 4 * t * t)) / 2
        ahead = moved + (t - 1) / following * (moved - previous)
        previous, t = moved, following
    x = b - gradient_adjoint(previous, spacing)
    return (np.maximum(x, 0) if nonnegative else x), previous


def directed(field: ArrayLike, matrix: tuple[float, float, float]) -> Floats:
    """M at every vector of a field: its last two components (y, x) by (yy, yx, xx)."""
    u = np.array(field, np.float64)
    yy, yx, xx = matrix
    y, x = u[-2].copy(), u[-1].copy()
    u[-2], u[-1] = yy * y + yx * x, yx * y + xx * x
    return u
