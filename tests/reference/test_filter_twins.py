"""The filters' twins against each other: closed forms, quadrature, sums written out."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.reference import filter_rows, ramp_taps, response_taps, shepp_logan_taps


@pytest.mark.parametrize(("bins", "pitch"), [(1, 1.0), (2, 0.3), (40, 1.0), (41, 7.3)])
def test_closed_forms_are_the_integral_of_the_response(bins, pitch):
    ramp = response_taps(lambda f: f, bins, pitch)
    np.testing.assert_allclose(ramp_taps(bins, pitch), ramp, atol=1e-14 / pitch**2)
    sine = response_taps(lambda f: np.sin(np.pi * f * pitch) / (np.pi * pitch), bins, pitch)
    np.testing.assert_allclose(shepp_logan_taps(bins, pitch), sine, atol=1e-14 / pitch**2)


def test_filtering_is_the_sum_written_out():
    random = np.random.default_rng(1)
    y, h = random.standard_normal((2, 3, 6)), random.standard_normal(11)
    filtered = filter_rows(y, h, 0.5, [1, -3])
    expected = np.zeros_like(y)
    for (view, row, b), _ in np.ndenumerate(y):
        gain = (1, -3)[view]
        expected[view, row, b] = sum(gain * 0.5 * h[b - c + 5] * y[view, row, c] for c in range(6))
    np.testing.assert_allclose(filtered, expected)
