"""Angles over a wrong turn, and wrong lengths of a fan, are told from the data where they tell."""

from dataclasses import replace

import numpy as np
import pytest
from axis_scenes import PARTS, grains, sinogram
from fan_scenes import FULL, SHORT, fan
from fan_scenes import sinogram as fan_sinogram

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.reconstruct.axis.fan_doubt import fan_doubt
from rift_cl.reconstruct.axis.repeated import repeated_angles
from rift_cl.reconstruct.axis.turn import other_turn

KINDS = {"parts": PARTS, "porous": grains(45, 80), "wider than the detector": grains(110, 300)}
# A disc about the axis looks the same from everywhere.
ROUND = [(1.0, 0.0, 0.0, 40.0, 40.0, 0.0)]


def spread(degrees, step=1.0):
    """Directions over so many degrees, the end left out."""
    views = round(degrees / step)
    return np.arange(views) * np.deg2rad(degrees) / views


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("turns", [(180, 360), (360, 180), (200, 360), (360, 200)])
def test_angles_spread_over_a_wrong_turn(kind, turns):
    seen, given = turns
    y = sinogram(KINDS[kind], spread(seen), 83.7, noise=0.02)
    other = other_turn(y, spread(given, given / len(y)))
    assert other is not None
    assert other.given == pytest.approx(given, abs=1)
    assert other.seen == pytest.approx(seen, rel=0.03)
    assert other_turn(y, spread(seen)) is None


@pytest.mark.parametrize(
    "turn", [180, 360, pytest.param(200, marks=pytest.mark.full), pytest.param(90)]
)
@pytest.mark.parametrize("center", [83.7, 60.2])
def test_right_angles_are_not_doubted(turn, center):
    for seed, kind in enumerate(KINDS.values()):
        y = sinogram(kind, spread(turn), center, noise=0.05, seed=seed)
        assert other_turn(y, spread(turn)) is None


def test_what_looks_the_same_from_all_sides_tells_nothing():
    y = sinogram(ROUND, spread(180), 79.5, noise=0.01)
    assert other_turn(y, spread(360, 2)) is None
    assert other_turn(np.ones((90, 64), np.float32), spread(360, 4)) is None


def test_uneven_angles_and_few_views_tell_nothing():
    uneven = np.sort(np.random.default_rng(0).uniform(0, np.pi, 120))
    y = sinogram(PARTS, uneven, 83.7)
    assert other_turn(y, 2 * uneven) is None
    few = spread(180, 12)
    assert other_turn(sinogram(PARTS, few, 83.7), 2 * few) is None


def test_the_search_says_it():
    y = sinogram(PARTS, spread(360), 79.5)
    found = rift.find_center(y, spread(360))
    assert not found.doubt
    assert "doubt" not in found.record()
    try:
        words = rift.find_center(y, spread(180, 0.5)).in_words()
    except InputError as refused:
        words = str(refused)
    assert "as if the scan had gone round 360 degrees in place of 180" in words


@pytest.mark.full
@pytest.mark.parametrize("turn", [FULL, SHORT])
def test_lengths_and_angles_of_fans(turn):
    scan = fan(turn)
    y = fan_sinogram(KINDS["porous"], scan)
    assert fan_doubt(y, scan) == ""
    wide = replace(scan, pitch=scan.pitch / 10)
    assert "about 0.1" in fan_doubt(y, wide)
    factor = 0.55 if turn is FULL else 1.75
    assert "angles" in fan_doubt(y, replace(scan, angles=factor * scan.angles))


def test_a_round_object_says_nothing_of_a_fan():
    scan = fan(SHORT)
    y = fan_sinogram(ROUND, replace(scan, center=79.5))
    assert fan_doubt(y, replace(scan, center=79.5, pitch=scan.pitch / 10)) == ""


def test_a_span_without_opposite_rays_says_nothing():
    scan = fan(SHORT[:40])
    y = fan_sinogram(KINDS["porous"], scan)
    assert fan_doubt(y, scan) == ""
    assert fan_doubt(y, replace(scan, pitch=scan.pitch / 10)) == ""


def test_two_views_of_a_fan_say_nothing():
    scan = rift.Fan([0.0, 1.0], 64, 1.0, 100.0, 150.0)
    assert fan_doubt(np.ones((2, 64), np.float32), scan) == ""


@pytest.mark.full
def test_the_search_doubts_a_fan():
    scan = fan(SHORT)
    wrong = replace(scan, angles=1.75 * scan.angles, center=None)
    with pytest.raises(InputError, match="angles are probably wrong"):
        rift.find_center(fan_sinogram(KINDS["porous"], scan), wrong)


@pytest.mark.parametrize("kind", KINDS)
def test_views_of_one_angle_that_show_other_pictures(kind):
    angles = spread(180)
    y = sinogram(KINDS[kind], angles, 83.7, noise=0.02)
    stuck = angles.copy()
    stuck[99:150] = stuck[99]
    found = repeated_angles(y, stuck)
    assert found.views == 51 and found.angle == pytest.approx(99)
    assert rift.find_center(sinogram(KINDS[kind], angles, 83.7), angles).doubt == ""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", ["two frames each", "two turns", "none", "rounded"])
def test_views_of_one_angle_that_agree_are_not_doubted(kind, way):
    angles = spread(180)
    if way == "two frames each":
        angles = np.repeat(angles[::2], 2)
    if way == "two turns":
        angles = np.tile(angles, 2)
    y = sinogram(KINDS[kind], angles, 83.7, noise=0.03)
    if way == "rounded":
        angles = np.deg2rad(np.floor(np.rad2deg(angles) / 2 + 1e-6) * 2)
    assert repeated_angles(y, angles) is None
