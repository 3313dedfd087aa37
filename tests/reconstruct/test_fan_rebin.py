"""Fan views become parallel ones: the analytic fan sinogram of ellipses is the parallel one."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.geometry.fan import FanBeam
from rift_cl.reconstruct.direct.fan_rebin import covered_rays, rebin_fan

BINS = 200
# Value, half-axes, middle and turn of ellipses.
ELLIPSES = ((1, 60, 45, 5, -8, 0.3), (-0.5, 15, 25, -20, 5, 1.0), (0.7, 8, 8, 25, -20, 0))


def integrals(theta, t):
    """Line integrals of the ellipses along the rays of a parallel beam."""
    total = np.zeros(np.broadcast(theta, t).shape)
    for value, a, b, x, y, turn in ELLIPSES:
        square = (a * np.cos(theta - turn)) ** 2 + (b * np.sin(theta - turn)) ** 2
        off = t - x * np.cos(theta) - y * np.sin(theta)
        total += value * 2 * a * b * np.sqrt(np.maximum(square - off**2, 0)) / square
    return total


def fan_scan(first, span, views, *, center=99.5, end=False, distance=300):
    """A fan, its angles in radians and the ellipses' sinogram."""
    fan = FanBeam(distance, 4 / 3 * distance, 1.0, center)
    angles = np.deg2rad(first + np.linspace(0, span, views, endpoint=end))
    gamma = fan.fan_angles(BINS)
    sinogram = integrals(angles[:, None] - gamma, distance * np.sin(gamma))
    return fan, angles, sinogram.astype(np.float32)


SCANS = {
    "full turn": {"first": 0, "span": 360, "views": 720},
    "full turn, last view repeated": {"first": 50, "span": 360, "views": 721, "end": True},
    "short scan": {"first": 100, "span": 220, "views": 440, "end": True},
    "less than a short scan": {"first": -30, "span": 190, "views": 380},
    "wedge": {"first": 0, "span": 40, "views": 81, "end": True},
    "offset detector": {"first": 0, "span": 360, "views": 720, "center": 60.3},
    "nearly parallel": {"first": 0, "span": 200, "views": 400, "distance": 1e6},
}


@pytest.mark.parametrize("name", SCANS)
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_rebinned_views_are_the_parallel_ones(name, interpolation):
    fan, angles, sinogram = fan_scan(**SCANS[name])
    parallel, scan = rebin_fan(sinogram, angles, fan, interpolation=interpolation)
    truth = integrals(scan.angles[:, None], scan.coordinates())
    assert parallel.shape == truth.shape
    assert np.sqrt(np.mean((parallel - truth) ** 2)) < 0.004 * truth.max()
    assert np.abs(parallel - truth).max() < 0.08 * truth.max()  # at the ellipses' edges


@pytest.mark.parametrize(
    ("name", "degrees"),
    [("full turn", 180), ("short scan", 180), ("offset detector", 180)],
)
def test_enough_views_cover_half_a_turn_once(name, degrees):
    fan, angles, _ = fan_scan(**SCANS[name])
    scan, _ = covered_rays(angles, BINS, fan)
    step = np.rad2deg(np.diff(scan.angles))
    assert np.allclose(step, step[0])
    assert len(scan.angles) * step[0] == pytest.approx(degrees, abs=1e-6)


def test_views_that_are_covered_in_part_are_left_out():
    fan, angles, _ = fan_scan(**SCANS["wedge"])
    scan, _ = covered_rays(angles, BINS, fan)
    gamma = np.rad2deg(fan.fan_angles(BINS))
    covered = np.rad2deg(scan.angles[[0, -1]])
    # A parallel view takes rays of fan views as far away as the fan is wide.
    assert covered[0] >= gamma[-1] - 0.6
    assert covered[1] <= 40 + gamma[0] + 0.6
    assert np.ptp(covered) == pytest.approx(40 - np.ptp(gamma), abs=1.1)


def test_rays_of_views_that_are_covered_in_part_are_right_too():
    fan, angles, sinogram = fan_scan(**SCANS["wedge"])
    parallel, scan = rebin_fan(sinogram, angles, fan, whole=False)
    same, seen = covered_rays(angles, BINS, fan, whole=False)
    assert same == scan
    assert np.rad2deg(np.ptp(scan.angles)) > 45  # the wedge, and more for some rays
    assert not parallel[~seen].any()
    truth = integrals(scan.angles[:, None], scan.coordinates())
    assert np.sqrt(np.mean((parallel - truth)[seen] ** 2)) < 0.004 * truth.max()


def test_an_offset_detector_sees_both_sides_over_a_turn():
    fan, angles, _ = fan_scan(**SCANS["offset detector"])
    t = covered_rays(angles, BINS, fan)[0].coordinates()
    assert t[0] == pytest.approx(-t[-1])
    assert t[-1] > 95


def test_views_in_any_order_and_turn_give_the_same():
    fan, angles, sinogram = fan_scan(**SCANS["short scan"])
    parallel, scan = rebin_fan(sinogram, angles, fan)
    order = np.random.default_rng(0).permutation(len(angles))
    again, same = rebin_fan(sinogram[order], angles[order], fan)
    assert same == scan
    np.testing.assert_array_equal(again, parallel)
    turned, later = rebin_fan(sinogram, angles + 2 * np.pi, fan)
    np.testing.assert_allclose(later.angles - 2 * np.pi, scan.angles, atol=1e-9)
    np.testing.assert_allclose(turned, parallel, atol=1e-3)


def test_further_turns_count_as_much_as_the_first():
    fan, angles, sinogram = fan_scan(**SCANS["full turn"])
    once, scan = rebin_fan(sinogram, angles, fan)
    turns = np.concatenate([angles, angles + 2 * np.pi])
    both, same = rebin_fan(np.concatenate([0 * sinogram, 2 * sinogram]), turns, fan)
    np.testing.assert_allclose(same.angles, scan.angles, atol=1e-6)
    np.testing.assert_allclose(both, once, atol=1e-3)
    golden = 2.399963 * np.arange(400)
    assert covered_rays(golden, BINS, fan)[1].all(axis=1).sum() > 100


def test_a_value_that_is_no_number_is_told():
    fan, angles, sinogram = fan_scan(**SCANS["wedge"])
    sinogram[3, 4] = np.nan
    with pytest.raises(NonFiniteError, match="projections"):
        rebin_fan(sinogram, angles, fan)


def test_rows_are_alike():
    fan, angles, sinogram = fan_scan(**SCANS["wedge"])
    stack = np.stack([sinogram, 2 * sinogram], axis=1)
    parallel, _ = rebin_fan(stack, angles, fan)
    alone, _ = rebin_fan(sinogram, angles, fan)
    np.testing.assert_array_equal(parallel[:, 0], alone)
    np.testing.assert_allclose(parallel[:, 1], 2 * alone, rtol=1e-5, atol=1e-4)


def test_an_analytic_fan_scan_reconstructs_to_its_values():
    fan, angles, sinogram = fan_scan(**SCANS["short scan"])
    parallel, scan = rebin_fan(sinogram, angles, fan)
    image = rift.fbp(rift.Projector(rift.Grid((160, 160)), scan), parallel)
    assert image[100:106, 76:84].mean() == pytest.approx(1, abs=0.02)
    assert image[57:62, 102:107].mean() == pytest.approx(1.7, abs=0.04)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"angles": np.deg2rad([0, 1, 2])}, "no parallel view"),
        ({"angles": np.zeros(3)}, "one angle"),
        ({"angles": np.array([0.1])}, "two or more"),
        ({"angles": np.array([0, np.nan, 1])}, "finite"),
        ({"interpolation": "septic"}, "septic"),
        ({"projections": np.zeros((5, BINS), np.float32)}, "shape"),
    ],
)
def test_scans_that_cannot_be_resampled_are_told(change, words):
    fan, angles, sinogram = fan_scan(0, 40, 81)
    arguments = {"projections": sinogram, "angles": angles, "fan": fan, **change}
    if "angles" in change:
        arguments["projections"] = sinogram[: len(change["angles"])]
    with pytest.raises(InputError, match=words):
        rebin_fan(**arguments)
