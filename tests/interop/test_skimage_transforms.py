"""radon and iradon do what scikit-image's do: shapes, types, axis, sense of rotation, scale."""

from __future__ import annotations

import inspect
import itertools

import numpy as np
import pytest
from skimage import transform
from skimage.data import shepp_logan_phantom

import rift_cl.interop.skimage as adapter
from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.interop.skimage import iradon, radon

pytestmark = pytest.mark.once

FILTERS = ("ramp", "shepp-logan", "cosine", "hamming", "hann", None)
INTERPOLATIONS = ("linear", "nearest", "cubic")
both = pytest.mark.parametrize("circle", [True, False])


@pytest.fixture(autouse=True)
def here(device, monkeypatch):
    """The signatures have no room for a device, so that each is made the default one."""
    monkeypatch.setattr(adapter, "default_device", lambda: device)


@pytest.fixture(scope="module")
def phantom():
    """A head of 48 x 48 pixels."""
    head = transform.resize(shepp_logan_phantom(), (48, 48), anti_aliasing=True)
    return head * (inside(head.shape) > 0)


def inside(shape):
    """Noise that is zero outside the circle."""
    y, x = np.ogrid[: shape[0], : shape[1]]
    squared = (y - shape[0] // 2) ** 2 + (x - shape[1] // 2) ** 2
    image = np.random.default_rng(2).random(shape)
    return np.where(squared < (min(shape) // 2 - 1) ** 2, image, 0)


def distance(found, wanted):
    return np.linalg.norm(found - wanted) / np.linalg.norm(wanted)


def error(found, wanted):
    return np.sqrt(np.mean((found - wanted) ** 2))


@pytest.mark.parametrize("name", ["radon", "iradon"])
def test_the_signatures_are_scikit_images(name):
    ours = inspect.signature(getattr(adapter, name)).parameters.values()
    theirs = inspect.signature(getattr(transform, name)).parameters.values()
    assert [(p.name, p.kind, p.default) for p in ours] == [
        (p.name, p.kind, p.default) for p in theirs
    ]


@both
@pytest.mark.parametrize("shape", [(40, 40), (41, 41), (31, 44), (44, 31), (17, 16), (16, 17)])
def test_sinograms_are_scikit_images(shape, circle):
    image, theta = inside(shape), np.linspace(-20, 400, 23)
    found, wanted = (f(image, theta, circle) for f in (radon, transform.radon))
    assert found.shape == wanted.shape
    assert distance(found, wanted) < 0.03
    assert np.allclose(found.sum(axis=0), image.sum(), rtol=0.02)


def test_at_right_angles_sinograms_are_the_sums_of_rows_and_columns():
    image = inside((21, 21))
    sinogram = radon(image, [0, 90, 180, 270])
    assert np.allclose(sinogram[:, 0], image.sum(axis=0), atol=1e-5)
    assert np.allclose(sinogram[:, 1], image.sum(axis=1)[::-1], atol=1e-5)
    assert np.allclose(sinogram[:, 2:], sinogram[::-1, :2], atol=1e-5)


@both
@pytest.mark.parametrize("shape", [(16, 16), (17, 17), (32, 16), (33, 17)])
def test_the_pixel_on_the_axis_stays_in_the_bin_on_the_axis(shape, circle):
    image = np.zeros(shape)
    image[shape[0] // 2, shape[1] // 2] = 1
    if circle and shape[0] != shape[1]:
        image = image[: min(shape), : min(shape)] * 0
        image[min(shape) // 2, min(shape) // 2] = 1
    sinogram = radon(image, circle=circle)
    assert (sinogram.argmax(axis=0) == sinogram.shape[0] // 2).all()


@pytest.mark.parametrize("shape", [(3, 3), (4, 4), (5, 5)])
def test_a_lone_pixel_is_found_where_it_was(shape):
    middle = (shape[0] // 2, shape[1] // 2)
    for dy, dx in itertools.product((-1, 0, 1), repeat=2):
        image = np.zeros(shape)
        image[middle[0] + dy, middle[1] + dx] = 1
        found = iradon(radon(image, circle=False), circle=False)
        assert found.shape == shape
        assert found.argmax() == image.argmax()


@both
@pytest.mark.parametrize("filter_name", FILTERS)
@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_reconstructions_are_scikit_images(interpolation, filter_name, circle, phantom):
    theta = np.linspace(0, 180, 25, endpoint=False)
    sinogram = transform.radon(phantom, theta, circle)
    options = {"filter_name": filter_name, "interpolation": interpolation, "circle": circle}
    found, wanted = (f(sinogram, theta, **options) for f in (iradon, transform.iradon))
    assert found.shape == wanted.shape
    assert distance(found, wanted) < 0.01


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_there_and_back_is_as_good_as_scikit_image(interpolation, phantom):
    options = {"interpolation": interpolation, "circle": False}
    ours = iradon(radon(phantom, circle=False), **options)
    theirs = transform.iradon(transform.radon(phantom, circle=False), **options)
    assert error(ours, phantom) < 1.02 * error(theirs, phantom)


def test_a_disc_keeps_its_level():
    y, x = np.mgrid[:96, :96] - 47.5
    disc = (x**2 + y**2 <= 24**2).astype(float)
    theta = np.linspace(0, 180, 96, endpoint=False)
    assert abs(np.mean(iradon(radon(disc, theta), theta) - disc)) < 1e-4


@both
@pytest.mark.parametrize("size", [None, 1, 30, 55])
def test_the_output_size_is_as_asked_for(size, circle):
    sinogram = radon(inside((40, 40)), np.arange(0, 180, 10), circle)
    found, wanted = (
        f(sinogram, output_size=size, circle=circle) for f in (iradon, transform.iradon)
    )
    assert found.shape == wanted.shape
    assert error(found, wanted) < 0.02


def test_angles_are_0_to_179_or_as_many_as_there_are_columns():
    image = inside((20, 20))
    assert np.array_equal(radon(image), radon(image, np.arange(180)))
    sinogram = radon(image, np.linspace(0, 180, 50, endpoint=False))
    wanted = iradon(sinogram, np.linspace(0, 180, 50, endpoint=False))
    assert np.array_equal(iradon(sinogram), wanted)


def test_the_order_of_the_angles_does_not_matter():
    theta, shuffle = (
        np.linspace(0, 180, 30, endpoint=False),
        np.random.default_rng(1).permutation(30),
    )
    sinogram = radon(inside((20, 20)), theta)
    assert np.array_equal(radon(inside((20, 20)), theta[shuffle]), sinogram[:, shuffle])
    wanted = iradon(sinogram, theta)
    assert np.allclose(iradon(sinogram[:, shuffle], theta[shuffle]), wanted, atol=1e-5)


@pytest.mark.parametrize("interpolation", ["linear", "nearest"])
@pytest.mark.parametrize("size", [15, 16])
@both
def test_half_a_turn_on_a_single_view_reconstructs_the_same(size, interpolation, circle):
    sinogram = np.zeros((size, 1))
    sinogram[size // 2] = 1
    options = {"interpolation": interpolation, "circle": circle}
    for theta in (0, 35, 90):
        one, other = (iradon(sinogram, [theta + turn], **options) for turn in (0, 180))
        assert np.allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("preserve_range", [True, False])
@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", "u1", "i2", "?"])
def test_types_and_ranges_are_scikit_images(dtype, preserve_range):
    image = (200 * inside((12, 12))).astype(dtype)
    theta = [0, 45, 90]
    for f in ("radon", "iradon"):
        values = image if f == "radon" else image[:, :3]
        ours, theirs = (
            getattr(package, f)(values, theta, preserve_range=preserve_range)
            for package in (adapter, transform)
        )
        assert ours.dtype == theirs.dtype
        assert distance(ours, theirs) < 0.05


def test_a_picture_of_the_other_byte_order_is_read_too():
    image = inside((12, 12)).astype("f4")
    assert np.array_equal(radon(image.astype(">f4")), radon(image))


def test_what_lies_outside_the_circle_is_warned_of():
    with pytest.warns(UserWarning, match="reconstruction circle"):
        assert radon(np.ones((10, 10))).shape == (10, 180)
    assert radon(np.ones((10, 10)), circle=False).shape == (15, 180)


@pytest.mark.parametrize("bins", [1, 2, 3])
@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_a_detector_of_a_few_bins_is_no_special_case(bins, interpolation):
    found = iradon(np.ones((bins, 2)), interpolation=interpolation)
    assert found.shape == (bins, bins)
    assert np.isfinite(found).all()


BAD = {
    "volume": (lambda: radon(np.zeros((3, 3, 3))), ShapeError, r"image has shape \(3, 3, 3\)"),
    "row": (lambda: radon(np.zeros(3)), ShapeError, r"image has shape \(3,\)"),
    "empty image": (lambda: radon(np.zeros((0, 3))), ShapeError, r"image has shape \(0, 3\)"),
    "empty theta": (lambda: radon(np.zeros((3, 3)), []), ShapeError, "at least one direction"),
    "one number": (lambda: radon(np.zeros((3, 3)), 5), ShapeError, "one dimension"),
    "text": (lambda: radon(np.zeros((3, 3)), ["a"]), InputError, "theta.*in degrees"),
    "NaN angle": (lambda: radon(np.zeros((3, 3)), [np.nan]), InputError, "finite"),
    "NaN": (lambda: radon(np.full((4, 4), np.nan), circle=False), NonFiniteError, "image holds"),
    "complex": (lambda: radon(np.zeros((3, 3), complex)), DTypeError, "image.*complex"),
    "columns": (lambda: iradon(np.zeros((3, 3)), [0, 1]), ShapeError, "2 angles.*3 columns"),
    "stack": (lambda: iradon(np.zeros((3, 3, 2))), ShapeError, "radon_image has shape"),
    "filter": (lambda: iradon(np.zeros((3, 3)), filter_name="x"), InputError, "'x', wanted one"),
    "spline": (lambda: iradon(np.zeros((3, 3)), interpolation="x"), InputError, "linear, nearest"),
    "size": (lambda: iradon(np.zeros((3, 3)), output_size=0), ShapeError, "each >= 1"),
    "tiny": (lambda: iradon(np.zeros((1, 3)), circle=False), ShapeError, "each >= 1"),
    "infinite": (lambda: iradon(np.full((3, 3), np.inf)), NonFiniteError, "radon_image holds"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_done_is_a_value_error_with_a_sentence(case):
    call, error, words = BAD[case]
    with pytest.raises(error, match=words) as raised:
        call()
    assert isinstance(raised.value, ValueError)
