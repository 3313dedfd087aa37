"""Views and rays of a circular scan count every line once, whatever the order of the views."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Fan
from rift_cl.reconstruct.direct.offset_axis import displaced_detector
from rift_cl.reconstruct.direct.redundancy import redundancy, short_scan

FAN = 0.3
TURN = np.arange(90) * 2 * np.pi / 90


def fan(angles, **changes):
    given = {"bins": 65, "pitch": 2 * 200 * np.tan(FAN) / 64, **changes}
    return Fan(angles, source_to_axis=100.0, source_to_detector=200.0, **given)


def arc(span, count=120):
    return (np.arange(count) + 0.5) * span / count


@pytest.mark.parametrize("excess", [FAN, 0.8, 1.4])
def test_the_two_rays_of_a_line_count_once_in_a_short_scan(excess):
    beta, gamma = np.linspace(0, np.pi + 2 * excess, 303)[1:-1], np.linspace(-FAN, FAN, 41)
    here = short_scan(beta, gamma, excess)
    assert here.min() >= 0
    assert here.max() <= 1
    for k, g in enumerate(gamma):
        # The same line from the other side, one turn earlier or later too.
        there = (beta + np.pi - 2 * g)[:, None] + np.array([-2 * np.pi, 0, 2 * np.pi])
        within = (there > 0) & (there < np.pi + 2 * excess)
        other = short_scan(there.ravel(), np.array([-g]), excess).reshape(there.shape)
        other = np.where(within, other, 0).sum(axis=1)
        np.testing.assert_allclose(here[:, k] + other, 1, atol=1e-9)


@pytest.mark.parametrize("share", [1.0, 0.3])
@pytest.mark.parametrize("ends", [(-0.1, 0.3), (-0.3, 0.1), (-0.28, 0.3)])
def test_the_two_rays_of_a_line_count_twice_a_half_on_a_displaced_detector(ends, share):
    gamma = np.linspace(*ends, 401)
    weights = displaced_detector(gamma, share)
    opposite = np.interp(-gamma, gamma, weights, left=0, right=0)
    np.testing.assert_allclose(weights + opposite, 2, atol=5e-3 if share < 1 else 2e-4)
    assert weights.min() == 0
    # What is measured once cannot count less, whatever the weights of the rest.
    once = np.abs(gamma) > np.abs(ends).min()
    np.testing.assert_allclose(weights[once], 2)
    assert np.abs(np.diff(weights)).max() < 0.1


def test_a_full_turn_counts_every_ray_half():
    counted = redundancy(fan(TURN))
    np.testing.assert_allclose(counted.views, np.pi / 90, rtol=1e-9)
    assert (counted.rays == 1).all()
    assert counted.missing == (0, 0)
    assert "full turn" in counted.sentence


@pytest.mark.parametrize(
    "angles",
    [
        -TURN,
        TURN + 5.0,
        np.append(TURN, 2 * np.pi),
        np.arange(270) * 4 * np.pi / 270,
        TURN + np.random.default_rng(1).uniform(-0.02, 0.02, 90),
    ],
    ids=["backwards", "from elsewhere", "with the end point", "two turns", "uneven"],
)
def test_views_of_turns_stand_for_half_the_gaps(angles):
    views = redundancy(fan(angles)).views
    assert views.sum() == pytest.approx(np.pi)
    if len(angles) == 90:
        place = np.argsort(np.mod(angles, 2 * np.pi))
        middle = place[1:-1]
        gaps = angles[place[2:]] - angles[place[:-2]]
        gaps = np.abs(np.mod(gaps + np.pi, 2 * np.pi) - np.pi)
        np.testing.assert_allclose(views[middle], gaps / 4, rtol=1e-9)


@pytest.mark.parametrize("first", [0.0, 4.0])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_short_scan_weighs_by_places_on_the_circle(first, sense):
    span = np.pi + 2 * FAN + 0.1
    angles = first + arc(span)[::sense]
    counted = redundancy(fan(angles))
    assert counted.views.sum() == pytest.approx(span)
    gamma = fan(angles).fan_angles()
    expected = short_scan(angles - first, gamma, (span - np.pi) / 2)
    np.testing.assert_allclose(counted.rays, expected, atol=1e-9)
    assert "short scan" in counted.sentence
    assert f"no views in the other {np.degrees(2 * np.pi - span):.3g} of" in counted.sentence


def test_unsorted_views_keep_their_weights():
    angles = arc(4.3)
    mixed = np.random.default_rng(2).permutation(len(angles))
    there, here = redundancy(fan(angles)), redundancy(fan(angles[mixed]))
    np.testing.assert_allclose(here.rays, there.rays[mixed], atol=1e-12)
    np.testing.assert_allclose(here.views, there.views[mixed], atol=1e-12)


@pytest.mark.parametrize("center", [12.0, 52.0])
def test_a_detector_to_one_side_is_completed(center):
    counted = redundancy(fan(TURN, center=center))
    assert sum(counted.missing) == 40
    assert counted.missing[0 if center == 12 else 1] == 40
    assert counted.rays.shape == (1, 65)
    assert "Wang" in counted.sentence


def test_a_detector_to_one_side_is_completed_where_angles_are_as_chance_has_them():
    angles = np.random.default_rng(0).uniform(0, 2 * np.pi, 160)
    counted = redundancy(fan(angles, center=12.0))
    np.testing.assert_array_equal(counted.rays, redundancy(fan(TURN, center=12.0)).rays)
    assert counted.views.sum() == pytest.approx(np.pi)
    place = np.argsort(angles)
    gaps = (angles[place[2:]] - angles[place[:-2]]) / 4
    np.testing.assert_allclose(counted.views[place[1:-1]], gaps, rtol=1e-9)


def test_a_short_scan_says_how_far_an_object_may_reach_on_a_detector_to_one_side():
    assert "12 bins" in redundancy(fan(arc(5.5), center=12.0)).sentence
    assert "axis" not in redundancy(fan(arc(5.5))).sentence


@pytest.mark.parametrize("center", [31.0, 33.0, 35.5])
def test_lines_beyond_the_shorter_side_count_twice_where_the_axis_is_off_by_a_little(center):
    counted = redundancy(fan(TURN, center=center))
    short, off = min(center, 64 - center), round(2 * abs(center - 32))
    assert sum(counted.missing) == off
    away = np.abs(np.arange(65) - center)
    np.testing.assert_allclose(counted.rays[0, away > short], 2)
    assert np.count_nonzero(counted.rays == 2) >= off
    np.testing.assert_allclose(counted.rays[0, away < short - 13], 1)


def test_an_axis_off_the_middle_by_a_rounding_changes_nothing():
    assert (redundancy(fan(TURN, center=32.1)).rays == 1).all()


def test_a_cone_counts_as_its_fan():
    cone = Cone(arc(4.3), 9, 65, 1.5, 100.0, 200.0)
    there, here = redundancy(cone), redundancy(cone.fan())
    np.testing.assert_array_equal(there.rays, here.rays)


@pytest.mark.parametrize(
    ("scan", "words"),
    [
        (fan(arc(np.pi)), "half a turn and the fan.*cgls"),
        (fan(np.concatenate([arc(2.4), 3.1 + arc(1.2)])), "hole.*cgls"),
        (fan(TURN, center=-3.0), "axis.*cgls"),
        (fan([0.2]), "span.*cgls"),
    ],
    ids=["half a turn", "with a hole", "off the axis", "one view"],
)
def test_what_a_scan_does_not_allow_is_refused_with_the_method_that_does(scan, words):
    with pytest.raises(InputError, match=words):
        redundancy(scan)


@pytest.mark.parametrize("angles", [TURN, arc(4.3)], ids=["turn", "short scan"])
def test_an_unknown_compensation_is_refused(angles):
    with pytest.raises(InputError, match="compensate"):
        redundancy(fan(angles), "exact")
