"""What is known of a volume before its first slice: shape, lengths, and how samples are stored."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry.length_units import length_unit
from rift_cl.io.volumes.sample_window import SampleWindow

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class VolumeLayout:
    """What is known of a volume before its first slice.

    Args:
        shape: (z, y, x).
        spacing: distance between samples along each axis.
        unit: unit of the spacing, empty where it is not known.
        origin: position of the first sample along each axis, in the same unit.
        window: what the samples stand for where they are integers; None for float32.
    """

    shape: tuple[int, int, int]
    spacing: tuple[float, float, float]
    unit: str
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    window: SampleWindow | None = None

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples in the file, little-endian."""
        return np.dtype("float32" if self.window is None else self.window.dtype).newbyteorder("<")

    @property
    def size(self) -> int:
        """Bytes of the samples."""
        return self.dtype.itemsize * math.prod(self.shape)

    @property
    def attributes(self) -> dict[str, Any]:
        """The description that goes into the file."""
        return {
            "axes": ["z", "y", "x"],
            "spacing": list(self.spacing),
            "origin": list(self.origin),
            "unit": self.unit,
            "value_unit": self.value_unit,
            **({} if self.window is None else self.window.attributes),
        }

    @property
    def value_unit(self) -> str:
        """Unit of attenuation: one over the unit of length."""
        return f"1/{self.unit}" if self.unit else ""

    @property
    def unit_name(self) -> str | None:
        """The unit's name in UDUNITS, such as "millimeter"; None where it is no length."""
        length = length_unit(self.unit)
        return None if length is None else length[0]

    def lengths(self, metres: float) -> tuple[float, float, float] | None:
        """The spacing in a unit of so many metres; None where the unit is no length."""
        length = length_unit(self.unit)
        if length is None:
            return None
        z, y, x = (length[1] * step / metres for step in self.spacing)
        return z, y, x


class SliceStatistics:
    """Least, greatest, mean and spread of a volume's samples, whatever the order of its slices.

    Kept slice by slice, so that neither the size of slabs nor a slice that is written twice
    changes a bit.

    Args:
        slices: how many.
        moments: whether mean and spread are wanted, which cost more than the range.
    """

    def __init__(self, slices: int, *, moments: bool = False) -> None:
        self._with_moments = moments
        self._low, self._high = np.full((2, slices), np.nan)
        self._sums, self._squares = np.zeros((2, slices))
        self._samples = 0

    def take(self, start: int, slab: NDArray[Any]) -> None:
        """Look at slices ``start``, ``start + 1``, ..."""
        for index, image in enumerate(slab, start):
            self._samples = image.size
            self._low[index], self._high[index] = image.min(), image.max()
            if math.isnan(self._low[index]):
                self._low[index] = np.fmin.reduce(image, None)
                self._high[index] = np.fmax.reduce(image, None)
            if self._with_moments:
                self._sums[index] = image.sum(dtype=np.float64)
                self._squares[index] = np.square(image, dtype=np.float64).sum()

    @property
    def range(self) -> tuple[float, float]:
        """Least and greatest sample; NaN is passed over."""
        return float(np.fmin.reduce(self._low)), float(np.fmax.reduce(self._high))

    @property
    def mean(self) -> float:
        """Mean of all samples."""
        return float(self._sums.sum() / (self._samples * self._sums.size))

    @property
    def deviation(self) -> float:
        """Root mean square deviation from the mean."""
        square = float(self._squares.sum() / (self._samples * self._sums.size))
        return math.sqrt(max(0.0, square - self.mean**2))
