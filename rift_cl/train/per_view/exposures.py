"""A gain and an offset for each photograph and colour, fitted along with the splats.

Photographs of one scene are rarely exposed alike. What is drawn, x, is compared as g x + o with the
photograph; g and o belong to the view and are forgotten afterwards. All gains could share a common
factor with the splats, so their mean stays one and that of the offsets zero.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import sum_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.train.per_view.host_adam import HostAdam

_COLORS = 3
# Variance of a colour, in squares of a code of 16 bits or so, above which it tells a gain.
_TELLS = 2.0**-32

Arrays = Mapping[str, NDArray[np.float64]]


class Exposures:
    """Exposures of V views.

    Args:
        device: where images are.
        views: V.
    """

    def __init__(self, device: Device, views: int) -> None:
        self.device = device
        self.values = np.zeros((views, 2, _COLORS))
        self.values[:, 0] = 1
        self._adam = HostAdam(self.values.shape)

    def applied(self, image: DeviceArray, number: int) -> DeviceArray:
        """The (height, width, 3) image as view ``number`` would have exposed it; a new array."""
        exposed, size = self.device.empty(image.shape), image.size // _COLORS
        gain, offset = self._row(number)
        self.device.launch(
            "expose", (size,), image=image, exposed=exposed, gain=gain, offset=offset, pixels=size
        )
        return exposed

    def pulled_back(
        self, image: DeviceArray, by_exposed: DeviceArray, number: int, rate: float
    ) -> DeviceArray:
        """The gradient by the image, of that by the exposed one; takes a step with the exposure."""
        by_image, parts = self._gradients(image, by_exposed, number)
        gradient = self.device.get(sum_columns(self.device, parts)).astype(float)
        step = self._adam.step(number, gradient.reshape(2, _COLORS), rate)
        self.values[number] -= step
        self.values -= self.values.mean(axis=0) - [[1.0] * _COLORS, [0.0] * _COLORS]
        return by_image

    def gradient(self, image: DeviceArray, by_exposed: DeviceArray, number: int) -> DeviceArray:
        """The gradient by the image, of that by the exposed one; the exposure stays."""
        return self._gradients(image, by_exposed, number)[0]

    def _gradients(
        self, image: DeviceArray, by_exposed: DeviceArray, number: int
    ) -> tuple[DeviceArray, DeviceArray]:
        """By the image, and what each pixel adds to that by gains and offsets, (pixels, 6)."""
        by_image, size = self.device.empty(image.shape), image.size // _COLORS
        parts = self.device.empty((size, 2 * _COLORS))
        self.device.launch(
            "expose_grad",
            (size,),
            image=image,
            by_exposed=by_exposed,
            by_image=by_image,
            parts=parts,
            gain=self._row(number)[0],
            pixels=size,
        )
        return by_image, parts

    def _row(self, number: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        # OpenCL's three-vectors are four floats wide.
        gain, offset = np.zeros((2, 4), np.float32)
        gain[:_COLORS], offset[:_COLORS] = self.values[number]
        return gain, offset

    def state(self) -> dict[str, NDArray[np.float64]]:
        """What a checkpoint keeps."""
        return {"values": self.values.copy(), **self._adam.state()}

    def restore(self, state: Arrays) -> None:
        """Go on from a checkpoint."""
        self.values = np.array(state["values"])
        self._adam.restore(state)


def fitted_exposure(
    image: NDArray[np.float32],
    target: NDArray[np.float32],
    counted: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Gain and offset of each colour that bring an image next to a photograph, by least squares.

    Args:
        image: (height, width, 3) as it is drawn.
        target: (height, width, 3) photograph.
        counted: (height, width) the pixels that count; None for all.

    Returns:
        (2, 3) gains, none of them below zero, and offsets. The gain is one where the image tells
        none, being of one colour.
    """
    drawn, wanted = (
        (array.reshape(-1, _COLORS) if counted is None else array[counted]).astype(np.float64)
        for array in (image, target)
    )
    if not len(drawn):
        return np.array([[1.0] * _COLORS, [0.0] * _COLORS])
    middle, away = drawn.mean(axis=0), drawn - drawn.mean(axis=0)
    square, product = np.sum(away**2, axis=0), np.sum(away * wanted, axis=0)
    told = square > _TELLS * len(drawn)
    gain = np.where(told, np.maximum(product, 0) / np.where(told, square, 1), 1.0)
    return np.stack([gain, wanted.mean(axis=0) - gain * middle])
