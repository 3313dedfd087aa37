"""A response in the Fourier domain of images, applied on the device.

The image is continued by zeros, so that it does not meet itself across its borders, to edges that
are products of twos and threes; two channels share one complex transform, since the response is
real and even. The operator, window times response times window, is its own adjoint.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import sum_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_device_array
from rift_cl.errors import NonFiniteError, ShapeError
from rift_cl.operators.fourier.column_transform import ColumnTransform

Floats = NDArray[np.float64]
Response = Callable[[Floats, Floats], Floats]

# Zeros beyond an edge, as a share of it, and the shortest transform.
_MARGIN, _SHORTEST = 16, 8
# Columns that one work-item of a CPU goes through.
_CPU_RUN = 4096


def padded_length(length: int) -> int:
    """What an edge is continued to: a product of twos and threes, and a multiple of eight."""
    least = max(_SHORTEST, length + length // _MARGIN)
    threes = [3**k for k in range(least.bit_length())]
    return min(int(three) * max(_SHORTEST, _power_above(-(-least // three))) for three in threes)


def _power_above(number: int) -> int:
    """The least power of two that is not below a number."""
    return 1 << (number - 1).bit_length()


class SpectralFilter:
    """Multiplies the spectra of images of one size by a response.

    Args:
        device: where the images are.
        size: (height, width) of the images.
        response: of frequencies along y and along x, in cycles per pixel from -0.5 to 0.5, given
            as arrays that broadcast; real, and even: it must not change when both change sign.

    Raises:
        ShapeError: an image of that size holds nothing.
        NonFiniteError: the response is not finite.
    """

    def __init__(self, device: Device, size: tuple[int, int], response: Response) -> None:
        if min(size) < 1:
            raise ShapeError(f"SpectralFilter: size is {size}, wanted one pixel or more")
        self.device = device
        self.size = size
        self.padded = rows, columns = padded_length(size[0]), padded_length(size[1])
        self._weights = self._sampled(response)
        self._transforms = {n: ColumnTransform(device, n) for n in {rows, columns}}

    def with_response(self, response: Response) -> SpectralFilter:
        """Another response for images of the same size; the transforms are shared.

        Raises:
            NonFiniteError: the response is not finite.
        """
        other = copy(self)
        other._weights = other._sampled(response)
        return other

    def __call__(
        self,
        image: DeviceArray,
        *,
        channels: int | None = None,
        mask: DeviceArray | None = None,
        keep_norm: bool = False,
    ) -> DeviceArray:
        """The filtered image, a new (height, width, D) device array.

        Args:
            image: (height, width, D) device array.
            channels: of these, the first that count; all if not given. The rest becomes zero.
            mask: (height, width) device array that the result is multiplied by, if given.
            keep_norm: scale the result to the root mean square that the image had.

        Raises:
            ShapeError: the image has another size.
        """
        shape = (*self.size, image.shape[2] if len(image.shape) == 3 else 1)
        as_device_array(self.device, image, shape, name="image")
        count = shape[2] if channels is None else channels
        if mask is not None:
            as_device_array(self.device, mask, self.size, name="mask")
        fields = self._weighted(image, count)
        return self._unpacked(*fields, mask, shape, count, keep_norm=keep_norm)

    def _sampled(self, response: Response) -> DeviceArray:
        """The response at the transform's frequencies, transposed as the spectrum then stands."""
        along_y, along_x = (np.asarray(np.fft.fftfreq(n), np.float64) for n in self.padded)
        weights = np.broadcast_to(response(along_y[None, :], along_x[:, None]), self.padded[::-1])
        if not np.isfinite(weights).all():
            raise NonFiniteError("SpectralFilter: the response is not finite everywhere")
        return self.device.array(np.ascontiguousarray(weights, np.float32))

    def _weighted(self, image: DeviceArray, count: int) -> tuple[DeviceArray, DeviceArray]:
        """The filtered fields in space, and the sums of squares of the image's rows."""
        device, (rows, columns) = self.device, self.padded
        fields = device.empty((2 * -(-count // 2), rows, columns))
        spare = device.empty(fields.shape)
        squares = device.empty((self.size[0], 1))
        device.launch(
            "fft_pack",
            (rows,),
            image=image,
            fields=fields,
            squares=squares,
            height=self.size[0],
            width=self.size[1],
            depth=image.shape[2],
            rows=rows,
            columns=columns,
            CHANNELS=count,
        )
        down, along = self._transforms[rows], self._transforms[columns]
        fields, spare = down(fields, spare, columns)
        self._transpose(fields, spare, rows, columns)
        fields, spare = along(spare, fields, rows)
        fields, spare = along(fields, spare, rows, weights=self._weights)
        self._transpose(fields, spare, columns, rows)
        return down(spare, fields, columns, inverse=True)[0], squares

    def _unpacked(
        self,
        fields: DeviceArray,
        squares: DeviceArray,
        mask: DeviceArray | None,
        shape: tuple[int, ...],
        count: int,
        *,
        keep_norm: bool,
    ) -> DeviceArray:
        device, (height, width, depth), (rows, columns) = self.device, shape, self.padded
        out, found = device.empty(shape), device.empty((height, 1))
        device.launch(
            "fft_unpack",
            (height,),
            fields=fields,
            mask=fields if mask is None else mask,
            image=out,
            squares=found,
            height=height,
            width=width,
            depth=depth,
            rows=rows,
            columns=columns,
            scale=1 / (rows * columns),
            CHANNELS=count,
            MASKED=mask is not None,
        )
        if keep_norm:
            run = _CPU_RUN if device.traits.is_cpu else 1
            device.launch(
                "keep_norm",
                (-(-out.size // run),),
                x=out,
                wanted=sum_columns(device, squares),
                found=sum_columns(device, found),
                size=out.size,
                RUN=run,
            )
        return out

    def _transpose(self, fields: DeviceArray, spare: DeviceArray, rows: int, columns: int) -> None:
        lanes = self.device.traits.macros["LANES"]
        blocks = (columns // lanes, rows // lanes, fields.shape[0])
        self.device.launch(
            "fft_transpose", blocks, source=fields, out=spare, rows=rows, columns=columns
        )
