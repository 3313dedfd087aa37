"""Zingers go, wherever they strike; clean projections stay as they are."""

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.reconstruct.preprocess import remove_zingers
from rift_cl.reference import zingers as twin

pytestmark = [pytest.mark.dealt, pytest.mark.variants]

SHAPE = (90, 12, 160)


@pytest.fixture(scope="module")
def ideal():
    """Transmissions of balls in a cylinder, over half a turn."""
    random, (views, rows, bins) = np.random.default_rng(8), SHAPE
    angle = np.arange(views)[:, None, None] * np.pi / views
    row, s = np.arange(rows)[:, None], np.arange(bins) - (bins - 1) / 2
    integrals = 0.01 * 2 * np.sqrt(np.maximum((0.42 * bins) ** 2 - s**2, 0)) + np.zeros(SHAPE)
    for _ in range(25):
        (x, y), radius, z = random.uniform(-40, 40, 2), random.uniform(3, 9), random.uniform(0, 12)
        t = s - x * np.cos(angle) - y * np.sin(angle)
        integrals += 0.03 * 2 * np.sqrt(np.maximum(radius**2 - t**2 - (row - z) ** 2, 0))
    return np.exp(-integrals)


def photons(ideal, flux):
    """What a detector counts of so many photons a pixel, less bright towards its ends; I / I0."""
    beam = flux * np.exp(-3 * np.linspace(-0.5, 0.5, SHAPE[2]) ** 2)
    counts = np.random.default_rng(9).poisson(ideal * beam)
    return (counts / beam).astype(np.float32)


def struck(stack, share=2e-4, height=3.0):
    """Zingers in random pixels: the stack with them, and where they are."""
    random = np.random.default_rng(10)
    hit = random.random(stack.shape) < share
    return (stack + hit * random.uniform(height, 3 * height, stack.shape)).astype(np.float32), hit


@pytest.mark.parametrize("flux", [1, 10, 300, 10_000, 1_000_000])
@pytest.mark.parametrize("size", [3, 5])
@pytest.mark.parametrize("rows", [SHAPE[1], 1])
def test_clean_projections_hardly_change(ideal, flux, size, rows):
    clean = photons(ideal, flux)[:, :rows]
    kept, count = remove_zingers(clean, size=size, dark=True)
    # Below one in 100,000; a sinogram has 14,400 samples.
    assert count <= max(1, 1e-5 * clean.size)
    assert count == np.count_nonzero(kept != clean)


@pytest.mark.parametrize("rows", [SHAPE[1], 1])
@pytest.mark.parametrize("flux", [100, 10_000])
def test_zingers_are_replaced_by_what_is_round_them(ideal, flux, rows):
    clean = photons(ideal, flux)[:, :rows]
    bad, hit = struck(clean)
    mended, count = remove_zingers(bad)
    found = mended != bad
    assert count == found.sum()
    assert found[hit].mean() > 0.97
    assert found[~hit].mean() < 1e-5 + 1 / hit.size
    assert np.abs(mended - clean)[hit & found].max() < 0.2 + 8 / np.sqrt(flux)


@pytest.mark.parametrize("shape", [(1, 2), (2, 2), (2, 1)])
def test_a_zinger_of_several_pixels_goes(ideal, shape):
    bad = photons(ideal, 10_000)
    bad[40, 5 : 5 + shape[0], 80 : 80 + shape[1]] += 2
    mended, _ = remove_zingers(bad)
    assert np.all(mended[40, 5 : 5 + shape[0], 80 : 80 + shape[1]] < 1)


def test_dark_pixels_go_on_request_alone(ideal):
    clean = photons(ideal, 10_000)
    bad = clean.copy()
    bad[20, 6, 10] = bad[50, 2, 150] = 0
    kept, _ = remove_zingers(bad)
    assert kept[20, 6, 10] == kept[50, 2, 150] == 0
    mended, _ = remove_zingers(bad, dark=True)
    assert mended[20, 6, 10] > 0.5
    assert mended[50, 2, 150] > 0.5


def test_what_several_views_see_belongs_to_the_object(ideal):
    bright = photons(ideal, 10_000)
    # A gap of one pixel, which moves by one bin a view.
    for view in range(20, 60):
        bright[view, 6, 60 + view] = 1
    _, count = remove_zingers(bright)
    assert count <= 1
    bright[40, 6, 130] = 3
    _, count = remove_zingers(bright)
    assert 1 <= count <= 2


def test_line_integrals_are_mended_where_transmissions_are(ideal):
    bad, _ = struck(np.maximum(photons(ideal, 10_000), 1e-3))
    mended, count = remove_zingers(bad)
    integrals = -np.log(bad)
    found, same = remove_zingers(integrals, kind="attenuation")
    assert abs(same - count) <= 0.01 * count
    changed = found != integrals
    assert np.mean(changed == (mended != bad)) > 1 - 1e-5
    np.testing.assert_allclose(np.exp(-found), mended, atol=0.02, rtol=0.3)
    untouched = ~changed
    np.testing.assert_array_equal(found[untouched], integrals[untouched])


@pytest.mark.full
def test_an_absolute_excess_decides_alone(ideal):
    bad = photons(ideal, 10_000)
    bad[30:40, 4, 70] = 2
    mended, _ = remove_zingers(bad, excess=0.5)
    assert np.all(mended[30:40, 4, 70] < 1.5)
    for reach, stack in (((0, 1, 1), bad), ((1, 0, 1), bad[:, 4:5])):
        medians = twin.local_median(stack, reach)
        expected = np.where(stack - medians > np.float32(0.5), medians, stack)
        np.testing.assert_array_equal(remove_zingers(stack, excess=0.5)[0], expected)


def test_counts_and_transmissions_are_treated_alike(ideal):
    bad, _ = struck(photons(ideal, 1000))
    mended, count = remove_zingers(bad)
    counts, same = remove_zingers(1024 * bad)
    assert same == count
    np.testing.assert_array_equal(counts, 1024 * mended)


@pytest.mark.parametrize("size", [3, 5])
def test_rows_may_be_cut_into_slabs_that_overlap(ideal, size):
    bad, _ = struck(photons(ideal, 1000))
    whole, away = remove_zingers(bad, size=size)[0], size // 2
    for start, stop in ((0, 3), (3, 4), (4, 9), (9, 12)):
        first = max(0, start - away)
        slab = remove_zingers(bad[:, first : stop + away], size=size)[0]
        np.testing.assert_array_equal(
            slab[:, start - first : stop - first], whole[:, start:stop], err_msg=str(start)
        )


@pytest.mark.full
def test_a_device_that_holds_few_rows_gives_the_same(device, ideal):
    import dataclasses

    import rift_cl as rift

    bad, _ = struck(photons(ideal, 1000))
    each = 12 * SHAPE[0] * SHAPE[2]
    traits = dataclasses.replace(device.traits)
    small = rift.Device(device._handle, device.selector, traits=traits, memory=5 * each)
    expected, count = remove_zingers(bad, device=device)
    found, same = remove_zingers(bad, device=small)
    np.testing.assert_array_equal(found, expected)
    assert same == count


# No multiple of any vector; smaller than one; two rows or views; one row.
SHAPES = [(7, 5, 37), (4, 3, 5), (3, 2, 16), (1, 9, 65), (2, 6, 8), (9, 1, 11)]


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("reach", [(0, 1, 1), (0, 2, 2), (1, 0, 1), (1, 0, 2)], ids=str)
def test_the_median_round_a_pixel_equals_its_twin(device, shape, reach):
    if any(n <= away for n, away in zip(shape, reach, strict=True)):
        pytest.skip("no mirror image of so short an axis")
    x = np.random.default_rng(1).standard_normal(shape).astype(np.float32)
    out, run = device.empty(shape), 4096 if device.traits.is_cpu else 1
    size = (-(-shape[2] // run), shape[1], shape[0])
    macros = dict(zip(("VIEWS_AWAY", "ROWS_AWAY", "BINS_AWAY"), reach, strict=True))
    sizes = dict(zip(("views", "rows", "bins"), shape, strict=True))
    device.launch("local_median", size, x=device.array(x), out=out, **sizes, RUN=run, **macros)
    np.testing.assert_array_equal(device.get(out), twin.local_median(x, reach))


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("alone", [False, True])
def test_replacement_equals_its_twin(device, shape, dark, alone):
    beside = 2
    random = np.random.default_rng(2)
    x = random.poisson(5, shape).astype(np.float32)
    medians = random.integers(3, 7, shape).astype(np.float32)
    limits = random.uniform(0.3, 0.6, shape[1:]).astype(np.float32)
    levels = np.full((shape[1], 2), (1.5, 0.5), np.float32)
    out, run = device.empty(shape), 4096 if device.traits.is_cpu else 1
    size = (-(-shape[2] // run), shape[1], shape[0])
    given = {"x": x, "medians": medians, "limits": limits, "levels": levels}
    arrays = {name: device.array(values) for name, values in given.items()}
    sizes = dict(zip(("views", "rows", "bins"), shape, strict=True))
    macros = {"DARK": int(dark), "ALONE": int(alone), "BINS_BESIDE": beside, "RUN": run}
    device.launch("zinger_replace", size, **arrays, out=out, **sizes, **macros)
    expected = twin.replaced(x, medians, limits, levels, dark=dark, alone=alone, beside=beside)
    np.testing.assert_array_equal(device.get(out), expected)
    assert 0 < np.mean(expected != x) < 1


@pytest.mark.parametrize(
    "shape",
    [(0, 3, 9), (0, 1, 9), (5, 0, 9), (4, 3, 0), (1, 1, 9), (2, 2, 9), (5, 5, 2), (1, 1), (0, 4)],
)
def test_what_is_too_small_to_tell_is_left_alone(shape):
    x = np.random.default_rng(0).random(shape).astype(np.float32) ** 9
    kept, count = remove_zingers(x)
    np.testing.assert_array_equal(kept, x)
    assert count == 0


@pytest.mark.full
@pytest.mark.parametrize("level", [0.7, -0.3])
def test_a_constant_stays_and_a_single_pixel_goes(level):
    even = np.full((20, 6, 30), level, np.float32)
    kept, count = remove_zingers(even, dark=True)
    np.testing.assert_array_equal(kept, even)
    assert count == 0
    struck = even.copy()
    struck[9, 3, 12] += 5
    mended, count = remove_zingers(struck)
    np.testing.assert_array_equal(mended, even)
    assert count == 1


@pytest.mark.parametrize(
    ("stack", "options", "kind", "words"),
    [
        (np.zeros(9), {}, ShapeError, "wanted \\(angle, bin\\) or"),
        (np.full((4, 4, 9), np.nan), {}, NonFiniteError, "stack"),
        (np.ones((4, 4, 9)), {"sigma": 0}, InputError, "sigma is 0"),
        (np.ones((4, 4, 9)), {"sigma": "6"}, InputError, "sigma is '6'"),
        (np.ones((4, 4, 9)), {"excess": -1}, InputError, "excess is -1"),
        (np.ones((4, 4, 9)), {"size": 4}, InputError, "size is 4"),
        (np.ones((4, 4, 9)), {"kind": "counts"}, InputError, "kind is 'counts'"),
    ],
)
def test_what_means_nothing_is_told(stack, options, kind, words):
    with pytest.raises(kind, match=words):
        remove_zingers(stack, **options)


def test_values_that_no_measurement_has_are_told():
    with pytest.raises(InputError, match="beyond 1e\\+18"):
        remove_zingers(np.full((40, 64), -1e30))


def test_any_real_array_will_do():
    x = np.random.default_rng(7).random((40, 3, 64)).astype(np.float32)
    expected = remove_zingers(x)[0]
    for same in (x.astype(">f8"), np.asfortranarray(x), np.repeat(x, 2, axis=2)[:, :, ::2]):
        np.testing.assert_array_equal(remove_zingers(same)[0], expected)
