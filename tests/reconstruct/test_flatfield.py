"""Counts become line integrals, and what a detector did not see is mended or told."""

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.reconstruct import attenuation


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
    assert result.dead == 3
    np.testing.assert_allclose(result.projections, truth, atol=2e-4)


def test_starved_samples_are_bounded_and_counted(scan):
    _, counts, flats, darks = scan
    counts[2, 0, 5] = 0
    result = attenuation(counts, flats, darks)
    assert result.starved == 1
    assert np.isfinite(result.projections).all()
    assert result.projections[2, 0, 5] == result.projections.max()


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
