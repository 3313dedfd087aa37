"""Fourier transforms down the columns of complex planes, on the device.

Columns stand side by side, so that every device goes through them in step; lengths are products of
twos and threes (kernels/fourier/fft_pass.cl). Images are transformed by two of these and a
transpose, detector rows by one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device

# Columns that one work-item of a CPU goes through.
_CPU_RUN = 4096


class ColumnTransform:
    """Transforms of one length, down the columns of planes.

    Args:
        device: where the planes are.
        length: a product of twos and threes.
        dtype: of the planes.
    """

    def __init__(self, device: Device, length: int, dtype: DTypeLike = np.float32) -> None:
        self.device, self.length = device, length
        self._turns = device.array(turns(length, length), dtype)
        self._double = int(np.dtype(dtype) == np.float64)

    @property
    def nbytes(self) -> int:
        """Bytes that are kept on the device."""
        return int(self._turns.nbytes)

    def __call__(
        self,
        planes: DeviceArray,
        spare: DeviceArray,
        columns: int | None = None,
        *,
        weights: DeviceArray | None = None,
        inverse: bool = False,
    ) -> tuple[DeviceArray, DeviceArray]:
        """Transform fields, without a factor.

        Args:
            planes: (2 fields, length, columns) device array: the real parts, then the imaginary
                ones.
            spare: another of as many numbers.
            columns: a multiple of the device's lanes; what the shape of the planes says if not
                given.
            weights: (length, columns) device array; if given, it is the inverse transform of the
                weighted fields.
            inverse: whether exp(+2 pi i ...) is meant.

        Returns:
            What was transformed, and the buffer that is free now; both are written to.
        """
        device, length, stride = self.device, self.length, 1
        columns = planes.shape[-1] if columns is None else columns
        run = _CPU_RUN if device.traits.is_cpu else 1
        fields = planes.size // (2 * length * columns)
        # Where the real and the imaginary parts begin; to change places is to conjugate.
        re, im = 0, fields * length * columns
        if inverse or weights is not None:
            re, im = im, re
        while stride < length:
            left = length // stride
            radix = next(radix for radix in (9, 8, 4, 3, 2) if left % radix == 0)
            weighted = weights is not None and stride == 1
            size = (-(-columns // run), length // radix, fields)
            device.launch(
                "fft_pass",
                size,
                source=planes,
                out=spare,
                turns=self._turns,
                weights=weights if weighted else planes,
                re=re,
                im=im,
                columns=columns,
                length=length,
                stride=stride,
                RADIX=radix,
                RUN=run,
                WEIGHTED=weighted,
                DOUBLE=self._double,
            )
            planes, spare, stride = spare, planes, stride * radix
        return planes, spare


def turns(length: int, count: int) -> NDArray[np.float64]:
    """exp(-2 pi i k / length) as pairs, k from 0 to count - 1."""
    values = np.exp(-2j * np.pi * np.arange(count) / length)
    return np.stack([values.real, values.imag], axis=1)
