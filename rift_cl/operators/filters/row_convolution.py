"""Convolution of detector rows in real space: the quickest way for short rows and one filter."""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device

# Bins up to which a row is convolved; beyond, transforms are quicker. Measured with 3072 rows on
# two cores of a CPU: 2.5 against 3.7 ms at 256 bins, 8.0 and 7.4 at 384, 44 and 12 at 768, 215 and
# 50 at 2048.
SHORT_ROW = 384


class RowConvolution:
    """Convolves all rows with the same symmetric taps.

    Args:
        device: where the rows are.
        taps: (1, bins) half of the kernel, from its middle on.
        dtype: of the rows.
    """

    def __init__(
        self, device: Device, taps: NDArray[np.float64], dtype: DTypeLike = np.float32
    ) -> None:
        self.device = device
        cpu = device.traits.is_cpu
        self._blocks, self._run = (2, 4) if cpu else (1, 1)
        self._segment = device.traits.macros["LANES"] * self._blocks
        whole = np.concatenate([taps[0, :0:-1], taps[0]])
        self._taps = device.array(np.pad(whole, (0, self._segment)), dtype)
        self._double = int(np.dtype(dtype) == np.float64)

    @property
    def scratch(self) -> int:
        """Bytes of the device besides the rows."""
        return int(self._taps.nbytes)

    @property
    def largest_array(self) -> int:
        """Bytes of the largest array on the device besides the rows."""
        return self.scratch

    def __call__(self, x: DeviceArray, out: DeviceArray, gains: DeviceArray, per_view: int) -> None:
        """Fill ``out`` with the filtered rows.

        Args:
            x: (..., bins) device array of rows, those of a view side by side.
            out: where to put the result, of the same shape.
            gains: (views,) device array of factors.
            per_view: rows of a view.
        """
        bins = x.shape[-1]
        rows = x.size // bins
        self.device.launch(
            "filter_views",
            (-(-bins // self._segment), -(-rows // self._run)),
            sinogram=x,
            filtered=out,
            taps=self._taps,
            gains=gains,
            rows=rows,
            rows_per_view=per_view,
            bins=bins,
            BLOCKS=self._blocks,
            ROWS=self._run,
            DOUBLE=self._double,
        )
