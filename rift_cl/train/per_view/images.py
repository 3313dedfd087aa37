"""Training views from arrays in memory: cameras and their images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.errors import ShapeError
from rift_cl.geometry import Camera


class ImageViews:
    """Training views of images that all fit into the device's memory.

    Args:
        device: where the images are sent.
        cameras: V cameras.
        images: V images (height, width, 3), values from 0 to 1.
        weights: V arrays (height, width), from 0 to 1: how much each pixel counts in the loss. All
            pixels count alike if not given.
        background: colour behind the splats.

    Raises:
        ShapeError: there are no cameras or not as many images or weights, an image does not have
            its camera's size, or the background not its channels.
    """

    def __init__(
        self,
        device: Device,
        cameras: Sequence[Camera],
        images: Sequence[ArrayLike],
        *,
        weights: Sequence[ArrayLike] | None = None,
        background: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        counts = {len(cameras), len(images)} | (set() if weights is None else {len(weights)})
        if counts != {len(cameras)} or not len(cameras):
            raise ShapeError(
                f"ImageViews: there are {len(cameras)} cameras and {len(images)} images, wanted as "
                "many of each, 1 or more, and as many weights if there are some"
            )
        self.cameras = cameras
        self._background = device.array(np.asarray(background, np.float32))
        self._targets, self._weights = list[DeviceArray](), list[DeviceArray]()
        for camera, image in zip(cameras, images, strict=True):
            wanted = (*camera.size, *self._background.shape)
            self._targets.append(_sent(device, image, wanted, "an image"))
        for camera, weight in zip(cameras, weights or (), strict=bool(weights)):
            self._weights.append(_sent(device, weight, camera.size, "a weight"))

    def begin(self, step: int) -> None:
        """Nothing changes from step to step; see ``TrainingViews``."""

    def target(self, number: int) -> DeviceArray:
        """The image of a view; see ``TrainingViews``."""
        return self._targets[number]

    def weights(self, number: int) -> DeviceArray | None:
        """The weights of its pixels, if there are some; see ``TrainingViews``."""
        return self._weights[number] if self._weights else None

    def background(self, number: int) -> DeviceArray:
        """The same for all views; see ``TrainingViews``."""
        return self._background


def _sent(device: Device, values: ArrayLike, wanted: tuple[int, ...], what: str) -> DeviceArray:
    array = np.asarray(values, np.float32)
    if array.shape != wanted:
        raise ShapeError(f"ImageViews: {what} has shape {array.shape}, wanted {wanted}")
    return device.array(array)
