"""Ring reduction: stripes go, whatever they are like; a sinogram without them hardly changes."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.reconstruct.preprocess import STRIPE_METHODS, remove_rings
from rift_cl.reconstruct.preprocess.stripe_detection import fluctuating, offset, unevenness
from rift_cl.reference import detector_columns as twin

pytestmark = pytest.mark.dealt

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


@pytest.mark.full
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
    for shape in ((5, 64), (64, 8), (0, 64), (64, 0, 64), (1, 1, 1)):
        sinogram = np.random.default_rng(0).random(shape).astype(np.float32)
        np.testing.assert_array_equal(remove_rings(sinogram), sinogram)


def test_other_axes_are_told():
    with pytest.raises(ShapeError, match="bin"):
        remove_rings(np.zeros(7, np.float32))


def by_hand(sinogram, window):
    """The default method, step by step with the twins."""
    x = twin.blended(sinogram, fluctuating(twin.roughness(sinogram), 3))
    ranked, order = twin.ranked(x)
    level = twin.level(ranked, len(ranked) // 20)
    ranked = twin.blended(ranked, offset(level, 5))
    return twin.unranked(twin.median_across(ranked, window), order)


@pytest.mark.full
@pytest.mark.parametrize("kind", ["full", "varying", "wide", "dead", "fluctuating"])
def test_it_equals_its_steps_to_the_bit_on_every_device(device, noisy, kind):
    bad, _ = striped(noisy, kind)
    np.testing.assert_array_equal(remove_rings(bad, device=device), by_hand(bad, 3))
    np.testing.assert_array_equal(remove_rings(bad, device=device, window=7), by_hand(bad, 7))


# What each method is for. `fitting` blurs the edges of this phantom by as much as its stripes.
GOOD_AT = [
    ("sorting", "full"),
    ("sorting", "varying"),
    ("filtering", "full"),
    ("filtering", "varying"),
    ("large", "wide"),
    ("dead", "dead"),
    ("dead", "fluctuating"),
    ("wavelet-fft", "full"),
]


@pytest.mark.parametrize(("method", "kind"), GOOD_AT)
def test_a_method_removes_the_stripes_that_it_is_for(noisy, method, kind):
    if method == "wavelet-fft":
        pytest.importorskip("pywt")
    bad, bins = striped(noisy, kind)
    mended = remove_rings(bad, method=method)
    before, after = (np.abs(y - noisy)[:, bins].mean() for y in (bad, mended))
    assert after < 0.3 * before + 0.012 * noisy.max()


def test_fitting_removes_low_stripes_of_a_smooth_object():
    smooth = np.sin(np.linspace(0, np.pi, BINS)) * np.ones((VIEWS, 1))
    stripes = np.random.default_rng(4).normal(0, 0.02, BINS)
    bad = (smooth + stripes).astype(np.float32)
    mended = remove_rings(bad, method="fitting")
    assert np.std(mended - smooth) < 0.4 * np.std(stripes)


@pytest.mark.parametrize("method", STRIPE_METHODS)
def test_every_method_treats_rows_by_themselves_and_keeps_level_data(clean, noisy, method):
    if method == "wavelet-fft":
        pytest.importorskip("pywt")
    stack = np.stack(2 * [clean, striped(noisy, "full")[0], clean * 0 + 0.7], axis=1)
    mended = remove_rings(stack, method=method)
    for row in range(6):
        np.testing.assert_array_equal(mended[:, row], remove_rings(stack[:, row], method=method))
    np.testing.assert_allclose(mended[:, 2], stack[:, 2], rtol=1e-5)


def test_large_leaves_air_beside_a_steep_object_at_zero():
    bin = np.arange(BINS) - (BINS - 1) / 2
    disc = np.tile(0.02 * np.sqrt(np.maximum((0.95 * BINS / 2) ** 2 - bin**2, 0)), (VIEWS, 1))
    mended = remove_rings(disc, method="large")
    ends = np.flatnonzero(disc[0] == 0)
    assert ends.size > 5
    np.testing.assert_allclose(mended[:, ends], 0, atol=1e-3 * disc.max())
    # The rim next to it as well, less the curvature of its profile.
    np.testing.assert_allclose(mended[:, :25], disc[:, :25], atol=0.03 * disc.max())


@pytest.mark.parametrize("start", [1, 3, 12])
@pytest.mark.parametrize("mirrored", [False, True])
def test_levels_are_brought_together_up_to_the_ends(start, mirrored):
    slope = np.linspace(0, 3, BINS)
    stripe = np.zeros(BINS)
    stripe[start : start + 5] = 1
    stripe = stripe[::-1] if mirrored else stripe
    # A stripe moves the rank of the median by its bins.
    np.testing.assert_allclose(unevenness(slope + stripe), stripe, atol=5.01 * slope[1])
    np.testing.assert_allclose(unevenness(slope), 0, atol=1e-12)


def test_a_stripe_of_the_outermost_bins_is_left_whole():
    stripe = np.zeros(BINS)
    stripe[:5] = 1
    np.testing.assert_array_equal(unevenness(stripe), 0)


def test_large_brings_levels_together_unless_told_not_to(noisy):
    bad, _ = striped(noisy, "full")
    levels = [
        np.abs(np.diff(remove_rings(bad, method="large", **options).mean(axis=0))).mean()
        for options in ({}, {"normalise": False})
    ]
    before, clean = (np.abs(np.diff(y.mean(axis=0))).mean() for y in (bad, noisy))
    assert levels[0] < clean < 1.2 * levels[1] < 1.2 * before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "best"}, "method is 'best'"),
        ({"size": 5}, "method 'vo' has no option 'size'"),
        ({"window": 4}, "window is 4"),
        ({"window": 129}, "window is 129"),
        ({"window": 5.0}, r"window is 5.0"),
        ({"window": "5"}, "window is '5'"),
        ({"dead_ratio": "3"}, "dead_ratio is '3'"),
        ({"window": 127, "method": "sorting"}, "the detector has 64 bins"),
        ({"large_ratio": 0.5}, r"large_ratio is 0.5"),
        ({"dead_ratio": float("nan")}, "dead_ratio is nan"),
        ({"method": "fitting", "degree": -1}, "degree is -1"),
        ({"method": "fitting", "smoothing": 0}, "smoothing is 0"),
        ({"method": "filtering", "smoothing": float("inf")}, "smoothing is inf"),
        ({"method": "wavelet-fft", "width": 0}, "width is 0"),
        (
            {"method": "wavelet-fft", "levels": 11},
            "levels is 11",
        ),
    ],
)
def test_options_that_mean_nothing_are_told_in_a_sentence(options, words):
    with pytest.raises(InputError, match=words):
        remove_rings(np.zeros((40, 64), np.float32), **options)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_told(bad):
    sinogram = np.zeros((40, 64), np.float32)
    sinogram[3, 5] = bad
    with pytest.raises(NonFiniteError, match="projections"):
        remove_rings(sinogram)


def test_a_wavelet_that_is_not_there_is_told():
    pytest.importorskip("pywt")
    with pytest.raises(InputError, match="wavelet is 'sine'"):
        remove_rings(np.zeros((40, 64), np.float32), method="wavelet-fft", wavelet="sine")


def test_values_that_no_measurement_has_are_told():
    with pytest.raises(InputError, match="beyond 1e\\+18"):
        remove_rings(np.full((40, 64), -1e30))


def test_any_real_array_will_do():
    x = np.random.default_rng(7).random((40, 3, 64)).astype(np.float32)
    expected = remove_rings(x)
    for same in (x.astype(">f8"), np.asfortranarray(x), np.repeat(x, 2, axis=2)[:, :, ::2]):
        np.testing.assert_array_equal(remove_rings(same), expected)
