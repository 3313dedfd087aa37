"""The axis of fans and cones and the sense of their rotation, from opposite rays."""

from dataclasses import replace

import numpy as np
import pytest
from fan_scenes import FULL, KINDS, SHORT, cone, fan, projections, sinogram

import rift_cl as rift
from rift_cl.errors import InputError, ShapeError
from rift_cl.phantom import Ellipsoid, project
from rift_cl.reconstruct.axis.fan_doubt import fan_doubt
from rift_cl.reconstruct.axis.lying_axis import looked_at, lying_axis

TURNS = {
    "full": FULL,
    "short": SHORT,
    "uneven": np.random.default_rng(2).uniform(0, 2 * np.pi, 260),
}


def _unknown(scan):
    """What is known before the search: all but the centre."""
    return replace(scan, center=None)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_axis_is_found(kind, turn):
    scan = fan(TURNS[turn])
    found = rift.find_center(sinogram(KINDS[kind], scan), _unknown(scan))
    assert found.center == pytest.approx(83.7, abs=0.1)
    assert found.interval[0] <= found.center <= found.interval[1]
    assert found.sense is not None
    assert found.sense.sign == 1


@pytest.mark.full
def test_parts_of_views_tell_the_axis_of_a_noisy_short_scan():
    scan = fan(SHORT)
    y = sinogram(KINDS["wider than the detector"], scan, noise=0.03)
    found = rift.find_center(y, _unknown(scan))
    assert found.by == "opposite views"
    assert found.center == pytest.approx(83.7, abs=0.15)
    assert found.interval[0] < 83.7 < found.interval[1]


@pytest.mark.full
def test_the_sense_is_told():
    scan = fan()
    y = sinogram(KINDS["porous"], scan)
    for wrong, data in ((replace(scan, angles=-FULL), y), (scan, y[:, ::-1])):
        found = rift.find_center(data, _unknown(wrong))
        assert found.sense.sign == -1
        assert found.sense.disagreement[0] > 2 * found.sense.disagreement[1]
        right = 83.7 if data is y else y.shape[1] - 1 - 83.7
        assert found.center == pytest.approx(right, abs=0.1)
    both = rift.find_center(y[:, ::-1], _unknown(replace(scan, angles=-FULL)))
    assert both.sense.sign == 1


@pytest.mark.full
def test_a_narrow_fan_does_not_tell_the_sense():
    scan = replace(fan(), source_to_axis=1e6, source_to_detector=1.5e6)
    found = rift.find_center(sinogram(KINDS["porous"], scan), _unknown(scan))
    assert found.sense.sign == 0
    assert found.center == pytest.approx(83.7, abs=0.1)


@pytest.mark.full
def test_a_detector_moved_aside():
    scan = fan(center=118.0)
    found = rift.find_center(sinogram(KINDS["wider than the detector"], scan), _unknown(scan))
    assert found.center == pytest.approx(118.0, abs=0.1)


@pytest.mark.full
def test_a_curved_detector():
    scan = replace(fan(), curved=True)
    y = sinogram(KINDS["porous"], scan)
    assert rift.find_center(y, _unknown(scan)).center == pytest.approx(83.7, abs=0.1)


@pytest.mark.full
def test_cones_are_searched_near_the_orbit():
    scan = cone()
    y = projections(scan)
    found = rift.find_center(y, replace(scan, center=(11.5, 79.5)))
    assert found.center == pytest.approx(83.7, abs=0.1)
    assert found.sense.sign == 1
    assert abs(found.rows - 11.5).max() < 8
    order = np.random.default_rng(0).permutation(scan.views)
    again = rift.find_center(y[order], replace(scan, angles=scan.angles[order]))
    assert again.center == pytest.approx(found.center, abs=0.01)


def swapped(y, scan):
    """What is said against rows, and the same of views whose rows and bins are exchanged."""
    other = replace(
        scan, rows=scan.bins, bins=scan.rows, pitch=scan.pitch[::-1], center=scan.center[::-1]
    )
    ways = (y, scan), (y.transpose(0, 2, 1), other)
    return [lying_axis(views[np.ix_(*looked_at(way))], way) for views, way in ways]


def test_rows_taken_for_bins_are_doubted():
    scan = cone(FULL[::8], rows=80, center=(39.5, 83.7))
    y = projections(scan, noise=0.05, count=8)
    right, wrong = swapped(y, scan)
    assert not right and "probably swapped" in wrong
    square = replace(scan, rows=160, bins=80, center=(83.7, 39.5))
    with pytest.raises(InputError, match=r"7 degrees apart; .*probably swapped"):
        rift.find_center(y.transpose(0, 2, 1), square)
    # A round body that turns about its axis changes nowhere, whichever axis that is.
    rod = project([Ellipsoid.ball(25.0)], rift.Grid((4, 4, 4)), scan)
    assert swapped(rod, scan) == ["", ""]


def wide_cone():
    """A half-angle of 30 degrees: slices are seen by many rows in turn."""
    return rift.Cone(FULL[::4], 40, 40, 2.6, 40.0, 90.0)


@pytest.mark.parametrize("flicker", [0.0, 3.0])
def test_rows_taken_for_bins_are_doubted_in_a_wide_cone_and_a_beam_that_flickers(flicker):
    balls = ((3.0, (12.0, 2.0, 9.0)), (5.0, (0.0, 5.0, -6.0)))
    parts = [Ellipsoid.ball(radius, 1.0, place) for radius, place in balls]
    scan = wide_cone()
    y = project(parts, rift.Grid((4, 4, 4)), scan)
    y = y + flicker * np.random.default_rng(0).standard_normal((scan.views, 1, 1))
    right, wrong = swapped(y, scan)
    assert not right and "probably swapped" in wrong


@pytest.mark.parametrize("heights", [[14.0], np.arange(-14.0, 15.0, 4.0)], ids=["one", "stack"])
def test_thin_layers_beside_the_orbit_are_no_rows_taken_for_bins(heights):
    """They move from row to row more than they change along the rows."""
    parts = [
        Ellipsoid((z, 5 * np.sin(z), 5 * np.cos(z)), (0.9, 12.0, 12.0), 0.0, 1.0) for z in heights
    ]
    scan = wide_cone()
    assert not swapped(project(parts, rift.Grid((4, 4, 4)), scan), scan)[0]


@pytest.mark.full
def test_a_search_that_leads_off_the_detector_comes_back():
    """Beyond its ends windows are empty, of which nothing can be told."""
    scan = wide_cone()
    disc = [Ellipsoid((14.0, 0.0, 5.0), (1.0, 12.0, 12.0), 0.0, 1.0)]
    y = project(disc, rift.Grid((4, 4, 4)), scan).transpose(0, 2, 1)
    assert 0 <= rift.find_center(np.ascontiguousarray(y), scan).center <= 39


@pytest.mark.full
def test_a_pitch_in_another_unit_is_doubted():
    scan = fan()
    y = sinogram(KINDS["porous"], scan)
    assert fan_doubt(y, scan) == ""
    assert "0.001 times as far" in fan_doubt(y, replace(scan, pitch=1e-3 * scan.pitch))


def test_what_cannot_be_told_is_refused():
    scan = fan()
    with pytest.raises(InputError, match="no contrast"):
        rift.find_center(np.ones((scan.views, scan.bins), np.float32), scan)
    with pytest.raises(InputError, match="span"):
        rift.find_center(sinogram(KINDS["parts"], fan(FULL[:10])), fan(FULL[:10]))
    few = fan(FULL[::7])
    with pytest.raises(InputError, match=r"11\.[23] degrees apart.* 7 degrees"):
        rift.find_center(sinogram(KINDS["parts"], few), few)
    with pytest.raises(ShapeError):
        rift.find_center(np.ones((3, 3), np.float32), scan)
    helix = cone(heights=np.arange(FULL.size // 2))
    with pytest.raises(InputError, match="heights"):
        rift.find_center(np.ones((helix.views, helix.rows, helix.bins), np.float32), helix)
    with pytest.raises(InputError, match="row"):
        aside = cone(center=(-4.0, 80.0))
        rift.find_center(np.ones((aside.views, aside.rows, aside.bins), np.float32), aside)


@pytest.mark.full
def test_real_walnut(shared_data):
    with np.load(shared_data / "walnut" / "walnut_cone.npz") as data:
        y, angles = data["sinogram"].astype(np.float32), data["angles"]
        lengths = float(data["du"]), float(data["sid"]), float(data["sdd"])
    for sign in (1, -1):
        found = rift.find_center(y, rift.Cone(sign * angles, *y.shape[1:], *lengths))
        assert found.center == pytest.approx(128.0, abs=0.1)
        assert found.sense.sign == sign
