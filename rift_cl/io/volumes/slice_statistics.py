"""The range and the moments of a volume's samples, which headers hold and displays begin with."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.io.volumes.layout import WriteSlab


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

    def watching(self, write: WriteSlab) -> WriteSlab:
        """A function that writes slices, and looks at them."""

        def write_and_look(start: int, slab: NDArray[Any]) -> None:
            write(start, slab)
            self.take(start, slab)

        return write_and_look

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
