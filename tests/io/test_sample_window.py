"""The arithmetic of windows: both ends, rounding, clipping, and a window that suits a volume."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import NonFiniteError, ShapeError
from rift_cl.io.volumes import SampleWindow, suggested_window, whole_window

DTYPES = pytest.mark.parametrize("dtype", ["uint8", "uint16"])


@DTYPES
@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-0.013, 0.0471), (1e-7, 3e-7), (-5e4, 2e5)])
def test_both_ends_and_every_level_between(dtype: str, low: float, high: float) -> None:
    window = SampleWindow(dtype, low, high)
    levels = np.iinfo(dtype).max
    every = np.arange(levels + 1, dtype=dtype)[None]
    values = window.values(every[None])[0]
    assert values[0, 0] == np.float32(low)
    assert values[0, -1] == pytest.approx(high, rel=1e-7)
    stored, below, above = window.integers(values)
    np.testing.assert_array_equal(stored, every)
    assert (below, above) == (0, 0)
    # Just short of half a step to either side it is still the same integer.
    for share in (-0.49, 0.49):
        moved = (values + share * window.step).astype(np.float32)
        exact = np.rint((moved.astype(np.float64) - low) / window.step)
        np.testing.assert_array_equal(window.integers(moved)[0], np.clip(exact, 0, levels))


def test_rounding_and_clipping() -> None:
    window = SampleWindow("uint8", 0.0, 255.0)
    values = [-9.0, -0.51, -0.5, 0.49, 0.5, 0.51, 1.5, 2.5, 254.5, 255.5, 255.51, np.inf, -np.inf]
    stored, below, above = window.integers(np.array([values], np.float32))
    assert stored.tolist() == [[0, 0, 0, 0, 0, 1, 2, 2, 254, 255, 255, 255, 0]]
    # 255.5 rounds to 256, which is no byte.
    assert (below, above) == (3, 3)


def test_many_lines() -> None:
    image = np.random.default_rng(1).random((70, 3), dtype=np.float32)
    stored, _, _ = SampleWindow("uint16", 0.0, 1.0).integers(image)
    np.testing.assert_array_equal(stored, np.rint(image.astype(np.float64) * 65535))


def test_a_window_that_suits() -> None:
    noise = np.random.default_rng(2).normal(0, 0.01, (3, 500, 500))
    slices = np.zeros((3, 500, 500))
    slices[:, 100:400, 100:400] = 0.7
    slices[0, 0, 0] = 1e6  # one bad sample
    low, high = suggested_window(slices + noise)
    assert -0.14 < low < -0.09
    assert 0.79 < high < 0.84
    # Round numbers.
    assert (low, high) == (round(low, 3), round(high, 3))


def test_a_window_of_the_whole_volume() -> None:
    slices = np.random.default_rng(2).normal(0, 0.01, (3, 50, 50))
    assert whole_window(slices, -0.07, 0.5) == (-0.07, 0.5)
    # One value far off leaves the others 2048 integers.
    low, high = whole_window(slices, -0.07, 1e6)
    assert low == -0.07 and high > 1 and np.ptp(slices) / (high - low) * 65535 > 1500
    constant = np.full((1, 5, 5), 0.3)
    low, high = whole_window(constant, 0.3, 0.3)
    assert low < 0.3 < high


@pytest.mark.parametrize("level", [0.0, -3.0, 1e-4, 100.0])
def test_a_window_about_a_constant(level: float) -> None:
    low, high = suggested_window([np.full((5, 5), level, np.float32)])
    assert low < level < high
    SampleWindow("uint16", low, high)


def test_slices_that_suggest_nothing() -> None:
    with pytest.raises(ShapeError):
        suggested_window([])
    with pytest.raises(NonFiniteError):
        suggested_window([np.full((2, 2), np.nan)])
