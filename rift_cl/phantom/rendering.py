"""Ellipsoids on a grid: each sample the mean over its pixel or voxel."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Grid
from rift_cl.phantom.ellipsoid import Ellipsoid, Reals

_STRIP_SAMPLES = 1 << 20


def render(
    ellipsoids: Sequence[Ellipsoid], grid: Grid, *, oversampling: int = 4
) -> NDArray[np.float32]:
    """Sum of ellipsoids on a grid, each sample the mean over its pixel or voxel.

    Args:
        ellipsoids: the parts; an image shows their equatorial sections.
        grid: the image or volume to fill.
        oversampling: the mean along x is exact; along y, and along z of a volume, it is taken
            over this many evenly spaced lines through every sample.

    Returns:
        Densities of shape ``grid.shape``.

    Raises:
        InputError: ``oversampling`` is not a positive whole number.
    """
    if int(oversampling) != oversampling or oversampling < 1:
        raise InputError(f"render: oversampling is {oversampling!r}, wanted a whole number >= 1")
    ny, nx = grid.shape[-2:]
    y = _lines(grid, axis=-2, per_sample=int(oversampling))
    volume = len(grid.shape) == 3
    levels = list(_lines(grid, axis=0, per_sample=int(oversampling))) if volume else [None]
    density = np.empty((len(levels), ny, nx), dtype=np.float32)
    rows = max(1, _STRIP_SAMPLES // nx)
    for k, z in enumerate(levels):
        for first in range(0, ny, rows):
            strip = slice(first, first + rows)
            density[k, strip] = _render_strip(ellipsoids, grid, y[strip], z)
    return density.reshape(grid.shape)


def _lines(grid: Grid, *, axis: int, per_sample: int) -> Reals:
    """Coordinates (sample, line) of evenly spaced lines through every sample along an axis."""
    offsets = ((np.arange(per_sample) + 0.5) / per_sample - 0.5) * grid.spacing[axis]
    return grid.coordinates(axis)[:, None] + offsets


def _render_strip(ellipsoids: Sequence[Ellipsoid], grid: Grid, y: Reals, z: Reals | None) -> Reals:
    nx, dx = grid.shape[-1], grid.spacing[-1]
    left = grid.center[-1] - nx / 2 * dx
    total = np.zeros((len(y), nx))
    for part in ellipsoids:
        middle, half = _chords(part, y, z)
        hit = (half > 0).any(axis=1)
        if hit.any():
            begin, end = (middle - half - left) / dx, (middle + half - left) / dx
            total[hit] += part.value * _coverage(begin[hit], end[hit], nx)
    return total


def _chords(part: Ellipsoid, y: Reals, z: Reals | None) -> tuple[Reals, Reals]:
    """Middle and half length of the x interval inside, (row, line), on every line y of every z."""
    _, b, a = part.semi_axes
    cos, sin = math.cos(part.angle), math.sin(part.angle)
    xx = (cos / a) ** 2 + (sin / b) ** 2
    xy = cos * sin * (1 / a**2 - 1 / b**2)
    offset = (y - part.center[1])[:, :, None]
    square = xx * part.section(z) - (offset / (a * b)) ** 2
    middle = part.center[2] - offset * xy / xx + np.zeros_like(square)
    half = np.sqrt(np.maximum(square, 0)) / xx
    return middle.reshape(len(y), -1), half.reshape(len(y), -1)


def _coverage(begin: Reals, end: Reals, pixels: int) -> Reals:
    """Share of each pixel, [i, i + 1], that the intervals cover, mean over the lines.

    Left of an edge the share is 0, right of it 1, in its own pixel a part: two impulses and a
    running sum. Intervals are (row, line), the result is (row, pixel).
    """
    edges = np.clip(np.stack([begin, end]), 0, pixels)
    # Whole multiples of 2^-24 add up without rounding: exactly 0 outside and 1 inside.
    edges = np.rint(edges * 2.0**24) / 2.0**24
    whole = np.floor(edges)
    part = edges - whole
    rows, lines = begin.shape
    steps = np.zeros((rows, pixels + 2))
    index = (whole.astype(np.intp) + np.arange(rows)[:, None] * (pixels + 2)).ravel()
    sign = np.array([1.0, -1.0])[:, None, None]
    np.add.at(steps.reshape(-1), index, (sign * (1 - part)).ravel())
    np.add.at(steps.reshape(-1), index + 1, (sign * part).ravel())
    covered: Reals = np.cumsum(steps, axis=1)[:, :pixels] / lines
    return covered
