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
        gradient = self.device.get(sum_columns(self.device, parts)).astype(float)
        step = self._adam.step(number, gradient.reshape(2, _COLORS), rate)
        self.values[number] -= step
        self.values -= self.values.mean(axis=0) - [[1.0] * _COLORS, [0.0] * _COLORS]
        return by_image

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
