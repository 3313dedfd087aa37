"""Ring reduction: stripes go, whatever they are like; a sinogram without them hardly changes."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import ShapeError
from rift_cl.reconstruct.rings import remove_rings

BINS, VIEWS = 192, 240
ANGLES = np.arange(VIEWS) * np.pi / VIEWS
GRID, SCAN = rift.Grid((BINS, BINS)), rift.Parallel(ANGLES, BINS)


@pytest.fixture(scope="module")
def clean():
    return rift.phantom.shepp_logan_sinogram(GRID, SCAN).astype(np.float32)


@pytest.fixture(scope="module")
def noisy(clean):
    noise = np.random.default_rng(5).normal(0, 0.01 * clean.max(), clean.shape)
    return (clean + noise).astype(np.float32)


def psnr(image, truth):
    """Peak signal to noise ratio, the peak being the truth's range."""
    return 10 * np.log10(np.ptp(truth) ** 2 / np.mean((image - truth) ** 2, dtype=np.float64))


def striped(sinogram, kind):
    """A sinogram with stripes, and the bins that they are in."""
    random, copy = np.random.default_rng(1), sinogram.copy()
    bins = np.sort(random.choice(np.arange(20, BINS - 20, 6), 9, replace=False))
    strength = np.where(np.arange(9) % 2, 0.06, -0.08) * sinogram.max()
    if kind == "full":
        copy[:, bins] += strength
    if kind == "partial":
        copy[60:200, bins] += strength
    if kind == "varying":
        copy[:, bins] *= 1 + np.where(np.arange(9) % 2, 0.12, -0.1)
    if kind == "wide":
        bins = np.arange(80, 85)
        copy[:, bins] += 0.08 * sinogram.max()
    if kind == "dead":
        bins = np.array([60, 99, 100, 140])
        copy[:, bins] = 0.2 * sinogram.max()
    if kind == "fluctuating":
        bins = np.array([70, 120])
        copy[:, bins] += random.normal(0, 0.3 * sinogram.max(), (VIEWS, 2))
    return copy.astype(np.float32), bins


@pytest.mark.parametrize("kind", ["full", "partial", "varying", "wide", "dead", "fluctuating"])
@pytest.mark.parametrize("noise", ["clean", "noisy"])
def test_a_stripe_is_taken_out(request, kind, noise):
    sinogram = request.getfixturevalue(noise)
    bad, bins = striped(sinogram, kind)
    mended = remove_rings(bad)
    before = np.abs(bad - sinogram)[:, bins].mean(axis=0)
    after = np.abs(mended - sinogram)[:, bins].mean(axis=0)
    # A dead or jumping bin is guessed from its neighbours, whose noise it cannot have.
    floor = 0.012 * sinogram.max() if noise == "noisy" else 0
    # Sorted along the angles, a stripe that ends somewhere is mixed with what has none.
    share = 0.5 if kind == "partial" else 0.3
    assert np.mean(after) < share * np.mean(before) + floor


@pytest.mark.parametrize("kind", ["full", "wide", "dead", "fluctuating"])
def test_the_slice_is_better_for_it(clean, kind):
    A, truth = rift.Projector(GRID, SCAN), rift.phantom.shepp_logan(GRID)
    bad, _ = striped(clean, kind)
    before, after = (psnr(rift.fbp(A, y), truth) for y in (bad, remove_rings(bad)))
    assert after > before + 0.2


def test_a_sinogram_without_stripes_hardly_changes(clean, noisy):
    A, truth = rift.Projector(GRID, SCAN), rift.phantom.shepp_logan(GRID)
    for sinogram in (clean, noisy):
        mended = remove_rings(sinogram)
        assert psnr(mended, sinogram) > 42
        loss = psnr(rift.fbp(A, sinogram), truth) - psnr(rift.fbp(A, mended), truth)
        assert loss < 1.2


def test_a_constant_sinogram_stays_as_it_is():
    sinogram = np.full((40, 64), 0.7, np.float32)
    np.testing.assert_array_equal(remove_rings(sinogram), sinogram)


def test_scale_and_order_of_views_do_not_matter(noisy):
    bad, _ = striped(noisy, "full")
    mended = remove_rings(bad)
    np.testing.assert_allclose(remove_rings(8 * bad), 8 * mended, rtol=1e-5, atol=1e-4)
    # Dead bins are told by how views follow each other; the two other steps do not look at that.
    np.testing.assert_array_equal(remove_rings(bad[::-1])[::-1], mended)


def test_rows_are_mended_one_by_one(clean, noisy):
    stack = np.stack([clean, striped(noisy, "full")[0]], axis=1)
    mended = remove_rings(stack)
    for row in range(2):
        np.testing.assert_array_equal(mended[:, row], remove_rings(stack[:, row]))


def test_what_is_too_small_to_tell_is_left_alone():
    for shape in ((5, 64), (64, 8)):
        sinogram = np.random.default_rng(0).random(shape).astype(np.float32)
        np.testing.assert_array_equal(remove_rings(sinogram), sinogram)


def test_other_axes_are_told():
    with pytest.raises(ShapeError, match="bin"):
        remove_rings(np.zeros(7, np.float32))
