"""Images of a fit that are halved at first: the level, and when it is left.

With P the mean square of what the last halving left out, measured on some training views before the
first step, and r the running mean square of the residual on the halved images, the level is left as
soon as r < P. ``rift_cl.train.octave_settings`` says why.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.errors import CheckpointError
from rift_cl.geometry import Camera
from rift_cl.train.loss.image_loss import ImageLoss
from rift_cl.train.octave_settings import OctaveSettings

if TYPE_CHECKING:
    from rift_cl.train.trainer import TrainingViews

# Steps between two looks at the residual, share of the old value in the running mean, and how many
# looks there must be: a single view may be an easy one.
_EVERY, _MEMORY, _FEWEST = 5, 0.8, 5
# Training views that the powers of octaves are measured on.
_VIEWS = 12

Sized = tuple[DeviceArray, DeviceArray | None]


class Octaves:
    """How often the images of a fit are halved now.

    Args:
        device: where images are.
        pictures: the training views.
        settings: with a number of halvings.
        steps: of the run.
    """

    def __init__(
        self, device: Device, pictures: TrainingViews, settings: OctaveSettings, steps: int
    ) -> None:
        self._device, self._settings, self._steps = device, settings, steps
        self.level = settings.count or 0
        self.powers = octave_powers(device, pictures, self.level)
        # Of the last level first.
        self.ended = np.full(self.level, -1)
        self._mean_square, self._looks = float("inf"), 0
        self._squares = ImageLoss(ssim_weight=0.0, kind="l2")

    def camera(self, camera: Camera) -> Camera:
        """A camera for an image as large as they are now."""
        return camera.shrunk(2**self.level) if self.level else camera

    def sized(self, target: DeviceArray, weights: DeviceArray | None) -> Sized:
        """A training image and its weights, as large as they are now."""
        return shrunk(self._device, target, weights, 2**self.level)

    def after_step(
        self, step: int, image: DeviceArray, target: DeviceArray, weights: DeviceArray | None
    ) -> None:
        """Take note of the residual of a step, and leave the level when it is time.

        Args:
            step: how many were taken.
            image: as it is compared, (height, width, D).
            target: (height, width, C) as large.
            weights: of the pixels; None where all are 1.
        """
        if not self.level:
            return
        if step % _EVERY == 0:
            found = self._squares(self._device, image, target, weights=weights)[0]
            square, known = float(self._device.get(found)[0]), self._looks > 0
            mean = _MEMORY * self._mean_square + (1 - _MEMORY) * square if known else square
            self._mean_square, self._looks = mean, self._looks + 1
        enough = self._looks >= _FEWEST and self._mean_square < self.powers[self.level - 1]
        if enough or step >= self._settings.latest(self.level, self._steps):
            self.level -= 1
            self.ended[self.level] = step
            self._mean_square, self._looks = float("inf"), 0

    def facts(self) -> dict[str, Any]:
        """What happened, for a report: JSON."""
        return {
            "halvings": len(self.ended),
            "left_out": self.powers.tolist(),
            "ended": self.ended.tolist(),
        }

    def state(self) -> dict[str, NDArray[Any]]:
        """What a checkpoint keeps."""
        return {
            "level": np.array(self.level),
            "ended": self.ended.copy(),
            "mean_square": np.array(self._mean_square),
            "looks": np.array(self._looks),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from a checkpoint.

        Raises:
            CheckpointError: it is of a run with other octaves.
        """
        level, ended = int(state["level"]), state["ended"]
        if ended.shape != self.ended.shape or level > len(ended):
            raise CheckpointError("the checkpoint is of another run: it has other octaves")
        self.level, self.ended = level, ended.copy()
        self._mean_square, self._looks = float(state["mean_square"]), int(state["looks"])


def shrunk(device: Device, image: DeviceArray, weights: DeviceArray | None, factor: int) -> Sized:
    """An image (height, width, C) and weights (height, width) in blocks of so many pixels.

    ``kernels/train/image_shrink.cl`` says what is computed.
    """
    if factor == 1:
        return image, weights
    columns, channels = image.shape[1:]
    rows, width = image.shape[0] // factor, columns // factor
    smaller = device.empty((rows, width, channels))
    known = None if weights is None else device.empty((rows, width))
    device.launch(
        "image_shrink",
        (rows * width,),
        image=image,
        # A kernel without weights still takes arrays in their place.
        weights=image if weights is None else weights,
        smaller=smaller,
        smaller_weights=smaller if known is None else known,
        rows=rows,
        width=width,
        columns=columns,
        CHANNELS=channels,
        FACTOR=factor,
        WEIGHTED=int(weights is not None),
    )
    return smaller, known


def octave_powers(device: Device, pictures: TrainingViews, count: int) -> NDArray[np.float64]:
    """(count,) mean squares of what each halving leaves out, from the first on; of some views."""
    numbers = _evenly(len(pictures.cameras)) if count else []
    powers = np.zeros(count)
    for number in numbers:
        image, weights = pictures.target(number), pictures.weights(number)
        for level in range(count):
            smaller = shrunk(device, image, weights, 2)
            powers[level] += _left_out(device, (image, weights), smaller) / len(numbers)
            image, weights = smaller
    return powers


def _left_out(device: Device, larger: Sized, smaller: Sized) -> float:
    """The weighted mean square of what a halving left out of an image."""
    image, half = device.get(larger[0]).astype(float), device.get(smaller[0]).astype(float)
    rows, columns = (2 * side for side in half.shape[:2])
    gap = image[:rows, :columns] - half.repeat(2, axis=0).repeat(2, axis=1)
    counts = 1.0 if larger[1] is None else device.get(larger[1])[:rows, :columns, None]
    return float(np.mean(counts * gap**2))


def _evenly(count: int) -> list[int]:
    numbers = np.linspace(0, count - 1, _VIEWS).round().astype(int)
    return [int(number) for number in np.unique(numbers)]
