"""Regions and bands of pictures by their definitions, pixel by pixel, and FLIP's plain cases."""

from __future__ import annotations

import itertools
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl import metrics
from rift_cl.errors import DTypeError, InputError, NonFiniteError, RiftError, ShapeError


@pytest.fixture
def photograph():
    """A disc before grey: half of it noisy, with a white spot; its foreground."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:30, :34]
    front = (y - 15) ** 2 + (x - 16) ** 2 < 100
    image = np.full((30, 34, 3), 0.5)
    image[front] = 0.3
    noisy = front & (x > 16)
    image[noisy] += rng.uniform(-0.1, 0.1, (np.count_nonzero(noisy), 3))
    image[11:14, 9:13] = 0.95
    return image, front


def told(image, front, counted, at):
    """The region of a pixel from its definition."""
    y, x = at
    if not counted[at]:
        return None
    about = np.s_[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3]
    near = front[about][counted[about]]
    if near.any() and not near.all():
        return "silhouette"
    if not front[at]:
        return "background"
    luma = image @ np.array([0.2126, 0.7152, 0.0722])
    middle = np.median(luma[front & counted])
    if luma[at] >= middle + (1 - middle) / 2:
        return "highlights"
    square = np.pad(luma, 2, mode="symmetric")[y : y + 5, x : x + 5]
    return "texture" if square.std() > 0.02 else "smooth"


def test_every_pixel_is_in_the_first_region_that_fits(photograph):
    image, front = photograph
    counted = np.ones(front.shape, bool)
    counted[:, :8] = False
    found = metrics.photograph_regions(image, front, counted)
    assert tuple(found) == metrics.REGIONS
    for at in np.ndindex(front.shape):
        names = [name for name, mask in found.items() if mask[at]]
        wanted = told(image, front, counted, at)
        assert names == ([] if wanted is None else [wanted]), at
    assert all(mask.any() for mask in found.values())


def test_without_a_foreground_there_is_no_silhouette_and_no_background(photograph):
    found = metrics.photograph_regions(photograph[0])
    assert not found["silhouette"].any() and not found["background"].any()
    assert np.sum(list(found.values()), axis=0).min() == 1


def test_the_edge_of_what_counts_is_no_silhouette(photograph):
    """A mask that cuts an object, or that is the object, is no border of it."""
    image, front = photograph
    assert not metrics.photograph_regions(image, front, front)["silhouette"].any()


def test_a_matte_photograph_has_no_highlights(photograph):
    image, front = photograph
    found = metrics.photograph_regions(np.minimum(image, 0.5), front)
    assert not found["highlights"].any()
    assert not metrics.photograph_regions(image, np.zeros_like(front))["highlights"].any()


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ((np.zeros((4, 4)),), ShapeError, "photograph"),
        ((np.full((4, 4, 3), np.nan),), NonFiniteError, "photograph"),
        ((np.zeros((4, 4, 3)), np.ones((4, 4))), DTypeError, "foreground"),
        ((np.zeros((4, 4, 3)), None, np.ones((4, 5), bool)), ShapeError, "counted"),
    ],
)
def test_what_is_no_photograph_or_mask_is_named(arguments, error, words):
    with pytest.raises(error, match=words):
        metrics.photograph_regions(*arguments)


def test_powers_of_all_bands_add_up_to_the_sum_of_squares():
    image = np.random.default_rng(2).standard_normal((13, 20, 3))
    assert metrics.band_power(image).sum() == pytest.approx((image**2).sum(), rel=1e-12)
    assert metrics.band_power(image[..., 0]).shape == (len(metrics.BAND_EDGES) - 1,)


@pytest.mark.parametrize("direction", [(1, 0), (0, 1), (1, 1)])
def test_a_wave_is_in_the_band_of_its_frequency(direction):
    y, x = np.mgrid[:40, :40] + 0.5
    for band, (low, high) in enumerate(itertools.pairwise(metrics.BAND_EDGES)):
        # Whole half periods across the picture, in the middle of the band.
        half = round(80 * (low + min(high, 0.5)) / 2 / math.hypot(*direction))
        wave = np.cos(np.pi * half * direction[0] * y / 40) * np.cos(
            np.pi * half * direction[1] * x / 40
        )
        power = metrics.band_power(wave)
        assert power[band] == pytest.approx((wave**2).sum(), rel=1e-9)


def test_a_jump_between_opposite_borders_is_no_high_frequency():
    ramp = np.broadcast_to(np.linspace(-1, 1, 64), (8, 64))
    power = metrics.band_power(ramp)
    assert power[0] > 0.99 * power.sum()


def test_what_has_no_bands_is_refused():
    with pytest.raises(ShapeError, match="image"):
        metrics.band_power(np.zeros(4))


def test_flip_is_nothing_for_equal_pictures_and_nearly_all_for_black_and_white():
    pytest.importorskip("flip_evaluator")
    image = np.random.default_rng(1).random((16, 20, 3), np.float32)
    white = np.ones_like(image)
    assert metrics.flip(image, image) == 0
    assert 0.9 < metrics.flip(0 * white, white) <= 1
    # A smaller error counts less, and so does one that is seen from further away.
    noise = np.random.default_rng(2).uniform(-0.1, 0.1, image.shape)
    far, near = (metrics.flip(image + noise, image, pixels_per_degree=p) for p in (200, 20))
    assert 0 < far < near < metrics.flip(image + 2 * noise, image, pixels_per_degree=20) < 1


def test_flip_of_a_part_is_the_mean_of_its_map_there(monkeypatch):
    """Of those of its pixels whose filters, that reach 10 of them, see no other."""
    errors = np.random.default_rng(3).random((40, 50, 1), np.float32)
    module = SimpleNamespace(evaluate=lambda *pair, **more: (errors, 0.25, {}))
    monkeypatch.setitem(sys.modules, "flip_evaluator", module)
    image, mask = np.zeros((40, 50, 3)), np.zeros((40, 50), bool)
    mask[3:30, :13] = True
    assert metrics.flip(image, image) == 0.25
    wanted = errors[13:20, :3].mean(dtype=float)
    assert metrics.flip(image, image, mask=mask) == pytest.approx(wanted, abs=1e-12)
    thin = mask & (np.arange(50) < 10)
    for wrong, words in (
        (0 * mask, "bool"),
        (mask[1:], "mask has shape"),
        (mask & False, "false"),
        (thin, "filters"),
    ):
        with pytest.raises(RiftError, match=words):
            metrics.flip(image, image, mask=wrong)


@pytest.mark.parametrize("degrees", [67.0, 20.0])
def test_pixels_that_do_not_count_have_no_part_in_flip(degrees):
    """The reach of its filters is that of the package which computes it."""
    pytest.importorskip("flip_evaluator")
    rng = np.random.default_rng(0)
    truth = rng.random((48, 60, 3))
    image = np.clip(truth + 0.1 * rng.standard_normal(truth.shape), 0, 1)
    y, x = np.mgrid[:48, :60]
    mask = (y - 24) ** 2 + (x - 30) ** 2 < 18**2
    scores = [
        metrics.flip(*hidden, mask=mask, pixels_per_degree=degrees)
        for hidden in (
            (image, truth),
            [np.where(mask[..., None], array, 1) for array in (image, truth)],
            (image, np.where(mask[..., None], truth, 0)),
        )
    ]
    # The package sums in float32.
    assert scores[1:] == pytest.approx(scores[:1] * 2, rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "degrees", "words"),
    [
        ((np.zeros((4, 4)), np.zeros((4, 4))), 67, "shape"),
        ((np.zeros((4, 4, 3)), np.zeros((4, 5, 3))), 67, "shape"),
        ((np.zeros((4, 4, 3)), np.zeros((4, 4, 3))), 0, "pixels_per_degree"),
    ],
)
def test_flip_names_what_it_cannot_take(arguments, degrees, words):
    with pytest.raises(RiftError, match=words):
        metrics.flip(*arguments, pixels_per_degree=degrees)


def test_flip_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(InputError, match="pip install flip-evaluator"):
        metrics.flip(np.zeros((4, 4, 3)), np.zeros((4, 4, 3)))
