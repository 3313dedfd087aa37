"""Training views from arrays in memory: cameras and their images."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_plain, as_real_array, check_finite
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera


class ImageViews:
    """Training views of images that all fit into the device's memory.

    Args:
        device: where the images are sent.
        cameras: V cameras.
        images: V images (height, width, 3), values from 0 to 1; codes, such as 0 to 255, have to be
            divided by the largest before. Highlights of linear light may be above 1.
        weights: V arrays (height, width), from 0 to 1: how much each pixel counts in the loss. All
            pixels count alike if not given.
        background: colour behind the splats.

    Raises:
        ShapeError: there are no cameras or not as many images or weights, an image does not have
            its camera's size, or the background not its channels.
        DTypeError: an image or a weight does not hold real numbers.
        NonFiniteError: it holds NaN or infinity.
        InputError: an image is of whole numbers above 1, or most of it is above 1; or a weight is
            below 0 or above 1.
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
            name = f"ImageViews: image {len(self._targets)}"
            self._targets.append(device.array(_checked_image(image, wanted, name)))
        for camera, weight in zip(cameras, weights or (), strict=bool(weights)):
            name = f"ImageViews: weight {len(self._weights)}"
            self._weights.append(device.array(_checked_weight(weight, camera.size, name)))

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


def _checked(values: ArrayLike, wanted: tuple[int, ...], name: str) -> NDArray[Any]:
    array = as_real_array(values, name=name)
    if array.shape != wanted:
        raise ShapeError(f"{name} has shape {array.shape}, wanted {wanted}")
    plain = as_plain(array, np.float32)
    check_finite(plain, name=name)
    return plain


def _checked_image(values: ArrayLike, wanted: tuple[int, ...], name: str) -> NDArray[Any]:
    image = _checked(values, wanted, name)
    most = float(image.max(initial=0))
    # Linear light has highlights above 1; codes are whole numbers, or mostly above 1 once blended.
    if most > 1 and (np.mean(image > 1) > 0.5 or np.array_equal(image, np.rint(image))):
        raise InputError(f"{name} has values up to {most:g}, wanted 0 to 1: {_divide(most)}")
    return image


def _checked_weight(values: ArrayLike, wanted: tuple[int, ...], name: str) -> NDArray[Any]:
    weight = _checked(values, wanted, name)
    least, most = float(weight.min(initial=0)), float(weight.max(initial=0))
    if least < 0:
        raise InputError(f"{name} has values down to {least:g}, wanted 0 to 1")
    if most > 1:
        raise InputError(f"{name} has values up to {most:g}, wanted 0 to 1: {_divide(most)}")
    return weight


def _divide(most: float) -> str:
    return f"divide by {255 if most <= 255 else 65535 if most <= 65535 else 'the largest'}"
