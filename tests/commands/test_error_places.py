"""Where pictures err: shares that add up, bands of known errors, views in bins."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.commands.fit_photos.error_places import ErrorPlaces, by_distance, by_elevation
from rift_cl.metrics import psnr


@pytest.fixture
def pictures():
    """Two pictures with errors, their truths and foregrounds."""
    random = np.random.default_rng(8)
    truths = random.random((2, 24, 28, 3), np.float32)
    front = np.zeros((24, 28), bool)
    front[6:18, 8:20] = True
    return truths + 0.1 * random.standard_normal(truths.shape).astype(np.float32), truths, front


def places(pictures, counted=None):
    images, truths, front = pictures
    first, second = (
        ErrorPlaces.of(image, truth, counted, front)
        for image, truth in zip(images, truths, strict=True)
    )
    return first + second


def test_shares_add_up_and_the_mean_of_regions_is_the_whole_pictures(pictures):
    images, truths, _ = pictures
    found = places(pictures)
    regions, bands = found.region_record(), found.band_record()
    for name in ("pixels", "error"):
        assert sum(row[name] for row in regions) == pytest.approx(1)
    assert sum(row["error"] for row in bands) == pytest.approx(1)
    whole = sum(row["pixels"] * 10 ** (-row["psnr"] / 10) for row in regions)
    assert -10 * math.log10(whole) == pytest.approx(psnr(images, truths))


def test_pixels_that_do_not_count_are_in_no_region_and_no_band(pictures):
    counted = np.zeros((24, 28), bool)
    counted[:, 10:] = True
    images, truths, front = pictures
    wrong = np.where(counted[..., None], images, 5.0).astype(np.float32)
    found = places((wrong, truths, front), counted), places(pictures, counted)
    for one, other in zip(found[0].region_record(), found[1].region_record(), strict=True):
        assert one == pytest.approx(other)
    assert found[0].bands == pytest.approx(found[1].bands)
    assert found[0].samples.sum() == 2 * 3 * np.count_nonzero(counted)


def test_a_blurred_picture_lacks_power_where_it_errs(pictures):
    truths, front = pictures[1], pictures[2]
    flat = np.broadcast_to(truths.mean(axis=(1, 2), keepdims=True), truths.shape)
    bands = places((flat, truths, front)).band_record()
    for band in bands[1:]:
        assert band["relative_power"] == pytest.approx(0, abs=1e-9)
        assert band["relative_error_db"] == pytest.approx(0, abs=1e-9)


def test_a_perfect_picture_errs_nowhere(pictures):
    found = places((pictures[1], *pictures[1:]))
    assert all(row["psnr"] == math.inf and row["error"] == 0 for row in found.region_record())
    assert all(row["relative_error_db"] is None for row in found.band_record())


def test_views_are_taken_together_by_elevation_and_distance():
    found = by_elevation([(12.0, 30.0), (14.0, 32.0), (90.0, 20.0), (math.nan, 1.0), (3, math.inf)])
    assert [(b["from"], b["to"], b["views"]) for b in found] == [(10, 15, 2), (85, 90, 1)]
    assert found[0]["at"] == 13 and found[0]["psnr"] == 31
    found = by_distance([(0.0, 40.0), (0.03, 30.0), (1.5, 20.0)])
    assert [(b["from"], b["to"]) for b in found] == [(0, 0.01), (0.02, 0.05), (1.0, None)]
    assert by_distance([]) == []
