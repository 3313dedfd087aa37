"""Convolution of detector rows through the Fourier domain, without wrap-around.

In real space a row of n bins costs n^2 multiplications; here it costs some n log n. Rows are
continued by zeros to twice their length, so that nothing meets itself, and multiplied by the
spectrum of the very taps that would be convolved with, so that the result is the same to the
rounding of the arithmetic. Every row is transformed on its own (two bins make a complex sample,
kernels/tomo/rows_weigh_gpu.cl): what stands beside it does not change a bit of it.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.operators.fourier.block_transform import BlockTransform
from rift_cl.operators.fourier.column_transform import ColumnTransform, turns

Floats = NDArray[np.float64]

# Bytes of a slab of rows with its copy, on a GPU.
_SLAB_BYTES = {"gpu": 64 << 20}


def transform_length(bins: int) -> int:
    """Complex samples of a row: the least product of twos and threes that holds all bins."""
    threes = [int(3**power) for power in range(bins.bit_length() + 1)]
    return min(three << (-(-bins // three) - 1).bit_length() for three in threes)


class RowTransform:
    """Convolves rows with symmetric taps.

    Args:
        device: where the rows are.
        taps: (filters, bins) halves of kernels, from the middle on; one for all rows, or one for
            each view.
        rows: how many there are at most at a time.
        dtype: of the rows.
    """

    def __init__(
        self, device: Device, taps: Floats, rows: int, dtype: DTypeLike = np.float32
    ) -> None:
        self.device, self.dtype = device, np.dtype(dtype)
        self._double = int(self.dtype == np.float64)
        self._taps = taps
        self.bins = taps.shape[1]
        self.length = transform_length(self.bins)
        half_turns = turns(2 * self.length, self.length // 2 + 1)
        self._half_turns = device.array(half_turns, dtype)
        self._blocks: BlockTransform | None = None
        if device.traits.is_cpu:
            self._blocks = BlockTransform(device, self.length, dtype)
            return
        self._transform = ColumnTransform(device, self.length, dtype)
        each = 2 * self.dtype.itemsize * self.length
        fitting = min(_SLAB_BYTES["gpu"] // 2, device.traits.allocation) // each
        self._columns = max(1, min(rows, fitting))

    @cached_property
    def _weights(self) -> tuple[DeviceArray, DeviceArray]:
        sums, differences = _weights(self._taps, self.length)
        return self.device.array(sums, self.dtype), self.device.array(differences, self.dtype)

    @property
    def _response(self) -> int:
        """Bytes of one of the two tables of weights."""
        return self.dtype.itemsize * (self.length // 2 + 1) * len(self._taps)

    @property
    def largest_array(self) -> int:
        """Bytes of the largest array on the device besides the rows."""
        slab = 0 if self._blocks is not None else 2 * self.length * self._columns
        return max(self._response, self.dtype.itemsize * slab)

    @property
    def scratch(self) -> int:
        """Bytes of the device besides the rows: blocks or a slab, with copies, and responses."""
        responses = 2 * self._response
        if self._blocks is not None:
            return responses + self._blocks.nbytes
        return responses + 4 * self.dtype.itemsize * self.length * self._columns

    def __call__(self, x: DeviceArray, out: DeviceArray, gains: DeviceArray, per_view: int) -> None:
        """Fill ``out`` with the filtered rows.

        Args:
            x: (..., bins) device array of rows, those of a view side by side.
            out: where to put the result, of the same shape.
            gains: (views,) device array of factors.
            per_view: rows of a view.
        """
        rows, filters = x.size // self.bins, len(self._taps)
        if self._blocks is not None:
            self._blocks.launch(
                "rows_filter_cpu",
                rows,
                rows=x,
                out=out,
                gains=gains,
                sums=self._weights[0],
                differences=self._weights[1],
                half_turns=self._half_turns,
                count=rows,
                rows_per_view=per_view,
                filters=filters,
                bins=self.bins,
                SHARED=int(filters == 1),
            )
            return
        columns = min(self._columns, rows)
        planes = self.device.empty((2, self.length, columns), self.dtype)
        spare = self.device.empty(planes.shape, self.dtype)
        for first in range(0, rows, columns):
            slab = _Slab(first, min(columns, rows - first), columns)
            self._pack(x, planes, slab)
            planes, spare = self._transform(planes, spare, columns)
            self._weigh(planes, slab, per_view)
            planes, spare = self._transform(planes, spare, columns, inverse=True)
            self._unpack(planes, out, gains, slab, per_view)

    def _pack(self, x: DeviceArray, planes: DeviceArray, slab: _Slab) -> None:
        self.device.launch(
            "rows_pack_gpu",
            (2 * self.length, slab.columns),
            rows=x,
            planes=planes,
            first=slab.first,
            count=slab.rows,
            bins=self.bins,
            length=self.length,
            columns=slab.columns,
            DOUBLE=self._double,
        )

    def _weigh(self, planes: DeviceArray, slab: _Slab, per_view: int) -> None:
        filters = len(self._taps)
        self.device.launch(
            "rows_weigh_gpu",
            (slab.columns, self.length // 2 + 1),
            planes=planes,
            sums=self._weights[0],
            differences=self._weights[1],
            half_turns=self._half_turns,
            first=slab.first,
            rows_per_filter=per_view,
            filters=filters,
            length=self.length,
            columns=slab.columns,
            SHARED=int(filters == 1),
            DOUBLE=self._double,
        )

    def _unpack(
        self, planes: DeviceArray, out: DeviceArray, gains: DeviceArray, slab: _Slab, per_view: int
    ) -> None:
        self.device.launch(
            "rows_unpack_gpu",
            (self.bins, slab.columns),
            planes=planes,
            rows=out,
            gains=gains,
            first=slab.first,
            count=slab.rows,
            rows_per_view=per_view,
            bins=self.bins,
            length=self.length,
            columns=slab.columns,
            DOUBLE=self._double,
        )


class _Slab(NamedTuple):
    """Rows that are worked on together: so many from ``first``, in so many columns."""

    first: int
    rows: int
    columns: int


def _weights(taps: Floats, length: int) -> tuple[Floats, Floats]:
    """Half the sums and half the differences of R[k] and R[length - k], (k, filters).

    R is the spectrum of the taps over the transform's length, which both passes leave out.
    """
    shape = (length // 2 + 1, len(taps))
    sums, differences = np.empty(shape), np.empty(shape)
    for filter, half in enumerate(taps):
        kernel = np.zeros(2 * length)
        kernel[: half.size] = half
        kernel[2 * length - half.size + 1 :] = half[:0:-1]
        response = np.fft.rfft(kernel).real / length
        sums[:, filter] = (response + response[::-1])[: shape[0]] / 2
        differences[:, filter] = (response - response[::-1])[: shape[0]] / 2
    return sums, differences
