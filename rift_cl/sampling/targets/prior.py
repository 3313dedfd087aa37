"""What is believed about a target before it is seen: how its power falls with frequency.

A criterion asks how much of a target stays unknown, and that depends on what there is to know.
Every prior gives the same quantity, the power spectrum with its mean over all directions at one
cycle per diameter taken as 1, so that the signal-to-noise ratio of a target has one meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers

Floats = NDArray[np.float64]
# Directions over which power is averaged where it is normalised.
_DIRECTIONS = 400
_STEEPEST = 20.0
_FLAT, _SOLID = 2, 3


class Prior(Protocol):
    """A power spectrum."""

    def power(self, k: Any, diameter: float) -> Floats:
        """Power at frequencies, relative to that at one cycle per diameter.

        Args:
            k: (K, 3) cycles per unit of the world.
            diameter: of the target.

        Returns:
            (K,), zero or more; equal at ``k`` and ``-k``.
        """


@dataclass(frozen=True)
class PowerLaw:
    """Power that falls as ``|k| ** -alpha``, and is level below one cycle per diameter.

    In their plane natural pictures have about 2 and plain shapes with sharp edges 3; in space thin
    shells have 2 and solids with sharp surfaces 4 (Porod's law).

    Args:
        alpha: the exponent, zero or more.

    Raises:
        InputError: it is negative, no number, or over 20.
    """

    alpha: float = 2.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        if not 0 <= one_number(self.alpha) <= _STEEPEST:
            raise InputError(f"PowerLaw: alpha is {self.alpha!r}, wanted 0 to {_STEEPEST:g}")

    def power(self, k: Any, diameter: float) -> Floats:
        """``max(|k| diameter, 1) ** -alpha``."""
        cycles = np.linalg.norm(np.asarray(k, np.float64), axis=-1) * diameter
        return np.asarray(np.maximum(cycles, 1) ** -self.alpha)


@dataclass(frozen=True, init=False, eq=False)
class Spectrum:
    """A power spectrum that is known on a regular grid of frequencies, interpolated linearly.

    Beyond its grid there is no power: what lies there is not asked for.

    Args:
        array: power, (y, x) for a flat target or (z, y, x), with frequency zero at index n // 2 of
            every axis (NumPy's ``fftshift``). Halves that differ are averaged.
        spacing: from one frequency to the next, cycles per unit of the world.

    Raises:
        ShapeError: the array has another number of axes, or an axis is shorter than 2.
        NonFiniteError: it holds NaN or infinity.
        InputError: a power is negative, all are zero, or the spacing is not positive.
    """

    array: Floats
    spacing: float

    def __init__(self, array: ArrayLike, spacing: float) -> None:
        """Check the arguments."""
        values = real_numbers(array)
        if values is None or values.ndim not in (_FLAT, _SOLID) or min(values.shape) < _FLAT:
            shape = np.shape(array) if values is None else values.shape
            raise ShapeError(
                f"Spectrum: array has shape {shape}, wanted real power (y, x) or (z, y, x)"
            )
        if not np.isfinite(values).all():
            raise NonFiniteError("Spectrum: array holds NaN or infinity, wanted finite power")
        if values.min() < 0 or values.max() == 0:
            raise InputError(
                f"Spectrum: power goes from {values.min():g} to {values.max():g}, wanted zero or "
                "more, and some above zero; take the square of amplitudes"
            )
        if not 0 < one_number(spacing) < np.inf:
            raise InputError(f"Spectrum: spacing is {spacing!r}, wanted cycles per unit above 0")
        values.flags.writeable = False
        object.__setattr__(self, "array", values)
        object.__setattr__(self, "spacing", float(spacing))

    def power(self, k: Any, diameter: float) -> Floats:
        """The power at frequencies over its mean at one cycle per diameter.

        Raises:
            InputError: the spectrum is flat and ``k`` is not, or there is no power at one cycle
                per diameter to compare with.
        """
        ring = directions_for(self.array.ndim) / diameter
        usual = float(self._at(ring).mean())
        if not usual > 0:
            raise InputError(
                f"Spectrum: has no power at {1 / diameter:.4g} cycles per unit, one cycle per "
                "diameter; is its spacing in the unit of the target?"
            )
        return self._at(np.asarray(k, np.float64)) / usual

    def _at(self, k: Floats) -> Floats:
        from scipy.ndimage import map_coordinates

        axes = self.array.ndim
        check_flat("Spectrum: array", axes, k)
        middle = np.array(self.array.shape)[:, None] // 2
        steps = k[:, axes - 1 :: -1].T / self.spacing
        both = [
            map_coordinates(self.array, middle + sign * steps, order=1, mode="constant")
            for sign in (1, -1)
        ]
        return np.asarray(both[0] + both[1]) / 2


def check_flat(what: str, axes: int, k: Floats) -> None:
    """Refuse frequencies out of the plane for what is known in the plane alone.

    Raises:
        InputError: there are two axes, and a frequency has kz.
    """
    if axes == _FLAT and np.abs(k[..., 2]).max(initial=0) > 1e-9 * np.abs(k).max(initial=0):
        raise InputError(f"{what} is (y, x), and the target is not flat; give it in 3D")


def directions_for(axes: int, count: int = _DIRECTIONS) -> Floats:
    """Unit vectors (count, 3) evenly over the half-circle of x and y, or over the half-sphere.

    Those of the half-sphere lie on Fibonacci's spiral.
    """
    place = (np.arange(count) + 0.5) / count
    if axes == _FLAT:
        angle, height = np.pi * place, np.zeros(count)
    else:
        angle, height = np.pi * (1 + np.sqrt(5)) * np.arange(count), 1 - place
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


def checked_power(prior: Prior, k: Floats, diameter: float) -> Floats:
    """A prior's power at frequencies (K, 3): (K,), finite, zero or more, and not zero throughout.

    Raises:
        ShapeError: the prior gives another shape.
        NonFiniteError: it gives NaN or infinity.
        InputError: it gives negative power, or none at any of the frequencies.
    """
    given = prior.power(k, diameter)
    power = real_numbers(given)
    if power is None or power.shape != (len(k),):
        raise ShapeError(
            f"prior gives shape {np.shape(given)} for {len(k)} frequencies, wanted ({len(k)},)"
        )
    if not np.isfinite(power).all():
        raise NonFiniteError("prior gives NaN or infinite power, wanted finite numbers")
    if power.min(initial=0) < 0:
        raise InputError(f"prior gives a power of {power.min():g}, wanted zero or more")
    if not power.any():
        raise InputError("prior gives no power at any frequency of the target; is its band right?")
    return power
