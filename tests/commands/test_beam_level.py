"""Ends of the detector that see air are told from an object that covers the detector."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.commands.inputs.beam_level import beam_level

VIEWS, BINS = 120, 100
HALF = BINS / 2
ANGLES = np.arange(VIEWS) * np.pi / VIEWS
BIN = np.arange(BINS) - (BINS - 1) / 2


def ellipse(across, along, x=0.0, y=0.0, density=1.0):
    """Line integrals (view, bin) of an ellipse with these half axes."""
    cosine, sine = np.cos(ANGLES)[:, None], np.sin(ANGLES)[:, None]
    reach = (across * cosine) ** 2 + (along * sine) ** 2
    place = BIN - (x * cosine + y * sine)
    chord = np.sqrt(np.maximum(reach - place**2, 0))
    return density * 2 * across * along * chord / reach


def plate(across, along):
    """Line integrals (view, bin) of a rectangle with these half sides."""
    cosine, sine = np.abs(np.cos(ANGLES))[:, None], np.abs(np.sin(ANGLES))[:, None]
    far, near = across * cosine + along * sine, np.abs(across * cosine - along * sine)
    longest = 2 * np.minimum(across / np.maximum(sine, 1e-9), along / np.maximum(cosine, 1e-9))
    ramp = (far - np.abs(BIN)) / np.maximum(far - near, 1e-9)
    return longest * np.clip(ramp, 0, 1)


def counted(lines, photons=20000, beam=1.0):
    """Line integrals of 2 at most, with the noise of photons and the level of a beam."""
    random = np.random.default_rng(0)
    signal = photons * np.reshape(beam, (-1, 1)) * np.exp(-2 * lines / lines.max())
    return -np.log(np.maximum(random.poisson(signal), 0.5) / photons).astype(np.float32)


WHOLE = ellipse(35, 25, 5, 3) + ellipse(6, 4, -10, 8, 3.0)
COVERED = {
    **{f"disc {share}": ellipse(share * HALF, share * HALF) for share in (1.02, 1.2, 2, 5)},
    **{f"ellipse {share}": ellipse(share * HALF, 15) for share in (1.1, 1.5, 3)},
    **{f"plate {share}": plate(share * HALF, 10) for share in (1.1, 1.5, 3)},
    "core with a grain": ellipse(60, 60) + ellipse(15, 10, 5, 3, 6.0),
    "parts": ellipse(90, 40, 20, 30) + ellipse(8, 5, -30, 20, 4.0),
    "at one end": ellipse(30, 20, 30, 0),
}


@pytest.mark.parametrize("object", COVERED)
@pytest.mark.parametrize("photons", [20000, 1000])
def test_an_object_at_the_ends_is_no_beam(object, photons):
    lines = counted(COVERED[object], photons)
    assert beam_level(lines) is None
    assert beam_level(np.random.default_rng(1).permutation(lines)) is None


@pytest.mark.parametrize("photons", [20000, 1000, 100, 20])
def test_noise_is_no_beam(photons):
    assert beam_level(counted(WHOLE, photons)) is None


@pytest.mark.parametrize("weaker", [0.03, 0.1, 0.5, -0.1])
def test_a_beam_that_is_weaker_throughout_has_one_level(weaker):
    found = beam_level(counted(WHOLE, beam=1 - weaker))
    assert found.constant
    assert found.levels.mean() == pytest.approx(-np.log(1 - weaker), abs=2e-3)


def told_of(lines, noise):
    """Of 40 scans whose flats have this noise in each bin, how many are told."""
    told = 0
    for seed in range(40):
        # In all views alike.
        flats = np.random.default_rng(seed).normal(0, noise, lines.shape[1])
        told += beam_level((lines + flats).astype(np.float32)) is not None
    return told


def test_noise_of_the_flats_hides_no_weak_beam_on_a_small_detector():
    lines = counted(WHOLE[:, np.linspace(0, BINS - 1, 40).round().astype(int)], beam=0.95)
    assert told_of(lines, 0.004) >= 39


@pytest.mark.parametrize("flats", [1, 5])
def test_noise_of_few_flats_hides_no_weak_beam(flats):
    assert told_of(counted(WHOLE, beam=0.97), (20000 * flats) ** -0.5) >= 39


def test_noise_of_few_flats_makes_no_air_of_an_object():
    """Its fall shows over twice the bins."""
    wide, core = ellipse(1.5 * HALF, 1.5 * HALF), ellipse(15, 10, 5, 3)
    lines = counted(core / core.max() + 0.2 * wide / wide.max())
    assert told_of(lines, (20000 * 5) ** -0.5) <= 4


@pytest.mark.parametrize(("fall", "words"), [(0.3, "fell by 30 %"), (-0.2, "rose by 20 %")])
def test_a_beam_that_falls_is_told_by_how_much(fall, words):
    found = beam_level(counted(WHOLE, beam=np.exp(np.log(1 - fall) * np.linspace(0, 1, VIEWS))))
    assert not found.constant and found.change.of_beam == f"{words} from the first view to the last"


def test_views_that_magnify_an_object_differently_hide_no_fall():
    magnified = WHOLE * (1 + 0.04 * np.sin(2 * ANGLES))[:, None]
    found = beam_level(counted(magnified, beam=1 - 0.1 * np.linspace(0, 1, VIEWS)))
    assert found is not None and found.change.of_beam.startswith("fell by")


def test_a_jump_is_told_by_its_view():
    found = beam_level(counted(WHOLE, beam=np.where(np.arange(VIEWS) < 40, 1, 0.8)))
    assert found.change.of_beam == "fell by 20 % at view 40"


def test_a_slow_change_is_no_flicker():
    view = np.arange(VIEWS)
    slow = beam_level(counted(WHOLE, beam=1 - 0.1 * np.sin(view / 10)))
    fast = beam_level(counted(WHOLE, beam=1 - 0.1 * (-1.0) ** view))
    assert slow.change.of_beam.startswith("changed by")
    assert slow.change.where == "in the course of the views"
    assert fast.change.of_beam == "flickered by 9.5 % from view to view"


@pytest.mark.parametrize("unit", [1e-6, 1, 1000])
def test_values_of_any_unit_change_by_an_amount_of_it(unit):
    rise = 0.105 * np.linspace(0, 1, VIEWS)[:, None]
    found = beam_level((unit * (2 * WHOLE / WHOLE.max() + rise)).astype(np.float32))
    assert (
        found.change.of_values == f"changes by {0.105 * unit:.3g} from the first view to the last"
    )
