"""Counts become line integrals, and what a detector did not see is mended or told."""

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.reconstruct import attenuation
from rift_cl.reconstruct.preprocess.flatfield import (
    Attenuation,
    attenuation_without_flats,
    without_stuck,
)


@pytest.fixture
def scan():
    """True line integrals and the counts that a detector with uneven pixels makes of them."""
    random = np.random.default_rng(3)
    truth = random.uniform(0, 3, (7, 2, 30)).astype(np.float32)
    dark = random.uniform(90, 110, (2, 30))
    gain = random.uniform(5e3, 2e4, (2, 30))
    counts = (dark + gain * np.exp(-truth)).astype(np.float32)
    flats = np.repeat((dark + gain)[None], 4, axis=0).astype(np.float32)
    darks = np.repeat(dark[None], 3, axis=0).astype(np.float32)
    return truth, counts, flats, darks


def test_beer_lambert_is_inverted(scan):
    truth, counts, flats, darks = scan
    result = attenuation(counts, flats, darks)
    np.testing.assert_allclose(result.projections, truth, atol=2e-5)
    assert (result.dead, result.starved) == (0, 0)
    assert result.projections.dtype == np.float32


def test_missing_darks_count_as_zero(scan):
    truth, counts, flats, darks = scan
    result = attenuation(counts - darks.mean(axis=0), flats - darks.mean(axis=0))
    np.testing.assert_allclose(result.projections, truth, atol=2e-4)


@pytest.mark.parametrize("value", [0.0, 100.0])
def test_dead_pixels_are_filled_from_their_neighbours(scan, value):
    truth, counts, flats, darks = scan
    truth[:, 1, 10:13] = truth[:, 1, [9]]
    truth[:, 1, 13] = truth[:, 1, 9]
    gain = flats[0] - darks[0]
    counts = darks[0] + gain * np.exp(-truth)
    flats[:, 1, 10:13] = darks[0, 1, 10:13]
    counts[:, 1, 10:13] = value
    result = attenuation(counts.astype(np.float32), flats, darks)
    assert result.dead == 3 and result.dead_bins == (10, 11, 12)
    np.testing.assert_allclose(result.projections, truth, atol=2e-4)


def test_starved_samples_are_filled_along_the_detector_and_counted(scan):
    truth, counts, flats, darks = scan
    truth[2, 0, 4:8] = truth[2, 0, 4]
    counts[2, 0] = darks[0, 0] + (flats[0, 0] - darks[0, 0]) * np.exp(-truth[2, 0])
    counts[2, 0, 5:7] = (0, darks[0, 0, 6])
    result = attenuation(counts, flats, darks)
    assert result.starved == 2
    np.testing.assert_allclose(result.projections, truth, atol=2e-4)


def test_a_view_without_any_signal_is_filled_from_the_views_beside_it(scan):
    truth, counts, flats, darks = scan
    truth[:, 1] = np.linspace(1, 2, 7)[:, None]
    counts[:, 1] = darks[0, 1] + (flats[0, 1] - darks[0, 1]) * np.exp(-truth[:, 1])
    counts[[0, 3, 4], 1] = 0
    truth[0, 1] = truth[1, 1]
    result = attenuation(counts, flats, darks)
    assert result.starved == 90
    np.testing.assert_allclose(result.projections, truth, atol=2e-4)
    counts[:, 1] = 0
    with pytest.raises(InputError, match="row 1"):
        attenuation(counts, flats, darks)


def test_less_than_the_noise_of_the_darks_is_no_signal(scan):
    _, counts, flats, darks = scan
    noisy = darks + np.array([-20, 0, 20], np.float32)[:, None, None]
    counts[4, 0, 9] = darks[0, 0, 9] + 19
    assert attenuation(counts, flats, darks).starved == 0
    assert attenuation(counts, flats, noisy).starved == 1


def test_flats_of_several_times_are_interpolated(scan):
    truth, counts, flats, darks = scan
    gain = flats[0] - darks[0]
    drift = np.interp(np.arange(7) + 0.5, [0, 7], [1, 1.4])[:, None, None]
    counts = (darks[0] + drift * gain * np.exp(-truth)).astype(np.float32)
    flats = darks[0] + gain * np.array([1, 1, 1.4, 1.4], np.float32)[:, None, None]
    result = attenuation(counts, flats, darks, flats_at=np.array([0.0, 0, 7, 7]))
    np.testing.assert_allclose(result.projections, truth, atol=1e-4)
    assert abs(attenuation(counts, flats, darks).projections - truth).max() > 0.1


@pytest.mark.parametrize("frames", [3, 4, 8])
def test_a_zinger_in_one_flat_or_dark_leaves_no_trace(scan, frames):
    truth, counts, flats, darks = scan
    random = np.random.default_rng(9)
    flats = flats[:1] + random.normal(0, 5, (frames, *flats.shape[1:])).astype(np.float32)
    darks = darks[:1] + random.normal(0, 2, (frames, *darks.shape[1:])).astype(np.float32)
    clean = attenuation(counts, flats, darks).projections
    np.testing.assert_allclose(clean, truth, atol=0.02)
    flats[-1, 0, 7] *= 5
    darks[1, 1, 9] += 4000
    np.testing.assert_allclose(attenuation(counts, flats, darks).projections, clean, atol=0.01)


def test_transmission_wants_the_logarithm_alone():
    truth = np.random.default_rng(1).uniform(0, 3, (5, 2, 9)).astype(np.float32)
    result = attenuation_without_flats(np.exp(-truth))
    np.testing.assert_allclose(result.projections, truth, atol=1e-6)
    beam = np.linspace(100, 200, 5)
    counts = (beam[:, None, None] * np.exp(-truth) + 7).astype(np.float32)
    darks = np.full((2, 2, 9), 7, np.float32)
    result = attenuation_without_flats(counts, darks, incident=beam)
    np.testing.assert_allclose(result.projections, truth, atol=1e-5)
    level = attenuation_without_flats(counts, darks).projections - truth
    np.testing.assert_allclose(
        level, np.broadcast_to(-np.log(beam)[:, None, None], level.shape), atol=1e-4
    )


def test_swapped_frames_are_told(scan):
    _, counts, flats, darks = scan
    with pytest.raises(InputError, match=r"row 0.*swapped"):
        attenuation(counts, darks, flats)


@pytest.mark.parametrize("which", ["flats", "darks"])
def test_frames_of_another_detector_are_refused(scan, which):
    _, counts, flats, darks = scan
    frames = {"flats": flats, "darks": darks}
    frames[which] = frames[which][..., :-1]
    with pytest.raises(ShapeError, match=which):
        attenuation(counts, **frames)


def test_no_flat_frame_is_told(scan):
    _, counts, flats, darks = scan
    with pytest.raises(InputError, match="no flat frame"):
        attenuation(counts, flats[:0], darks)


def _turning(views=180, bins=64, turn=np.pi):
    """Line integrals of two discs, (angle, 2 rows, bin), and the angles."""
    angles = np.arange(views) * turn / views
    u = np.arange(bins) - (bins - 1) / 2
    lines = 0.0
    for place, radius in ((0.2, 0.3), (-0.25, 0.12)):
        off = u - place * bins * np.cos(angles)[:, None]
        lines = lines + 0.1 * np.sqrt(np.maximum((radius * bins) ** 2 - off**2, 0))
    return np.repeat(lines[:, None].astype(np.float32), 2, axis=1), angles


def _found(lines):
    none = np.zeros(lines.shape[1], np.int64)
    return Attenuation(lines.copy(), none, none)


@pytest.mark.parametrize("value", [0.0, 1.5])
@pytest.mark.parametrize("stuck", [[30], [20, 41], [30, 31, 32]])
def test_pixels_that_read_the_same_in_all_views_are_filled(stuck, value):
    truth, angles = _turning()
    broken = truth.copy()
    broken[:, 1, stuck] = value
    found = without_stuck(_found(broken), angles)
    assert found.dead_bins == found.stuck_bins == tuple(stuck)
    assert found.dead_of_rows.tolist() == [0, len(stuck)]
    np.testing.assert_array_equal(found.projections[:, 0], truth[:, 0])
    assert np.abs(found.projections - truth).max() < 0.25 * truth.max()
    others = np.delete(np.arange(64), stuck)
    np.testing.assert_array_equal(found.projections[..., others], truth[..., others])


def test_air_without_noise_is_no_stuck_pixel():
    """Between two fringes far from the object, and where float32 rounds about 1."""
    truth, angles = _turning()
    fringes = truth.copy()
    fringes[..., [2, 5]] = 1e-5 * np.sin(angles)[:, None, None]
    fringes[..., 3:5] = 0
    rounded = np.zeros_like(truth)
    rounded[..., [10, 50]] = np.where(np.arange(len(angles)) % 3, 0, 1.2e-7)[:, None, None]
    rounded[..., 20:45] = np.where(np.arange(25) % 2, 1.2e-7 * np.sin(angles)[:, None, None], 0)
    for lines in (fringes, rounded):
        found = without_stuck(_found(lines), angles)
        np.testing.assert_array_equal(found.projections, lines)
        assert found.dead_bins == () and found.dead == 0


def test_bins_that_may_read_the_same_are_left_as_they_are():
    truth, angles = _turning()
    air = truth.copy()
    air[..., :6] = air[..., -6:] = 0.3
    disc = np.repeat(truth[:1], 180, axis=0)
    few, wedge = truth[:6].copy(), truth[:60].copy()
    few[..., 30] = wedge[..., 30] = 0
    for lines, at in ((air, angles), (disc, angles), (few, angles[:6]), (wedge, angles[:60])):
        found = without_stuck(_found(lines), at)
        np.testing.assert_array_equal(found.projections, lines)
        assert found.dead_bins == () and found.dead == 0
