"""Fourier transforms that a CPU makes inside of other kernels, a few columns at a time.

A core of a CPU waits for memory in a transform that goes over whole planes pass by pass. Here a
kernel fills a block of columns, transforms it (kernels/include/fourier/fft_block.h), makes
something of it and empties it, all in its caches. GPUs take ``ColumnTransform``.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.operators.fourier.column_transform import turns

# Columns of a block: a line of the cache. Items for each unit, so that none waits long for the
# last, and the part of the memory that their blocks may take together: no result depends on either.
BLOCK = 16
_ITEMS_PER_UNIT, _SHARE = 4, 8


class BlockTransform:
    """Transforms of one length, in kernels that include ``fft_block.h``.

    Args:
        device: a CPU.
        length: a product of twos and threes.
        dtype: of what is transformed.
    """

    def __init__(self, device: Device, length: int, dtype: DTypeLike = np.float32) -> None:
        self.device, self.length, self._dtype = device, length, np.dtype(dtype)
        room = min(device.traits.allocation, device.budget // _SHARE)
        fitting = room // (4 * length * BLOCK * self._dtype.itemsize)
        self._items = max(1, min(_ITEMS_PER_UNIT * device.traits.compute_units, fitting))

    @cached_property
    def _turns(self) -> DeviceArray:
        return self.device.array(turns(self.length, self.length), self._dtype)

    @cached_property
    def _scratch(self) -> DeviceArray:
        return self.device.empty((self._items, 2, 2, self.length, BLOCK), self._dtype)

    @property
    def nbytes(self) -> int:
        """Bytes that are kept on the device: two blocks of every item, and the table of turns."""
        return self._dtype.itemsize * self.length * (4 * BLOCK * self._items + 2)

    def launch(self, kernel: str, columns: int, /, **given: Any) -> None:
        """Enqueue a kernel for so many columns, with what transforms need besides."""
        blocks = -(-columns // BLOCK)
        items = min(self._items, blocks)
        self.device.launch(
            kernel,
            (items,),
            **given,
            scratch=self._scratch,
            turns=self._turns,
            length=self.length,
            blocks=blocks,
            items=items,
            BLOCK=BLOCK,
            DOUBLE=int(self._dtype == np.float64),
        )
