"""The ramp in the loss: what it favours, that it keeps its norm, and that noise lowers it."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.reference.spectrum import spectrally_filtered
from rift_cl.train.loss.homogenisation import Homogenisation, noise_of
from rift_cl.train.loss.homogenised_loss import HomogenisedLoss
from rift_cl.train.loss.image_loss import ImageLoss

pytestmark = pytest.mark.once

SIZE = (24, 30)


def pictures(device, seed=0):
    random = np.random.default_rng(seed)
    arrays = random.uniform(0, 1, (2, *SIZE, 3)).astype(np.float32)
    return arrays, [device.array(array) for array in arrays]


def loss_of(device, exponent, *, ssim_weight=0.0, kind="l2", noise=0.0, **more):
    settings = Homogenisation(exponent, **more)
    return HomogenisedLoss(device, settings, ssim_weight=ssim_weight, kind=kind, noise=noise)


@pytest.mark.parametrize("along_rows", [False, True])
def test_the_gradient_is_the_ramp_of_the_plain_one_at_its_norm(device, along_rows):
    (image, target), sent = pictures(device)
    loss = loss_of(device, 0.5, along_rows=along_rows)
    value, found = (device.get(array) for array in loss(*sent))
    plain = 2 * (image.astype(float) - target) / target.size

    def response(ky, kx):
        square = kx**2 if along_rows else kx**2 + ky**2
        return (square + 1 / 30**2) ** 0.25

    wanted = spectrally_filtered(plain, response, (32, 32))
    wanted *= np.linalg.norm(plain) / np.linalg.norm(wanted)
    np.testing.assert_allclose(found, wanted, atol=2e-6 * np.abs(wanted).max())
    assert value[0] == pytest.approx(((image.astype(float) - target) ** 2).mean(), rel=1e-5)


def test_an_exponent_of_zero_is_the_plain_loss_bit_by_bit(device):
    _, sent = pictures(device)
    found = loss_of(device, 0.0, ssim_weight=0.2, kind="l1")(*sent)
    plain = ImageLoss(ssim_weight=0.2, kind="l1")(device, *sent)
    for one, other in zip(found, plain, strict=True):
        assert device.get(one).tobytes() == device.get(other).tobytes()


def test_structure_is_left_as_it_is(device):
    _, sent = pictures(device)
    mixed = device.get(loss_of(device, 1.0, ssim_weight=0.3, kind="l1")(*sent)[1])
    pixels = device.get(loss_of(device, 1.0, kind="l1")(*sent)[1])
    structure = device.get(ImageLoss(ssim_weight=1.0)(device, *sent)[1])
    np.testing.assert_allclose(mixed, 0.7 * pixels + 0.3 * structure, atol=1e-8)


def test_pixels_that_do_not_count_are_not_pulled_at(device):
    weights = np.ones(SIZE, np.float32)
    weights[:, :7] = 0
    _, sent = pictures(device)
    gradient = device.get(loss_of(device, 1.0)(*sent, weights=device.array(weights))[1])
    assert not gradient[:, :7].any() and gradient[:, 7:].all()


def test_a_step_along_the_gradient_lessens_the_loss(device):
    (image, _), sent = pictures(device)
    loss = loss_of(device, 1.0)
    value, gradient = loss(*sent)
    nearer = image - 100 * device.get(gradient)
    after = loss(device.array(nearer.astype(np.float32)), sent[1])[0]
    assert device.get(after)[0] < device.get(value)[0]


def test_the_exponent_falls_to_zero_as_only_noise_is_left():
    settings = Homogenisation(0.8)
    found = [settings.exponent_at(square, 0.1) for square in (1e9, 0.02, 0.01, 0.005)]
    assert found == pytest.approx([0.8, 0.4, 0.0, 0.0])
    assert Homogenisation(0.8, noise_aware=False).exponent_at(0.005, 0.1) == 0.8
    assert settings.exponent_at(1e-9, 0.0) == 0.8


def test_the_residual_is_watched_and_kept(device):
    (image, target), sent = pictures(device)
    loss = loss_of(device, 0.5, noise=0.01)
    loss.watch(*sent)
    square = float(((image.astype(float) - target) ** 2).mean())
    assert loss.mean_square == pytest.approx(square, rel=1e-5)
    loss.watch(sent[0], sent[0])
    assert loss.mean_square == pytest.approx(0.8 * square, rel=1e-5)
    other = loss_of(device, 0.5)
    other.restore(loss.state())
    assert (other.mean_square, other.noise, other.exponent) == (
        loss.mean_square, 0.01, loss.exponent,
    )  # fmt: skip


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_noise_is_found_under_a_picture(noise):
    random = np.random.default_rng(3)
    y, x = np.mgrid[:120, :160][..., None] / 40
    smooth = 0.5 + 0.3 * np.sin(x + np.arange(3)) * np.cos(y)
    images = [(smooth + noise * random.normal(size=smooth.shape)).astype(np.float32)] * 3
    assert noise_of(images) == pytest.approx(noise, rel=0.1, abs=1e-3)


@pytest.mark.parametrize("exponent", [-0.1, 5.0, float("nan")])
def test_exponents_out_of_range_are_refused(exponent):
    with pytest.raises(InputError, match="exponent is"):
        Homogenisation(exponent)
