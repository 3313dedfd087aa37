"""L1 and SSIM with their gradient: against a float64 twin, scikit-image and kornia's autograd."""

import dataclasses
import importlib
import itertools

import numpy as np
import pytest

import rift_cl as rift
from rift_cl import metrics
from rift_cl.errors import DeviceError, DTypeError, InputError, ShapeError
from rift_cl.reference import image_loss as twin
from rift_cl.train.loss.image_loss import ImageLoss

pytestmark = [pytest.mark.dealt, pytest.mark.variants]

IMAGE_LOSS = importlib.import_module("rift_cl.train.loss.image_loss")

# Of the second, a strip of 256 floats leaves two.
SIZES = [(11, 11), (12, 86), (13, 200), (97, 143)]


def pair(size, channels=3, *, behind=0, seed=1):
    """A smooth picture with some noise, and another with more of it; values about 0 to 1."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[: size[0], : size[1]][..., None] / 9
    smooth = 0.5 + 0.4 * np.sin(x + np.arange(channels + behind)) * np.cos(y)
    image = smooth + 0.1 * random.normal(size=smooth.shape)
    target = smooth + 0.03 * random.normal(size=smooth.shape)
    return image.astype(np.float32), target[..., :channels].astype(np.float32)


def mask(size, seed=2):
    return np.random.default_rng(seed).uniform(0, 1, size).astype(np.float32)


def found(device, loss, image, target, weights=None):
    """The loss and its gradient on the host."""
    arrays = (None if array is None else device.array(array) for array in (image, target, weights))
    image, target, weights = arrays
    value, grad = loss(device, image, target, weights=weights)
    assert value.shape == (1,)
    return float(device.get(value)[0]), device.get(grad)


def check_equal(found, wanted):
    value, gradient = wanted
    assert found[0] == pytest.approx(value, rel=1e-5)
    assert np.linalg.norm(found[1] - gradient) <= 1e-5 * np.linalg.norm(gradient)


@pytest.mark.parametrize("kind", ["l1", "l2"])
@pytest.mark.parametrize("weighted", [False, True])
def test_gradient_of_the_twin_is_that_of_differences(kind, weighted):
    size = (12, 14)
    image, target = (array.astype(float) for array in pair(size, 2, behind=1))
    weights = mask(size) if weighted else None
    way = np.random.default_rng(3).normal(size=image.shape)

    def value(shift):
        return twin.image_loss(image + shift * way, target, weights, ssim_weight=0.4, kind=kind)[0]

    slope = np.sum(twin.image_loss(image, target, weights, ssim_weight=0.4, kind=kind)[1] * way)
    assert (value(1e-6) - value(-1e-6)) / 2e-6 == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("channels", [1, 2, 4])
@pytest.mark.parametrize("size", [(11, 11), (19, 87)])
def test_any_number_of_channels_is_the_twins(device, size, channels):
    image, target = pair(size, channels)
    check_equal(found(device, ImageLoss(), image, target), twin.image_loss(image, target))


@pytest.mark.parametrize("size", SIZES)
def test_loss_and_gradient_are_the_twins(device, size):
    image, target = pair(size)
    check_equal(found(device, ImageLoss(), image, target), twin.image_loss(image, target))


SETTINGS = [(0, "l2", True), (0.7, "l2", True), (1, "l1", False), (0.2, "l1", True)]


@pytest.mark.parametrize(("ssim_weight", "kind", "weighted"), SETTINGS)
def test_every_setting_is_the_twins(device, ssim_weight, kind, weighted):
    size = (23, 37)
    image, target = pair(size)
    weights = mask(size) if weighted else None
    settings = {"ssim_weight": ssim_weight, "kind": kind}
    wanted = twin.image_loss(image, target, weights, **settings)
    check_equal(found(device, ImageLoss(**settings), image, target, weights), wanted)


@pytest.mark.parametrize("size", SIZES)
def test_ssim_is_that_of_the_metrics(device, size):
    image, target = pair(size)
    value, _ = found(device, ImageLoss(ssim_weight=1), image, target)
    wanted = [metrics.ssim(image[..., c], target[..., c]) for c in range(3)]
    assert 1 - value == pytest.approx(np.mean(wanted), abs=1e-6)


def test_equal_images_have_no_loss_and_no_gradient(device):
    _, image = pair((31, 45))
    value, gradient = found(device, ImageLoss(0.5), image, image)
    assert value == 0
    assert not gradient.any()


@pytest.mark.full
@pytest.mark.parametrize(("a", "b"), [(0, 1), (1, 1), (0.3, 0.31), (0.9, 0.2)])
def test_constant_images_differ_in_luminance_alone(device, a, b):
    """To fewer digits: a variance of nothing is the rounding error of a square, over C2."""
    size = (14, 19, 2)
    image, target = np.full(size, a, np.float32), np.full(size, b, np.float32)
    value, gradient = found(device, ImageLoss(), image, target)
    luminance = (2 * a * b + twin.C1) / (a**2 + b**2 + twin.C1)
    assert value == pytest.approx(0.8 * abs(a - b) + 0.2 * (1 - luminance), rel=1e-4)
    slope = 2 * (b - a * luminance) / (a**2 + b**2 + twin.C1)
    wanted = (0.8 * np.sign(a - b) - 0.2 * slope) / image.size
    np.testing.assert_allclose(gradient, np.full(size, wanted), rtol=1e-3)


@pytest.mark.parametrize("axis", [0, 1])
def test_flipped_images_have_the_flipped_gradient(device, axis):
    """All borders are alike, whichever of them a tile or a vector reaches."""
    image, target = pair((29, 101))
    value, gradient = found(device, ImageLoss(), image, target)
    flipped = found(device, ImageLoss(), np.flip(image, axis), np.flip(target, axis))
    check_equal(flipped, (value, np.flip(gradient, axis)))


def test_gradient_reaches_no_further_than_two_windows(device):
    image, target = pair((41, 57))
    weights = np.zeros((41, 57), np.float32)
    weights[20, 30] = 1
    _, gradient = found(device, ImageLoss(), image, target, weights)
    assert gradient[15:26, 25:36].all()
    gradient[15:26, 25:36] = 0
    assert not gradient.any()


def test_loss_is_linear_in_the_weights(device):
    image, target = pair((40, 33))
    some = mask((40, 33))
    parts = [found(device, ImageLoss(), image, target, each) for each in (some, 1 - some)]
    whole = found(device, ImageLoss(), image, target)
    check_equal([a + b for a, b in zip(*parts, strict=True)], whole)
    ones = found(device, ImageLoss(), image, target, np.ones((40, 33), np.float32))
    assert ones[0] == whole[0] and np.array_equal(ones[1], whole[1])


@pytest.mark.parametrize("ssim_weight", [0, 0.2])
def test_channels_behind_the_target_do_not_count(device, ssim_weight):
    image, target = pair((26, 53), 3, behind=2)
    image[..., 3:] = np.nan
    loss = ImageLoss(ssim_weight)
    value, gradient = found(device, loss, image, target)
    alone, wanted = found(device, loss, image[..., :3].copy(), target)
    assert value == alone
    assert np.array_equal(gradient[..., :3], wanted)
    assert not gradient[..., 3:].any()


def test_loss_is_the_mean_over_the_channels(device):
    image, target = pair((18, 27), 4)
    value, gradient = found(device, ImageLoss(), image, target)
    planes = [
        found(device, ImageLoss(), image[..., c : c + 1].copy(), target[..., c : c + 1].copy())
        for c in range(4)
    ]
    wanted = np.mean([one for one, _ in planes]), np.dstack([grad for _, grad in planes]) / 4
    check_equal((value, gradient), wanted)


def test_every_run_has_the_same_bits(device):
    image, target = pair((67, 130))
    runs = [found(device, ImageLoss(), image, target, mask((67, 130))) for _ in range(4)]
    for value, gradient in runs[1:]:
        assert value == runs[0][0]
        assert np.array_equal(gradient, runs[0][1])


def test_maps_of_a_large_image_are_made_in_bands_to_the_same_bits(device, monkeypatch):
    image, target = map(device.array, pair((61, 90)))
    weights, sizes, make = device.array(mask((61, 90))), [], device.empty

    def noted(*given):
        found = make(*given)
        sizes.append(found.nbytes)
        return found

    def most():
        sizes.clear()
        found = map(device.get, ImageLoss()(device, image, target, weights=weights))
        return max(sizes), [array.tobytes() for array in found]

    monkeypatch.setattr(device, "empty", noted)
    whole, wanted = most()
    monkeypatch.setattr(IMAGE_LOSS, "_MAPS_ROOM", 0)
    banded, found = most()
    assert banded < whole / 2 and found == wanted


@pytest.mark.parametrize("size", [(1, 1), (3, 2), (1, 300)])
def test_small_images_have_a_loss_without_ssim(device, size):
    image, target = pair(size)
    wanted = twin.image_loss(image, target, ssim_weight=0)
    check_equal(found(device, ImageLoss(0), image, target), wanted)


def test_loss_and_gradient_are_kornias_inside(device):
    """Kornia mirrors its borders about the outermost pixels; inside there is no difference."""
    torch = pytest.importorskip("torch", reason="torch is not installed")
    kornia = pytest.importorskip("kornia.metrics", reason="kornia is not installed")
    image, target = pair((40, 51))
    inside = np.zeros((40, 51), np.float32)
    inside[5:-5, 5:-5] = 1
    value, gradient = found(device, ImageLoss(1), image, target, inside)
    planes = [torch.tensor(a.astype(float).transpose(2, 0, 1)[None]) for a in (image, target)]
    planes[0].requires_grad_()
    map_ = kornia.ssim(*planes, 11, padding="valid")
    wanted = (1 - map_).sum() / target.size
    wanted.backward()
    check_equal((value, gradient), (wanted.item(), planes[0].grad[0].permute(1, 2, 0).numpy()))


def test_settings_are_checked():
    for weight in (-0.1, 1.5, float("nan"), "much", None):
        with pytest.raises(InputError, match="ssim_weight is"):
            ImageLoss(ssim_weight=weight)
    with pytest.raises(InputError, match="'huber'"):
        ImageLoss(kind="huber")
    with pytest.raises(dataclasses.FrozenInstanceError):
        ImageLoss().kind = "l2"


WRONG_SHAPES = [
    ((20, 20), (20, 20, 3), "image has shape"),
    ((20, 20, 3), (20, 20), "target has shape"),
    ((20, 0, 3), (20, 0, 3), "image has shape"),
    ((20, 20, 5), (20, 20, 5), "target has 5 channels, wanted 1 to 4"),
    ((20, 20, 2), (20, 20, 3), "at least its channels"),
    ((20, 21, 3), (20, 20, 3), "wanted the size of the target"),
    ((10, 20, 3), (10, 20, 3), "10 x 20 pixels, SSIM wants 11 or more"),
]


@pytest.mark.parametrize(("image", "target", "message"), WRONG_SHAPES)
def test_shapes_that_do_not_fit_are_named(device, image, target, message):
    with pytest.raises(ShapeError, match=message):
        ImageLoss()(device, device.zeros(image), device.zeros(target))


def test_arrays_that_are_no_images_of_the_device_are_named(device):
    size = (16, 20, 3)
    good, thin = device.zeros(size), device.zeros(size[:2])
    other = rift.Device(device._handle, device.selector, traits=device.traits)
    wrong = {
        "on the host": (DTypeError, np.zeros(size, np.float32)),
        "int32": (DTypeError, device.zeros(size, np.int32)),
        "strided view": (ShapeError, device.zeros((16, 20, 4))[..., :3]),
        "another device": (DeviceError, other.zeros(size)),
    }
    for (message, (error, array)), place in itertools.product(wrong.items(), (0, 1)):
        arrays = [good, good]
        arrays[place] = array
        with pytest.raises(error, match=message):
            ImageLoss()(device, *arrays, weights=thin)
    with pytest.raises(ShapeError, match="weights has shape"):
        ImageLoss()(device, good, good, weights=device.zeros((20, 16)))
    with pytest.raises(DTypeError, match="weights is a ndarray"):
        ImageLoss()(device, good, good, weights=np.ones(size[:2], np.float32))
