"""Attenuation as 8- or 16-bit integers: a window of values, spread evenly over the integers.

An integer q stands for ``low + q (high - low) / (2^bits - 1)``: 0 for the lower end of the window,
the largest integer for the upper. Values in between are rounded to the nearest integer (ties to
the even one), values outside are clipped to the ends and counted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError

Floats = NDArray[np.float32]

# The window that suits a few slices: these percentiles, and a margin beyond them for the others.
_PERCENTILES = (0.1, 99.9)
_MARGIN = 0.1
# A spread below this share of the level is the rounding of a constant.
_CONSTANT = 1e-5
# Samples of a slice that percentiles are taken from, at most.
_SAMPLES = 1 << 18
# Integers of 16 bits that the window which suits a few slices keeps at least, where all values of a
# volume are to have one: a stray value far off does not take them from the others.
_FEWEST_LEVELS = 2048
# Lines converted at a time, so that what lies in between stays in the cache.
_LINES = 32


@dataclass(frozen=True)
class SampleWindow:
    """The values that integers of some width stand for.

    Args:
        dtype: "uint16" or "uint8".
        low: the value that 0 stands for.
        high: the value that the largest integer stands for.

    Raises:
        InputError: the ends are not finite, reversed, or so close that no value lies between.
    """

    dtype: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high - self.low)):
            raise InputError(
                f"the window is {self.low:g} to {self.high:g}, wanted two finite values"
            )
        if not self.low < self.high:
            raise InputError(
                f"the window is {self.low:g} to {self.high:g}: its upper end must lie above the "
                "lower one"
            )
        if not self.low + self.step > self.low:
            raise InputError(
                f"the window is {self.low!r} to {self.high!r}, too narrow for {self.levels + 1} "
                "different values: give a wider one"
            )

    @property
    def levels(self) -> int:
        """The largest integer."""
        return int(np.iinfo(self.dtype).max)

    @property
    def step(self) -> float:
        """How far apart the values of neighbouring integers are."""
        return (self.high - self.low) / self.levels

    @property
    def attributes(self) -> dict[str, Any]:
        """What a reader needs to get values back, under the names of the CF conventions."""
        return {
            "window": [self.low, self.high],
            "scale_factor": self.step,
            "add_offset": self.low,
            "formula": "value = add_offset + scale_factor * sample",
        }

    def integers(self, image: Floats) -> tuple[NDArray[Any], int, int]:
        """The integers of a slice.

        Args:
            image: (y, x).

        Returns:
            The integers, and how many values were clipped at the lower and at the upper end. A
            value counts as clipped where it lies more than half a step outside.

        Raises:
            NonFiniteError: a value is NaN, for which no integer stands.
        """
        stored = np.empty(image.shape, self.dtype)
        below = above = 0
        for start in range(0, len(image), _LINES):
            q = image[start : start + _LINES].astype(np.float64)
            q -= self.low
            q *= self.levels
            q /= self.high - self.low
            np.rint(q, out=q)
            least, most = q.min(), q.max()
            if math.isnan(least):
                raise NonFiniteError(
                    f"{np.count_nonzero(np.isnan(image))} values are NaN, for which no integer "
                    "stands: write float32, or look for their cause in the projections"
                )
            if least < 0 or most > self.levels:
                below += int(np.count_nonzero(q < 0))
                above += int(np.count_nonzero(q > self.levels))
                np.clip(q, 0, self.levels, out=q)
            stored[start : start + _LINES] = q
        return stored, below, above

    def values(self, stored: NDArray[Any]) -> Floats:
        """The values that integers stand for."""
        return restored(stored, self.step, self.low)


def restored(stored: NDArray[Any], scale_factor: float, add_offset: float) -> Floats:
    """Values of the samples of a volume (z, y, x), slice by slice for the sake of memory."""
    if (scale_factor, add_offset) == (1, 0):
        return np.ascontiguousarray(stored, np.float32)
    values = np.empty(stored.shape, np.float32)
    for image, out in zip(stored, values, strict=True):
        out[...] = add_offset + scale_factor * image.astype(np.float64)
    return values


def suggested_window(slices: Iterable[NDArray[Any]]) -> tuple[float, float]:
    """A window for a volume, from a few of its slices.

    The percentiles 0.1 and 99.9 of all of them together, and a tenth of the way between as a
    margin on both sides, because other slices may hold more. If all values are equal the window
    lies about that value.

    Args:
        slices: images (y, x) of any size, such as the first, the middle and the last slice.

    Returns:
        Lower and upper end, rounded outwards by less than a hundredth of the width.

    Raises:
        ShapeError: there is no sample.
        NonFiniteError: a sample is NaN or infinite.
    """
    samples = [_some(np.asarray(image)) for image in slices]
    if not sum(part.size for part in samples):
        raise ShapeError("no slice was given to suggest a window from")
    values = np.concatenate(samples)
    if not np.isfinite(values).all():
        raise NonFiniteError("a window cannot be suggested from slices that hold NaN or infinity")
    low, high = (float(end) for end in np.percentile(values, _PERCENTILES))
    margin = _MARGIN * (high - low)
    if high - low <= _CONSTANT * max(abs(low), abs(high)):
        margin = abs(high) / 2 or 0.5
    unit = 10.0 ** math.floor(math.log10((high - low + 2 * margin) / 100))
    ends = math.floor((low - margin) / unit), math.ceil((high + margin) / unit)
    digits = max(0, -round(math.log10(unit)))
    return round(ends[0] * unit, digits), round(ends[1] * unit, digits)


def whole_window(slices: Iterable[NDArray[Any]], least: float, most: float) -> tuple[float, float]:
    """A window of 16 bits in which no value of a volume is lost, from the least to the greatest.

    Where that would leave the values of most samples fewer than 2048 integers, it reaches as far
    as leaves them so many.

    Args:
        slices: a few of the volume, as for ``suggested_window``.
        least: value of the volume.
        most: the greatest value of the volume.

    Raises:
        ShapeError, NonFiniteError: as for ``suggested_window``.
    """
    low, high = suggested_window(slices)
    further = ((1 << 16) / _FEWEST_LEVELS - 1) / 2 * (high - low)
    ends = max(least, low - further), min(most, high + further)
    return ends if ends[1] - ends[0] > _CONSTANT * max(map(abs, ends)) else (low, high)


def _some(image: NDArray[Any]) -> NDArray[np.float64]:
    """Samples at even steps through an image."""
    flat = image.reshape(-1)
    return flat[:: -(-flat.size // _SAMPLES) or 1].astype(np.float64)
