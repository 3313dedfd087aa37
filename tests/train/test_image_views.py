"""Training views from arrays in memory: which values are taken and which are refused by name."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError
from rift_cl.geometry import Camera
from rift_cl.train import ImageViews

pytestmark = pytest.mark.once
SIZE = (4, 5)
CAMERA = Camera(SIZE, [[5, 0, 2], [0, 5, 2], [0, 0, 1]], np.eye(4))
RANDOM = np.random.default_rng(3)
GOOD = RANDOM.uniform(size=(*SIZE, 3))


def _views(device, image=GOOD, weight=None):
    """The second of two views has this image and this weight."""
    weights = None if weight is None else [np.ones(SIZE), weight]
    return ImageViews(device, [CAMERA] * 2, [GOOD, image], weights=weights)


def _with(values, value):
    values = np.array(values, np.float32)
    values[1, 2] = value
    return values


@pytest.mark.parametrize(
    "image",
    [
        np.round(255 * GOOD).astype(np.uint8),
        np.round(255 * GOOD),
        254.7 * GOOD,
        np.round(65535 * GOOD).astype(np.uint16),
    ],
)
def test_codes_in_place_of_values_are_refused(device, image):
    most = 255 if image.max() < 256 else 65535
    with pytest.raises(InputError, match=f"image 1 has values up to.*divide by {most}"):
        _views(device, image)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_pixel_that_is_no_number_is_refused_with_its_view(device, value):
    with pytest.raises(NonFiniteError, match=r"image 1 .*\(1, 2, 0\)"):
        _views(device, _with(GOOD, value))
    with pytest.raises(NonFiniteError, match=r"weight 1 .*\(1, 2\)"):
        _views(device, weight=_with(np.ones(SIZE), value))


def test_weights_are_from_0_to_1(device):
    with pytest.raises(InputError, match="weight 1 has values down to -1"):
        _views(device, weight=_with(np.ones(SIZE), -1))
    with pytest.raises(InputError, match=r"weight 1 has values up to 255.*divide by 255"):
        _views(device, weight=np.full(SIZE, 255, np.uint8))


@pytest.mark.parametrize("image", [np.zeros((*SIZE, 3), np.uint8), _with(GOOD, 40.5), -0.01 * GOOD])
def test_highlights_of_linear_light_and_whole_numbers_from_0_to_1_are_taken(device, image):
    views = _views(device, image, np.eye(*SIZE, dtype=np.uint8))
    np.testing.assert_array_equal(device.get(views.target(1)), np.float32(image))
    np.testing.assert_array_equal(device.get(views.weights(1)), np.eye(*SIZE))
