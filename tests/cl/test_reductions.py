"""Inner products and sums: right to the last digits, and the same bits every time."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.cl.elementwise import clip_negative, copy, multiply
from rift_cl.cl.reductions import dot, norm, total

RANDOM = np.random.default_rng(12)
SIZES = [0, 1, 7, 4095, 4096, 33333, 1_200_001]


@pytest.mark.parametrize("size", SIZES)
def test_sums_do_not_lose_to_their_length(device, size):
    x, y = RANDOM.standard_normal((2, size)).astype(np.float32)
    x += 1000
    there = device.array(x), device.array(y)
    x, y = x.astype(float), y.astype(float)
    scale = np.linalg.norm(x) * np.linalg.norm(y)
    assert abs(dot(device, *there) - x @ y) <= 1e-7 * scale
    assert total(device, there[0]) == pytest.approx(x.sum(), rel=1e-7)
    assert norm(device, there[0]) == pytest.approx(np.linalg.norm(x), rel=1e-7)
    assert dot(device, *there) == dot(device, *there)


def test_cancellation_is_survived(device):
    """A large number, many small ones, and the large one taken away again."""
    x = np.full(100_001, 0.25, np.float32)
    x[0], x[-1] = 3e7, -3e7
    assert total(device, device.array(x)) == 0.25 * 99_999


def test_doubles_are_summed_as_doubles(device):
    if not device.traits.fp64:
        pytest.skip("a device without float64")
    x, y = RANDOM.standard_normal((2, 54321))
    found = dot(device, device.array(x, "float64"), device.array(y, "float64"))
    assert abs(found - x @ y) <= 1e-14 * np.linalg.norm(x) * np.linalg.norm(y)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_shows(device, value):
    x = np.ones(10_000, np.float32)
    x[777] = value
    assert not np.isfinite(dot(device, device.array(x), device.array(x)))
    x[9_000] = -value
    assert not np.isfinite(total(device, device.array(x)))


@pytest.mark.parametrize("power", [-110, -60, 60, 100])
def test_products_beyond_float32_are_summed_as_well_as_others(device, power):
    x, y = RANDOM.standard_normal((2, 54_321)).astype(np.float32)
    scaled = [device.array(np.ldexp(values, power)) for values in (x, y)]
    found = dot(device, *scaled)
    assert found == pytest.approx(
        np.ldexp(dot(device, device.array(x), device.array(y)), 2 * power)
    )


def test_what_cancels_is_not_taken_for_faint(device):
    x = np.full(10_000, 1e15, np.float32)
    y = np.where(np.arange(x.size) % 2, 1, -1).astype(np.float32)
    assert dot(device, device.array(x), device.array(y)) == 0


@pytest.mark.parametrize("size", SIZES)
def test_copies_products_and_clipping(device, size):
    w, y = RANDOM.standard_normal((2, size)).astype(np.float32)
    there = device.empty(size)
    copy(device, device.array(y), there)
    assert np.array_equal(device.get(there), y)
    multiply(device, device.array(w), there)
    assert np.array_equal(device.get(there), w * y)
    clip_negative(device, there)
    assert np.array_equal(device.get(there), np.maximum(w * y, 0))
