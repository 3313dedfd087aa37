"""A prior measured on a first reconstruction: from a few views, where to take the others from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.sampling.targets.prior import check_flat, directions_for

Floats = NDArray[np.float64]
_FLAT, _SOLID, _SMALLEST = 2, 3, 8
# Directions at which power is gathered, and the width over which it is smoothed in radians.
_CELLS = {_FLAT: 90, _SOLID: 500}
_WIDTH = {_FLAT: 0.08, _SOLID: 0.2}
# Of the Nyquist frequency: what lies beyond is taken for noise.
_NOISE_FROM = 0.9
# Power above this many times the noise floor tells something of the target.
_CLEAR = 2.0
# No direction is thought to have less than this share of the mean power: none is ruled out by a
# first look that may have missed it.
_LEAST = 0.05
_STEEPEST = 8.0


@dataclass(frozen=True, init=False, eq=False)
class Pilot:
    """The power of a reconstruction, as a profile along frequency times one over directions.

    Its noise floor, the power beyond 0.9 of the Nyquist frequency, is taken off. Where the rest
    drowns in it, the profile goes on by the power law that fits the rest.

    Args:
        reconstruction: (y, x) for a flat target, or (z, y, x); 8 samples or more along each axis.
        spacing: of its samples, in the unit of the world.
        noise: power of its noise at a frequency, as ``|FFT|^2 / samples``, where it is known.

    Raises:
        ShapeError: the reconstruction has another number of axes, or is too small.
        NonFiniteError: it holds NaN or infinity.
        InputError: it is constant or all noise, or the spacing or the noise makes no sense.
    """

    radii: Floats
    radial: Floats
    slope: float
    cells: Floats
    angular: Floats
    axes: int

    def __init__(
        self, reconstruction: ArrayLike, spacing: float, noise: float | None = None
    ) -> None:
        """Measure the spectrum."""
        values = _checked(reconstruction, spacing, noise)
        power, k = _periodogram(values, float(spacing))
        nyquist = 0.5 / float(spacing)
        if noise is None:
            floor = float(power[np.linalg.norm(k, axis=1) > _NOISE_FROM * nyquist].mean())
        else:
            floor = float(noise)
        step = 1 / (float(spacing) * max(values.shape))
        shell = np.rint(np.linalg.norm(k, axis=1) / step).astype(np.intp)
        clear, mean = _clear_shells(shell, power, floor, int(_NOISE_FROM * nyquist / step))
        radii, radial = step * clear, mean[clear]
        slope = -float(np.polyfit(np.log(radii), np.log(radial), 1)[0])
        heard = np.isin(shell, clear)
        whitened = np.maximum(power[heard] - floor, 0) / mean[shell[heard]]
        cells, angular = _by_direction(whitened, k[heard], values.ndim)
        object.__setattr__(self, "radii", radii)
        object.__setattr__(self, "radial", radial)
        object.__setattr__(self, "slope", float(np.clip(slope, 0, _STEEPEST)))
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "angular", angular)
        object.__setattr__(self, "axes", values.ndim)

    def power(self, k: Any, diameter: float) -> Floats:
        """Power at frequencies (K, 3): the profile along frequency times that over directions.

        Raises:
            InputError: the reconstruction was flat, and ``k`` is not.
        """
        frequencies = np.asarray(k, np.float64)
        check_flat("Pilot: reconstruction", self.axes, frequencies)
        radius = np.maximum(np.linalg.norm(frequencies, axis=1), 1 / diameter)
        along = self._radial(radius) / self._radial(np.array([1 / diameter]))
        length = np.linalg.norm(frequencies, axis=1, keepdims=True)
        direction = frequencies / np.where(length > 0, length, 1)
        return np.where(length[:, 0] > 0, along * self._angular(direction), along)

    def _radial(self, radius: Floats) -> Floats:
        """Interpolated between shells in logarithms, a power law beyond them."""
        within = np.clip(radius, self.radii[0], self.radii[-1])
        known = np.exp(np.interp(np.log(within), np.log(self.radii), np.log(self.radial)))
        beyond = np.maximum(radius / self.radii[-1], 1) ** -self.slope
        return np.asarray(known * beyond)

    def _angular(self, direction: Floats) -> Floats:
        from scipy.spatial import cKDTree

        tree = cKDTree(np.concatenate([self.cells, -self.cells]))
        apart, near = tree.query(direction, k=3)
        weight = 1 / np.maximum(apart, 1e-9)
        found = self.angular[near % len(self.cells)]
        return np.asarray((weight * found).sum(1) / weight.sum(1))


def _checked(reconstruction: ArrayLike, spacing: float, noise: float | None) -> Floats:
    values = real_numbers(reconstruction)
    if values is None or values.ndim not in _CELLS or min(values.shape) < _SMALLEST:
        raise ShapeError(
            f"Pilot: reconstruction has shape {np.shape(reconstruction)}, wanted (y, x) or "
            f"(z, y, x), real, {_SMALLEST} samples or more along each axis"
        )
    if not np.isfinite(values).all():
        raise NonFiniteError("Pilot: reconstruction holds NaN or infinity, wanted finite values")
    if not 0 < one_number(spacing) < np.inf:
        raise InputError(f"Pilot: spacing is {spacing!r}, wanted a positive length")
    if not np.ptp(values):
        raise InputError("Pilot: reconstruction is constant, there is nothing to measure")
    if noise is not None and not 0 <= one_number(noise) < np.inf:
        raise InputError(f"Pilot: noise is {noise!r}, wanted a power, zero or more")
    return values


def _clear_shells(
    shell: NDArray[np.intp], power: Floats, floor: float, last: int
) -> tuple[NDArray[np.intp], Floats]:
    """The shells of frequencies up to the first that drowns in noise, and the power of all."""
    counts = np.bincount(shell)
    mean = np.bincount(shell, power) / np.maximum(counts, 1) - floor
    # Frequency zero is the mean, and its neighbours hold what the window spreads of it.
    shells = np.arange(2, last)
    drowned = np.flatnonzero(mean[shells] < _CLEAR * floor)
    clear = shells[: drowned[0] if len(drowned) else None]
    if len(clear) < 2 or not (mean[clear] > 0).all():
        raise InputError(
            "Pilot: the reconstruction's spectrum does not rise above its noise floor; give it "
            "more views, or take a PowerLaw"
        )
    return clear, mean


def _periodogram(values: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Power of all frequencies, (n,), and those, (n, 3); a Hann window hides the border."""
    window = np.ones(())
    for count in values.shape:
        window = window[..., None] * np.hanning(count + 2)[1:-1]
    mean = (values * window).sum() / window.sum()
    power = np.abs(np.fft.fftn((values - mean) * window)) ** 2 / (window**2).sum()
    axes = [np.fft.fftfreq(count, spacing) for count in values.shape]
    mesh = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, values.ndim)
    k = np.zeros((len(mesh), 3))
    k[:, : values.ndim] = mesh[:, ::-1]
    return power.ravel(), k


def _by_direction(whitened: Floats, k: Floats, axes: int) -> tuple[Floats, Floats]:
    """Mean power by direction over that of all, at even directions, smoothed."""
    from scipy.spatial import cKDTree

    cells = directions_for(axes, _CELLS[axes])
    tree = cKDTree(np.concatenate([cells, -cells]))
    near = tree.query(k / np.linalg.norm(k, axis=1, keepdims=True))[1] % len(cells)
    counts = np.bincount(near, minlength=len(cells))
    sums = np.bincount(near, whitened, len(cells))
    # By the square of the sine of the angle between two lines.
    kernel = np.exp(((cells @ cells.T) ** 2 - 1) / (2 * _WIDTH[axes] ** 2))
    angular = np.maximum((kernel @ sums) / (kernel @ counts), 1e-12)
    angular = np.maximum(angular / angular.mean(), _LEAST)
    return cells, angular / angular.mean()
