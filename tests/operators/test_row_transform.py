"""Long rows, and rows with filters of their own: what transforms give is what convolution gives."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl import Parallel, Ramp, dot_test
from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.operators import ViewFilter
from rift_cl.operators.filters.row_convolution import SHORT_ROW, RowConvolution
from rift_cl.operators.fourier import row_transform
from rift_cl.operators.fourier.row_transform import RowTransform, transform_length
from rift_cl.reference import filter_rows, ramp_taps

pytestmark = [pytest.mark.dealt, pytest.mark.variants]

PITCH = 0.7
RANDOM = np.random.default_rng(12)


def relative(value, truth):
    return np.linalg.norm(value - truth) / np.linalg.norm(truth)


def kernels(filters, bins):
    """Halves of symmetric kernels, and the whole."""
    halves = np.random.default_rng(bins).standard_normal((filters, bins))
    return halves, np.concatenate([halves[:, :0:-1], halves], axis=1)


def sharpness(frequencies):
    """Gains of seven views: none, all, and more and more of the high frequencies."""
    more = (1 + k * frequencies for k in range(1, 6))
    return np.stack([0 * frequencies, 0 * frequencies + 1, *more])


def seven(rows, device, dtype="float32", bins=61):
    scan = Parallel(np.arange(7.0), bins, PITCH)
    return ViewFilter(scan, Ramp(), rows=rows, gains=sharpness, device=device, dtype=dtype)


@pytest.mark.parametrize("bins", [*range(1, 20), 97, 256, 1000, 2047, 2048, 2049, 6500])
def test_lengths_hold_the_row_and_are_products_of_twos_and_threes(bins):
    length = transform_length(bins)
    assert bins <= length <= 1.34 * bins + 1
    for prime in (2, 3):
        while length % prime == 0:
            length //= prime
    assert length == 1


@pytest.mark.parametrize("bins", [1, 2, 3, 7, 8, 9, 13, 48, 64, 65, 130])
@pytest.mark.parametrize(("views", "rows"), [(1, 1), (5, 1), (3, 3), (11, 2)])
def test_transforms_equal_convolution(device, bins, views, rows):
    halves, taps = kernels(views, bins)
    y = RANDOM.standard_normal((views, rows, bins)).astype(np.float32)
    gains = RANDOM.standard_normal(views)
    for count in (1, views):
        F = RowTransform(device, halves[:count], views * rows)
        out = device.empty(y.shape)
        F(device.array(y), out, device.array(gains), rows)
        # 2e-7 measured.
        assert relative(device.get(out), filter_rows(y, taps[:count], 1.0, gains)) <= 1e-6


def test_real_space_and_fourier_space_give_the_same(device):
    """On what a scan looks like: smooth, positive, far from zero."""
    bins = SHORT_ROW
    t = np.linspace(-1, 1, bins)
    y = np.stack([np.sqrt(np.maximum(0, s * s - t * t)) for s in (0.5, 0.9, 2.0)]).astype(
        np.float32
    )
    half = ramp_taps(bins, 1.0)[None, bins - 1 :]
    x, gains = device.array(y), device.array(np.ones(3))
    results = []
    for way in (RowConvolution(device, half), RowTransform(device, half, 3)):
        out = device.empty(y.shape)
        way(x, out, gains, 1)
        results.append(device.get(out))
    # The same rounding, in another order: 4e-7 of the largest number measured.
    np.testing.assert_allclose(results[0], results[1], atol=2e-6 * abs(results[0]).max())
    exact = filter_rows(y, ramp_taps(bins, 1.0), 1.0)
    errors = [relative(result, exact) for result in results]
    assert max(errors) <= 3e-6


def test_long_rows_are_filtered_without_wrap_around(device):
    bins = SHORT_ROW + 117
    F = ViewFilter(Parallel([0.0, 1.0], bins, PITCH), Ramp(), device=device)
    ends = np.zeros((2, bins))
    ends[0, 0] = ends[1, -1] = 1
    h = PITCH * ramp_taps(bins, PITCH)
    np.testing.assert_allclose(F(ends), [h[bins - 1 :], h[:bins]], atol=1e-6 * h.max())


def test_a_constant_view_has_its_level(device):
    """The sum of the ramp's taps within the row, which only an exact value at zero gives."""
    bins = 1001
    F = ViewFilter(Parallel([0.0], bins, PITCH), Ramp(), device=device)
    middle = F(np.ones((1, bins)))[0, bins // 2]
    assert middle * PITCH == pytest.approx(2 / (np.pi**2 * bins), rel=0.02)


def test_gains_of_one_change_nothing(device):
    scan = Parallel(np.arange(4.0), 90, PITCH)
    y = RANDOM.standard_normal((4, 90)).astype(np.float32)
    # Windowed taps depend, by some 1e-6, on how far the ramp's own are taken.
    for filter, tolerance in ((Ramp(), 1e-6), (Ramp("hann", 0.7), 1e-5)):
        plain = ViewFilter(scan, filter, device=device)(y)
        gains = ViewFilter(scan, filter, gains=lambda f: np.ones((4, f.size)), device=device)
        assert relative(gains(y), plain) <= tolerance


@pytest.mark.parametrize("rows", [None, 1, 3])
def test_views_have_filters_of_their_own(device, rows):
    F = seven(rows, device)
    y = RANDOM.standard_normal(F.domain).astype(np.float32)
    z = F(y)
    assert not z[0].any()
    plain = ViewFilter(Parallel(np.arange(7.0), 61, PITCH), Ramp(), rows=rows, device=device)(y)
    assert relative(z[1], plain[1]) <= 1e-6
    edge = [np.linalg.norm(z[k]) / np.linalg.norm(plain[k]) for k in range(2, 7)]
    assert (np.diff(edge) > 0.1).all()


@pytest.mark.parametrize("rows", [None, 3])
def test_filters_of_their_own_are_their_own_adjoint(device, rows):
    F = seven(rows, device)
    assert dot_test(F, seed=6) <= 1e-6
    y = RANDOM.standard_normal(F.domain)
    assert np.array_equal(F.T(y), F(y))


def test_rows_do_not_touch_a_bit_of_each_other(device):
    F, one = seven(5, device), seven(None, device)
    y = RANDOM.standard_normal(F.domain).astype(np.float32)
    z = F(y)
    for row in range(5):
        assert np.array_equal(one(y[:, row]), z[:, row])
    y[:, 1] = 0
    assert not F(y)[:, 1].any()
    y[:, 1] = 1e30
    assert np.array_equal(F(y)[:, 2], z[:, 2])


def test_slabs_give_the_same_bits(device, monkeypatch):
    F = seven(5, device)
    y = RANDOM.standard_normal(F.domain).astype(np.float32)
    monkeypatch.setattr(row_transform, "_SLAB_BYTES", {"cpu": 1, "gpu": 4096})
    assert np.array_equal(seven(5, device)(y), F(y))


def test_chunks_give_the_same_bits(device, monkeypatch):
    monkeypatch.setattr(row_transform, "_SLAB_BYTES", {"cpu": 1, "gpu": 4096})
    F = seven(40, device)
    y = RANDOM.standard_normal(F.domain).astype(np.float32)
    whole = F(y)
    monkeypatch.setattr(rift.Device, "budget", F.scratch + y.nbytes // 2)
    assert len(list(F._chunks(F.scratch + y.nbytes // 2))) >= 4
    assert np.array_equal(F(y), whole)
    with pytest.raises(ResourceLimitError):
        list(F._chunks(1000))


@pytest.mark.parametrize("bins", [97, 500])
@pytest.mark.parametrize("gains", [None, sharpness])
def test_doubles_are_filtered_as_doubles(device, bins, gains):
    if not device.traits.fp64:
        pytest.skip("a device without doubles")
    scan = Parallel(np.arange(7.0), bins, PITCH)
    F = ViewFilter(scan, Ramp(), gains=gains, device=device, dtype="float64")
    y = RANDOM.standard_normal(F.domain)
    views = slice(0, 7) if gains is None else slice(1, 2)
    exact = filter_rows(y, ramp_taps(bins, PITCH), PITCH)
    assert relative(F(y)[views], exact[views]) <= 1e-14
    assert dot_test(F, seed=1) <= 1e-14


@pytest.mark.parametrize(
    "gains",
    [
        lambda f: f,
        lambda f: np.ones((3, f.size)),
        lambda f: np.full((2, f.size), np.nan),
        lambda f: 1.0,
        lambda f: np.ones((2, f.size + 1)),
    ],
)
def test_functions_that_give_no_gains_are_refused(device, gains):
    with pytest.raises(InputError, match="gains"):
        ViewFilter(Parallel([0.0, 1.0], 30), Ramp(), gains=gains, device=device)
