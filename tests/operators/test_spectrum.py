"""Filtering in the Fourier domain: the twin's numbers, its own adjoint, norms, odd sizes."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import NonFiniteError, ShapeError
from rift_cl.operators.fourier.spectrum import SpectralFilter, padded_length
from rift_cl.reference.spectrum import spectrally_filtered

pytestmark = [pytest.mark.dealt, pytest.mark.variants]

SIZES = [(1, 1), (3, 40), (33, 20), (60, 64), (140, 23)]


def ramp(ky, kx):
    return np.sqrt(ky**2 + kx**2 + 1e-4)


def skew(ky, kx):
    """Even, but not alike along y and x, nor separable."""
    return 1 + np.cos(2 * np.pi * (ky + 2 * kx))


def picture(size, channels=3, seed=0):
    return np.random.default_rng(seed).normal(size=(*size, channels)).astype(np.float32)


@pytest.mark.parametrize("response", [ramp, skew])
@pytest.mark.parametrize("size", SIZES)
def test_it_is_the_twin(device, size, response):
    image, apply = picture(size), SpectralFilter(device, size, response)
    found = device.get(apply(device.array(image)))
    wanted = spectrally_filtered(image.astype(float), response, apply.padded)
    np.testing.assert_allclose(found, wanted, atol=3e-6 * np.abs(wanted).max())


@pytest.mark.parametrize("channels", [1, 2, 4, 5])
def test_channels_do_not_mix(device, channels):
    size, image = (9, 21), picture((9, 21), channels)
    apply = SpectralFilter(device, size, skew)
    together = device.get(apply(device.array(image)))
    for c in range(channels):
        alone = device.get(apply(device.array(np.ascontiguousarray(image[..., c : c + 1]))))
        np.testing.assert_allclose(together[..., c], alone[..., 0], atol=1e-5)


def test_channels_that_do_not_count_become_zero(device):
    image = picture((12, 10), 5)
    apply = SpectralFilter(device, (12, 10), ramp)
    found = device.get(apply(device.array(image), channels=3))
    alone = device.get(apply(device.array(np.ascontiguousarray(image[..., :3]))))
    assert not found[..., 3:].any()
    np.testing.assert_array_equal(found[..., :3], alone)


def test_it_is_its_own_adjoint(device):
    x, y = picture((31, 18), seed=1), picture((31, 18), seed=2)
    apply = SpectralFilter(device, (31, 18), skew)
    to_x, to_y = (device.get(apply(device.array(z))).astype(float) for z in (x, y))
    assert np.vdot(to_x, y) == pytest.approx(np.vdot(x, to_y), rel=1e-5)


def test_a_flat_response_changes_nothing_and_a_shifted_picture_is_filtered_alike(device):
    image = picture((20, 20))
    flat = SpectralFilter(device, (20, 20), lambda ky, kx: np.ones(np.broadcast(ky, kx).shape))
    np.testing.assert_allclose(device.get(flat(device.array(image))), image, atol=2e-6)
    # A spot far from the borders: shifted by 3, its picture shifts by 3.
    spots = np.zeros((2, 20, 20, 1), np.float32)
    spots[0, 8, 8], spots[1, 11, 11] = 1, 1
    apply = SpectralFilter(device, (20, 20), ramp)
    one, other = (device.get(apply(device.array(spot)))[..., 0] for spot in spots)
    np.testing.assert_allclose(other[3:, 3:], one[:-3, :-3], atol=1e-6)


def test_the_norm_is_kept_when_asked_for(device):
    image = picture((17, 40))
    apply = SpectralFilter(device, (17, 40), ramp)
    found, free = (
        device.get(apply(device.array(image), keep_norm=keep)).astype(float)
        for keep in (True, False)
    )
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(image), rel=1e-6)
    np.testing.assert_allclose(
        found * np.linalg.norm(free), free * np.linalg.norm(image), atol=1e-4
    )


def test_a_mask_is_laid_over_the_result_before_its_norm_is_kept(device):
    image, mask = picture((14, 22)), np.random.default_rng(9).uniform(size=(14, 22))
    mask[:, :5] = 0
    sent = device.array(mask.astype(np.float32))
    apply = SpectralFilter(device, (14, 22), ramp)
    free = device.get(apply(device.array(image)))
    found = device.get(apply(device.array(image), mask=sent))
    np.testing.assert_allclose(found, free * mask[..., None], atol=1e-6)
    kept = device.get(apply(device.array(image), mask=sent, keep_norm=True))
    assert np.linalg.norm(kept) == pytest.approx(np.linalg.norm(image), rel=1e-6)
    with pytest.raises(ShapeError, match="mask"):
        apply(device.array(image), mask=device.array(np.ones((22, 14), np.float32)))


def test_a_picture_of_zeros_stays_one(device):
    apply = SpectralFilter(device, (10, 10), ramp)
    zeros = device.array(np.zeros((10, 10, 3), np.float32))
    assert not device.get(apply(zeros, keep_norm=True)).any()


def test_nothing_wraps_round(device):
    image = np.zeros((64, 64, 1), np.float32)
    image[:, 0] = 1
    blur = SpectralFilter(device, (64, 64), lambda ky, kx: np.exp(-((kx / 0.2) ** 2)) + 0 * ky)
    assert abs(device.get(blur(device.array(image)))[:, -1]).max() < 1e-4


def test_the_same_picture_gives_the_same_bits(device):
    image, apply = device.array(picture((50, 70))), SpectralFilter(device, (50, 70), ramp)
    assert device.get(apply(image)).tobytes() == device.get(apply(image)).tobytes()


def test_lengths_are_twos_and_threes_with_a_margin():
    lengths = [padded_length(n) for n in (1, 8, 9, 60, 61, 69, 224, 240, 241, 270, 480, 512)]
    assert lengths == [8, 8, 16, 64, 64, 96, 256, 256, 256, 288, 512, 576]
    for length in range(1, 400):
        padded = left = padded_length(length)
        assert padded >= length + length // 16 and padded % 8 == 0
        for prime in (2, 3):
            while left % prime == 0:
                left //= prime
        assert left == 1


def test_what_cannot_be_filtered_is_refused(device):
    with pytest.raises(ShapeError, match=r"size is \(0, 5\)"):
        SpectralFilter(device, (0, 5), ramp)
    with pytest.raises(NonFiniteError, match="not finite"):
        SpectralFilter(device, (9, 5), lambda ky, kx: ky * kx + np.nan)
    with pytest.raises(ShapeError, match="image"):
        SpectralFilter(device, (9, 5), ramp)(device.array(picture((5, 9))))
