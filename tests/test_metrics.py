"""The scores against their definitions, against scikit-image, and under hostile input."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl import metrics
from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.geometry import Grid

SCORES = [metrics.psnr, metrics.ssim, metrics.affine_fit]


@pytest.fixture
def pair():
    rng = np.random.default_rng(3)
    truth = rng.random((24, 30)).astype(np.float32)
    return truth + 0.1 * rng.standard_normal((24, 30)).astype(np.float32), truth


def test_psnr_of_a_known_error():
    truth = np.zeros((4, 5))
    assert metrics.psnr(truth + 0.1, truth) == pytest.approx(20)
    assert metrics.psnr(truth + 0.1, truth, peak=10) == pytest.approx(40)
    assert metrics.psnr(truth, truth) == math.inf


def test_psnr_is_scikit_images(pair):
    from skimage.metrics import peak_signal_noise_ratio

    image, truth = (array.astype(float) for array in pair)
    expected = peak_signal_noise_ratio(truth, image, data_range=2.5)
    assert metrics.psnr(*pair, peak=2.5) == pytest.approx(expected, rel=1e-12)


def test_psnr_counts_the_mask_alone():
    truth = np.zeros((6, 6))
    image = np.full((6, 6), 5.0)
    image[:3] = 0.01
    mask = np.zeros((6, 6), dtype=bool)
    mask[:3] = True
    assert metrics.psnr(image, truth, mask=mask) == pytest.approx(40)


def test_unsigned_images_do_not_wrap_round():
    assert metrics.psnr(np.uint8([[1]]), np.uint8([[3]]), peak=2) == pytest.approx(0)


def wang(image, truth, peak, mask=None):
    """SSIM map from its definition, one window at a time, the border reflected.

    With a mask, a window has the weights of the samples that count, whose sum is one.
    """
    ticks = np.arange(-5, 6)
    kernel = np.exp(-(ticks**2) / (2 * 1.5**2))
    kernel_2d = np.outer(kernel, kernel)
    x, y = (np.pad(np.asarray(a, float), 5, mode="symmetric") for a in (image, truth))
    counts = np.pad(np.ones(image.shape) if mask is None else mask, 5, mode="symmetric")
    result = np.empty(image.shape)
    for i, j in np.ndindex(image.shape):
        a, b = x[i : i + 11, j : j + 11], y[i : i + 11, j : j + 11]
        about = kernel_2d * counts[i : i + 11, j : j + 11]
        weight = about / about.sum() if about.any() else about
        ma, mb = (weight * a).sum(), (weight * b).sum()
        va, vb = (weight * a * a).sum() - ma**2, (weight * b * b).sum() - mb**2
        cov = (weight * a * b).sum() - ma * mb
        c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
        result[i, j] = (2 * ma * mb + c1) * (2 * cov + c2)
        result[i, j] /= (ma**2 + mb**2 + c1) * (va + vb + c2)
    return result


@pytest.mark.parametrize("peak", [1.0, 3.0])
def test_ssim_is_its_definition(pair, peak):
    expected = wang(*pair, peak)
    assert metrics.ssim(*pair, peak=peak) == pytest.approx(expected.mean(), rel=1e-9)
    mask = np.zeros(expected.shape, dtype=bool)
    mask[3:9, 4:20] = True
    score = metrics.ssim(*pair, peak=peak, mask=mask)
    assert score == pytest.approx(wang(*pair, peak, mask)[mask].mean(), rel=1e-9)


def test_ssim_of_all_samples_has_the_bits_of_scikit_image(pair):
    from skimage.metrics import structural_similarity

    image, truth = (array.astype(float) for array in pair)
    options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    _, expected = structural_similarity(image, truth, data_range=1.0, full=True, **options)
    assert metrics.ssim(*pair) == float(np.mean(expected))
    assert metrics.ssim(*pair, mask=np.ones(image.shape, bool)) == metrics.ssim(*pair)


def test_samples_that_do_not_count_have_no_part_in_ssim(pair):
    image, truth = pair
    mask = metrics.disc(Grid(truth.shape), radius=8)
    score = metrics.ssim(image, truth, mask=mask)
    for level in (0.0, 1.0, 50.0):
        hidden = (np.where(mask, array, level).astype(np.float32) for array in pair)
        assert metrics.ssim(*hidden, mask=mask) == score
    assert score < metrics.ssim(np.where(mask, image, truth), truth)


def test_ssim_of_equals_and_of_volumes(pair):
    image, truth = pair
    assert metrics.ssim(truth, truth) == pytest.approx(1)
    assert metrics.ssim(image, truth) == pytest.approx(metrics.ssim(truth, image))
    constant = np.stack([truth] * 11), np.stack([image] * 11)
    assert metrics.ssim(*constant) == pytest.approx(metrics.ssim(image, truth), rel=1e-6)


@pytest.mark.parametrize("shape", [(10, 30), (30,), (11, 11, 11, 11)])
def test_ssim_needs_room_for_its_window(shape):
    with pytest.raises(ShapeError, match="11"):
        metrics.ssim(np.zeros(shape), np.zeros(shape))


def test_affine_fit_undoes_gain_and_offset(pair):
    _, truth = pair
    scaled, gain, offset = metrics.affine_fit((truth - 3.0) / 0.5, truth)
    assert (gain, offset) == (pytest.approx(0.5, rel=1e-5), pytest.approx(3, rel=1e-5))
    np.testing.assert_allclose(scaled, truth, atol=1e-5)


def test_affine_fit_is_least_squares_on_the_mask(pair):
    image, truth = pair
    mask = metrics.disc(Grid(truth.shape), radius=9)
    scaled, gain, offset = metrics.affine_fit(image, truth, mask=mask)
    design = np.stack([image[mask], np.ones(mask.sum())], axis=1).astype(float)
    expected = np.linalg.lstsq(design, truth[mask].astype(float), rcond=None)[0]
    np.testing.assert_allclose((gain, offset), expected, rtol=1e-9)
    np.testing.assert_allclose(scaled, gain * image.astype(float) + offset)


def test_affine_fit_of_a_constant_is_the_mean(pair):
    _, truth = pair
    scaled, gain, offset = metrics.affine_fit(np.full(truth.shape, 0.1), truth)
    assert gain == 0
    assert offset == pytest.approx(truth.mean())
    np.testing.assert_allclose(scaled, offset)


def test_the_inscribed_disc():
    mask = metrics.disc(Grid((4, 6)))
    assert mask.dtype == np.bool_
    rows = ["..##..", ".####.", ".####.", "..##.."]
    np.testing.assert_array_equal(mask, [[c == "#" for c in row] for row in rows])


def test_a_disc_in_lengths_about_the_grids_centre():
    grid = Grid((200, 400), spacing=(0.2, 0.1), center=(50, -20))
    mask = metrics.disc(grid)
    assert mask.sum() * 0.02 == pytest.approx(math.pi * 20**2, rel=1e-3)
    np.testing.assert_array_equal(mask, mask[::-1, ::-1])
    assert metrics.disc(grid, radius=5).sum() * 0.02 == pytest.approx(math.pi * 25, rel=1e-2)


def test_a_disc_of_a_volume_is_a_cylinder():
    mask = metrics.disc(Grid((3, 8, 9)))
    assert mask.shape == (3, 8, 9)
    np.testing.assert_array_equal(mask, np.stack([metrics.disc(Grid((8, 9)))] * 3))
    mask[0] = False
    assert mask[1].any()


@pytest.mark.parametrize("radius", [0, -1.0, math.nan, math.inf])
def test_a_useless_radius_is_refused(radius):
    with pytest.raises(InputError, match="radius"):
        metrics.disc(Grid((4, 4)), radius=radius)


@pytest.mark.parametrize("score", SCORES)
def test_hostile_arrays_are_named(score):
    good = np.zeros((12, 12))
    bad = good.copy()
    bad[2, 7] = np.nan
    with pytest.raises(NonFiniteError, match=r"truth holds nan at \(2, 7\)"):
        score(good, bad)
    bad[2, 7] = -np.inf
    with pytest.raises(NonFiniteError, match="image holds -inf"):
        score(bad, good)
    with pytest.raises(ShapeError, match=r"\(12, 12\).*\(12, 1\)"):
        score(good, good[:, :1])
    with pytest.raises(DTypeError, match="complex"):
        score(good * 1j, good)
    with pytest.raises(DTypeError, match="truth"):
        score(good, good.astype(str))


class NeedsGradient:
    """Refuses to become an array as a tensor of torch does."""

    def __array__(self, *_, **__):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.\nSee the manual.")


@pytest.mark.parametrize("score", SCORES)
def test_what_numpy_cannot_read_is_named_with_its_own_words(score):
    good = np.zeros((12, 12))
    with pytest.raises(DTypeError, match=r"image cannot be read.*requires grad\.$"):
        score(NeedsGradient(), good)
    with pytest.raises(DTypeError, match="truth cannot be read"):
        score(good, NeedsGradient())


@pytest.mark.parametrize("score", SCORES)
def test_hostile_masks_are_named(score):
    good = np.zeros((12, 12))
    with pytest.raises(DTypeError, match="bool"):
        score(good, good, mask=np.ones((12, 12)))
    with pytest.raises(ShapeError, match="mask"):
        score(good, good, mask=np.ones((12, 1), dtype=bool))
    with pytest.raises(ShapeError, match="mask"):
        score(good, good, mask=np.zeros((12, 12), dtype=bool))
    with pytest.raises(ShapeError, match="empty"):
        score(good[:0], good[:0])


@pytest.mark.parametrize("score", [metrics.psnr, metrics.ssim])
def test_pictures_of_whole_numbers_need_their_full_scale(score):
    image = np.arange(144, dtype=np.uint8).reshape(12, 12)
    for pair in ((image, image / 255), (image / 255, image)):
        with pytest.raises(InputError, match="peak=255"):
            score(*pair)
    halves = (image + 1) // 2
    assert score(halves, image, peak=255) == pytest.approx(score(halves / 255, image / 255))
    assert score(image // 100, image > 99) == score(image // 100, image > 99, peak=1)


@pytest.mark.parametrize("peak", [0, -1, math.nan, math.inf])
@pytest.mark.parametrize("score", SCORES[:2])
def test_a_useless_peak_is_refused(score, peak):
    with pytest.raises(InputError, match="peak"):
        score(np.zeros((12, 12)), np.zeros((12, 12)), peak=peak)
