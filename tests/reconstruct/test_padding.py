"""Projections that end before the object does: the border of the field of view stays level."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.reconstruct.direct.padding import extended, is_truncated

SIZE, BINS, VIEWS = 160, 80, 240
ANGLES = np.arange(VIEWS) * np.pi / VIEWS
SCAN = rift.Parallel(ANGLES, BINS)


@pytest.fixture(scope="module")
def truncated():
    return rift.phantom.shepp_logan_sinogram(rift.Grid((SIZE, SIZE)), SCAN).astype(np.float32)


def test_the_border_of_a_truncated_slice_stays_level(truncated):
    grid = rift.Grid((BINS, BINS))
    cut = (SIZE - BINS) // 2
    truth = rift.phantom.shepp_logan(rift.Grid((SIZE, SIZE)))[cut:-cut, cut:-cut]
    radius = np.hypot(grid.coordinates(0)[:, None], grid.coordinates(1))
    border = (radius > 0.85 * BINS / 2) & (radius < 0.97 * BINS / 2)
    longer, wide = extended(truncated, SCAN, bins=BINS // 2)
    plain = rift.fbp(rift.Projector(grid, SCAN), truncated) - truth
    padded = rift.fbp(rift.Projector(grid, wide), longer) - truth
    assert plain[border].mean() > 0.3
    assert abs(padded[border].mean()) < 0.2 * plain[border].mean()


def test_what_was_measured_stays_and_falls_off_smoothly(truncated):
    longer, wide = extended(truncated, SCAN, bins=30)
    np.testing.assert_array_equal(longer[:, 30:-30], truncated)
    assert wide.center == SCAN.center + 30
    np.testing.assert_allclose(wide.coordinates()[30:-30], SCAN.coordinates())
    assert np.all(np.abs(longer[:, [0, -1]]) < 0.01 * truncated.max())
    assert np.all(np.diff(longer[:, :30], axis=1) >= 0)


def test_an_object_inside_the_detector_changes_nothing():
    grid = rift.Grid((56, 56))  # its corners are seen by every view
    inside = rift.phantom.shepp_logan_sinogram(grid, SCAN).astype(np.float32)
    longer, wide = extended(inside, SCAN)
    assert not longer[:, :BINS].any()
    a = rift.fbp(rift.Projector(grid, SCAN), inside)
    b = rift.fbp(rift.Projector(grid, wide), longer)
    np.testing.assert_allclose(a, b, atol=1e-5)


def test_truncation_is_told(truncated):
    inside = rift.phantom.shepp_logan_sinogram(rift.Grid((64, 64)), SCAN)
    noise = np.random.default_rng(0).normal(0, 0.03 * inside.max(), inside.shape)
    assert is_truncated(truncated)
    assert is_truncated(truncated[:, None, : BINS // 2])
    assert not is_truncated((inside + noise).astype(np.float32))
    assert not is_truncated(np.zeros((4, 8), np.float32))


@pytest.mark.parametrize("air", [1, 3])
def test_rows_of_air_have_no_say_in_truncation(truncated, air):
    inside = rift.phantom.shepp_logan_sinogram(rift.Grid((64, 64)), SCAN).astype(np.float32)
    for sinogram, cut in ((truncated, True), (inside, False)):
        stack = np.pad(sinogram[:, None], [(0, 0), (air, air), (0, 0)])
        stack += np.random.default_rng(1).normal(0, 0.01, stack.shape).astype(np.float32)
        assert is_truncated(stack) == cut
    # A projection of an object on its axis is the same in every view.
    disc = np.sqrt(np.maximum(60**2 - (np.arange(BINS) - 39.5) ** 2, 0)).astype(np.float32)
    stack = np.pad(np.tile(disc, (9, 1, 1)), [(0, 0), (air, air), (0, 0)])
    assert is_truncated(stack)


def test_nothing_added_is_nothing_changed(truncated):
    same, scan = extended(truncated, SCAN, bins=0)
    np.testing.assert_array_equal(same, truncated)
    assert scan == SCAN
    with pytest.raises(InputError, match="bins"):
        extended(truncated, SCAN, bins=-1)
