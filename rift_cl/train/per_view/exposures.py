"""A gain and an offset for each photograph and colour, fitted along with the splats.

Photographs of one scene are rarely exposed alike. What is drawn, x, is compared as g x + o with the
photograph y; g and o belong to the view and are forgotten afterwards. All gains could share a
common factor with the splats, so their mean stays one and that of the offsets zero.

Whenever a view is looked at, g and o move a share of the way to the least of

    sum w (g x + o - y)^2 + OFFSET sum w o^2,

which is known at once. Steps along a gradient, which they took before, came too late: by then the
splats' colours by direction had taken up what belongs to the photographs. Where pictures have few
tones a gain and an offset can hardly be told apart; the second sum has what is left undecided be a
gain, as it mostly is.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import sum_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device

_COLORS = 3
# Variance of a colour, in squares of a code of 16 bits or so, above which it tells a gain.
_TELLS = 2.0**-32
# Share of the way that a view's exposure moves when it is looked at.
_SHARE = 0.3
# What an offset costs, as a share of what the same difference from the photograph costs.
_OFFSET = 0.02
# Photographs further apart than this are of other light and not of another exposure.
_LEAST_GAIN, _LARGEST_GAIN = 0.1, 10.0

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

    def applied(self, image: DeviceArray, number: int) -> DeviceArray:
        """The (height, width, 3) image as view ``number`` would have exposed it; a new array."""
        exposed, size = self.device.empty(image.shape), image.size // _COLORS
        gain, offset = self._row(number)
        self.device.launch(
            "expose", (size,), image=image, exposed=exposed, gain=gain, offset=offset, pixels=size
        )
        return exposed

    def gradient(self, by_exposed: DeviceArray, number: int) -> DeviceArray:
        """The gradient by the image, of that by the exposed one; a new array."""
        by_image, size = self.device.empty(by_exposed.shape), by_exposed.size // _COLORS
        self.device.launch(
            "expose_grad",
            (size,),
            by_exposed=by_exposed,
            by_image=by_image,
            gain=self._row(number)[0],
            pixels=size,
        )
        return by_image

    def fit(
        self, image: DeviceArray, target: DeviceArray, weights: DeviceArray | None, number: int
    ) -> None:
        """Move the exposure of view ``number`` towards the one that serves its image best.

        Args:
            image: (height, width, 3) as it is drawn.
            target: (height, width, 3) photograph.
            weights: (height, width) of its pixels; None for all alike.
            number: of the view.
        """
        found = _of_moments(self._moments(image, target, weights))
        if not np.isfinite(found).all():
            return
        self.values[number] += _SHARE * (found - self.values[number])
        self.values[:, 0] /= self.values[:, 0].mean(axis=0)
        self.values[:, 1] -= self.values[:, 1].mean(axis=0)

    def _moments(
        self, image: DeviceArray, target: DeviceArray, weights: DeviceArray | None
    ) -> NDArray[np.float64]:
        """Sums over the pixels of w, w x, w y, w x x and w x y: (13,)."""
        size = image.size // _COLORS
        parts = self.device.empty((size, 1 + 4 * _COLORS))
        self.device.launch(
            "expose_moments",
            (size,),
            image=image,
            target=target,
            weights=weights,
            parts=parts,
            weighted=int(weights is not None),
            pixels=size,
        )
        return self.device.get(sum_columns(self.device, parts)).astype(float)

    def _row(self, number: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        # OpenCL's three-vectors are four floats wide.
        gain, offset = np.zeros((2, 4), np.float32)
        gain[:_COLORS], offset[:_COLORS] = self.values[number]
        return gain, offset

    def state(self) -> dict[str, NDArray[np.float64]]:
        """What a checkpoint keeps."""
        return {"values": self.values.copy()}

    def restore(self, state: Arrays) -> None:
        """Go on from a checkpoint."""
        self.values = np.array(state["values"])


def _of_moments(moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gain and offset of each colour, (2, 3), of the least in this file's first paragraphs."""
    total, sums = moments[0], moments[1:].reshape(4, _COLORS)
    if not total > 0:
        return np.array([[1.0] * _COLORS, [0.0] * _COLORS])
    drawn, wanted, squares, products = sums / total
    scale = squares * (1 + _OFFSET) - drawn**2
    told = scale > _TELLS
    gain = (products * (1 + _OFFSET) - drawn * wanted) / np.where(told, scale, 1)
    gain = np.where(told, np.clip(gain, _LEAST_GAIN, _LARGEST_GAIN), 1.0)
    return np.stack([gain, (wanted - gain * drawn) / (1 + _OFFSET)])


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
