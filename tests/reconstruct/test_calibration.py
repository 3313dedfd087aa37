"""A scan's geometry from its data: centre, sense, orbit, roll, tilts and detector distance."""

from dataclasses import replace

import numpy as np
import pytest
from fan_scenes import AXIS, DETECTOR, FULL, KINDS, body, cone, fan, noisy, projections, sinogram

import rift_cl as rift
from rift_cl.errors import ShapeError
from rift_cl.phantom import project
from rift_cl.reconstruct.calibration import turned


@pytest.mark.full
def test_centre_sense_and_roll_of_a_cone():
    true = cone(rows=40, center=(19.5, 83.7))
    vectors = turned(true, np.deg2rad(0.8))
    y = noisy(project(body(), rift.Grid((4, 4, 4)), vectors, dtype=np.float64), 0.01, 0)
    found = rift.calibrate(y, replace(true, angles=-true.angles, center=(19.5, 82.0)))
    assert found.axis.sense.sign == -1
    assert found.axis.center == pytest.approx(83.7, abs=0.1)
    assert np.rad2deg(found.roll[0]) == pytest.approx(0.8, abs=0.15)
    assert abs(found.roll[0]) > found.roll[1]
    assert isinstance(found.scan, rift.Vectors)
    assert np.abs(found.scan.middle - vectors.middle).max() < 0.2
    assert "roll" in found.in_words()
    assert found.disagreement[1] < found.disagreement[0]


@pytest.mark.full
def test_a_detector_slanted_about_its_columns():
    taken = cone(rows=24, center=(11.5, 79.5))
    vectors = turned(replace(taken, center=(11.5, 79.8)), np.deg2rad(-0.3), np.deg2rad(2.5))
    y = noisy(project(body(height=9.0), rift.Grid((4, 4, 4)), vectors, dtype=np.float64), 0.01, 0)
    found = rift.calibrate(y, taken)
    slant, half = np.rad2deg(found.slant)
    assert abs(slant - 2.5) < half < 1.0
    assert "slant" in found.in_words() and found.record()["slant"][1] == found.slant[1]
    # As far as pixels move for it, at the corners too.
    assert np.abs(found.scan.middle - vectors.middle).max() < 0.3
    assert np.abs(found.scan.across - vectors.across).max() < 0.01


def test_a_slant_moves_pixels_ahead_and_not_the_foot():
    scan = cone(rows=24, center=(3.0, 60.0))
    upright, slanted = scan.vectors(), turned(scan, 0.0, 0.1)
    ahead = np.stack([-np.sin(scan.angles), np.cos(scan.angles)], axis=1)

    def place(vectors, row, bin):
        steps = (row - 11.5) * vectors.down + (bin - (scan.bins - 1) / 2) * vectors.across
        return vectors.middle + steps - vectors.source

    np.testing.assert_allclose(place(slanted, 3.0, 60.0), place(upright, 3.0, 60.0), atol=1e-9)
    np.testing.assert_allclose(slanted.down, upright.down, atol=1e-12)
    for bin in (0.0, 159.0):
        moved = place(slanted, 9.0, bin) - place(upright, 9.0, bin)
        want = (bin - 60.0) * scan.pitch[1] * np.sin(0.1)
        np.testing.assert_allclose((moved[:, :2] * ahead).sum(axis=1), want, atol=1e-9)


@pytest.mark.full
def test_an_upright_detector_stays_a_cone():
    scan = cone(rows=40, center=(19.5, 83.7))
    found = rift.calibrate(projections(scan), replace(scan, center=(19.5, 83.0)))
    assert isinstance(found.scan, rift.Cone)
    assert found.scan.center == (19.5, found.axis.center)
    assert found.scan.source_to_detector == scan.source_to_detector


@pytest.mark.full
def test_the_distance_of_the_detector():
    scan = fan(FULL)
    y = sinogram(KINDS["porous"], scan)
    wrong = replace(scan, source_to_detector=1.05 * scan.source_to_detector)
    found = rift.calibrate(y, wrong, distance=True)
    assert found.roll is None
    assert found.distance[0] == pytest.approx(1 / 1.05, abs=0.02)
    assert abs(found.distance[0] - 1 / 1.05) < found.distance[1]
    assert found.scan.source_to_detector == pytest.approx(scan.source_to_detector, rel=0.02)


def test_a_rolled_detector_shows_the_axis_along_a_slope():
    scan = cone(rows=40, center=(10.0, 83.7))
    vectors = turned(scan, np.deg2rad(10.0))
    row, bin = 30.0, 83.7 + 20 * np.tan(np.deg2rad(10.0))
    place = vectors.middle + (row - 19.5) * vectors.down
    place = place + (bin - (scan.bins - 1) / 2) * vectors.across
    across = place - scan.vectors().source
    along = np.stack([np.cos(scan.angles), np.sin(scan.angles)], axis=1)
    assert np.abs((across[:, :2] * along).sum(axis=1)).max() < 1e-9


# Bins of the centre, rows of the orbit, and degrees of the roll that a scan is taken to have less.
FAULTS = [(0.0, 1.0, 0.0), (0.4, -1.5, 0.6), (0.0, 0.0, 0.0)]


@pytest.mark.full
@pytest.mark.parametrize("fault", FAULTS)
def test_planes_tell_the_row_of_the_orbit(fault):
    center, row, roll = fault
    taken = rift.Cone(FULL[::4], 40, 80, 2.0, AXIS, DETECTOR, (19.5, 41.6))
    true = replace(taken, center=(19.5 + row, 41.6 + center))
    vectors = turned(true, np.deg2rad(roll))
    y = project(body(height=18.0), rift.Grid((4, 4, 4)), vectors, dtype=np.float64)
    found = rift.calibrate(noisy(y, 0.01, 0), taken, orbit=True)
    assert found.row[0] == pytest.approx(19.5 + row, abs=0.4)
    assert abs(found.row[0] - 19.5 - row) < found.row[1] < 2
    assert abs(np.rad2deg(found.roll[0]) - roll) < np.rad2deg(found.roll[1])
    assert "row of the source's orbit" in found.in_words()
    assert isinstance(found.scan, rift.Vectors if roll else rift.Cone)


def test_an_object_beyond_the_sides_tells_no_planes():
    taken = rift.Cone(FULL[::4], 40, 32, 2.0, AXIS, DETECTOR, (19.5, 15.5))
    y = noisy(project(body(), rift.Grid((4, 4, 4)), taken, dtype=np.float64), 0.01, 0)
    found = rift.calibrate(y, taken, orbit=True)
    assert found.row is None and found.scan.center[0] == 19.5


def test_errors_name_the_function_that_was_called():
    scan = cone()
    with pytest.raises(ShapeError, match="calibrate"):
        rift.calibrate(np.zeros((2, 3, 4), np.float32), scan)
