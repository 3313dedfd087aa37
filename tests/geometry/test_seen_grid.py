"""Voxels that a scan from a point fills: what the detector's edges show at the axis."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.geometry.seen_grid import scan_lengths, seen_grid, slices_beyond

ANGLES = np.linspace(0, 6, 7)
CONE = rift.Cone(ANGLES, 10, 16, (0.4, 0.8), 50, 100, (4.5, 7.5))


def test_a_voxel_is_a_bin_at_the_axis():
    grid = seen_grid(CONE)
    assert grid.spacing == pytest.approx((0.4,) * 3)
    # Ten rows of 0.2 at the axis are five voxels.
    assert grid.shape == (5, 16, 16) and grid.center == pytest.approx((0, 0, 0))
    assert seen_grid(CONE, 0.2).shape == (10, 32, 32)


def test_the_longer_side_of_an_offset_detector_counts_and_rows_are_where_they_look():
    grid = seen_grid(rift.Cone(ANGLES, 10, 16, (0.4, 0.8), 50, 100, (0.0, 3.5)))
    assert grid.shape == (5, 24, 24)
    assert grid.center == pytest.approx((4.5 * 0.2, 0, 0))


def test_a_helix_is_as_long_as_the_source_rises():
    cone = rift.Cone(ANGLES, 10, 16, (0.4, 0.8), 50, 100, (4.5, 7.5), heights=ANGLES)
    grid = seen_grid(cone)
    assert grid.shape[0] == 20 and grid.center[0] == pytest.approx(3)


def test_vectors_of_a_cone_see_what_the_cone_sees():
    displaced = rift.Cone(ANGLES, 9, 16, 0.8, 50, 100, (1.0, 3.5))
    for cone in (CONE, displaced, rift.Cone(ANGLES, 9, 16, 0.8, 50, 100, heights=ANGLES)):
        assert seen_grid(cone.vectors()).shape == seen_grid(cone).shape
        np.testing.assert_allclose(seen_grid(cone.vectors()).center, seen_grid(cone).center)
        np.testing.assert_allclose(scan_lengths(cone.vectors()).pixel, scan_lengths(cone).pixel)


@pytest.mark.parametrize("tilt", [0.0, 10.0, 30.0, 60.0, 90.0])
def test_a_source_above_the_plane_sees_what_one_in_it_sees(tilt):
    """Laminography: the source stands on a circle above, the detector faces it."""
    angles, up = np.arange(24) * np.pi / 12, np.radians(tilt)
    ring, flat = np.stack([np.sin(angles), -np.cos(angles), 0 * angles], 1), 0 * angles[:, None]
    toward = np.concatenate([np.cos(up) * ring[:, :2], flat + np.sin(up)], axis=1)
    across = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    scan = rift.Vectors(200 * toward, -50 * toward, across, np.cross(across, -toward), 48, 40)
    assert scan_lengths(scan).source_to_axis == pytest.approx(200)
    assert scan_lengths(scan).pixel == pytest.approx((0.8, 0.8))
    grid = seen_grid(scan)
    assert grid.center == pytest.approx((0, 0, 0), abs=1e-9)
    assert grid.spacing == pytest.approx((0.8, 0.8, 0.8))
    assert min(grid.shape) >= 40


@pytest.mark.parametrize("turn", [0.1, -0.3])
def test_a_detector_that_faces_aside_or_up_leaves_the_axis_where_it_is(turn):
    straight = rift.Cone(np.arange(24) * np.pi / 12, 40, 48, 1.0, 200, 250).vectors()
    facing = np.cross(straight.across, straight.down)
    for across, down in (
        (np.cos(turn) * straight.across + np.sin(turn) * facing, straight.down),
        (straight.across, np.cos(turn) * straight.down + np.sin(turn) * facing),
    ):
        turned = rift.Vectors(straight.source, straight.middle, across, down, 40, 48)
        lengths = scan_lengths(turned)
        share = lengths.source_to_axis / lengths.source_to_detector
        assert share == pytest.approx(0.8, rel=1e-9)


def test_a_detector_on_its_side_is_as_high_as_it_is_long():
    seen = rift.Cone(ANGLES, 9, 16, 0.8, 50, 100, (1.0, 3.5)).vectors()
    lying = rift.Vectors(seen.source, seen.middle, seen.down, seen.across, 16, 9)
    assert seen_grid(lying) == seen_grid(seen)


def moved(scan, *place):
    """The same views about another place."""
    ends = scan.source + np.array(place), scan.middle + np.array(place)
    return rift.Vectors(*ends, scan.across, scan.down, scan.rows, scan.bins)


def test_views_that_look_past_the_axis_are_told_where_they_look():
    views = rift.Cone(ANGLES, 9, 16, 0.8, 50, 100).vectors()
    for place in ((20, -8, 3), (0, 30, 0)):
        with pytest.raises(InputError, match=rf"subtract \({place[0]}, {place[1]}, 0\)"):
            seen_grid(moved(views, *place))
    # Wherever along the axis, and with the object still in the volume.
    for place in ((0, 0, 40), (2, 1, 0)):
        assert seen_grid(moved(views, *place)).shape[1:] >= seen_grid(views).shape[1:]


def test_views_need_not_look_at_the_axis_along_their_middle_rays():
    """A tomosynthesis: sources on an arc over a detector that stays where it is."""
    angles, still = np.linspace(-0.3, 0.3, 9), np.ones((9, 1))
    source = 100 * np.stack([np.sin(angles), -np.cos(angles), 0 * angles], axis=1)
    for x, y in ((6.0, 40.0), (0.0, 10.0)):
        rows, bins = still * [0, 0, 1], still * [1, 0, 0]
        scan = rift.Vectors(source, still * [x, y, 0], bins, rows, 32, 64)
        assert seen_grid(scan).center == pytest.approx((0, 0, 0), abs=1e-9)
    # A helix about an axis that lies: few views see z, and no other upright line is seen by more.
    turns, still = np.arange(36.0), np.ones((36, 1))
    along = np.linspace(-60, 60, 36)
    aside = np.stack([0 * turns, np.cos(turns), np.sin(turns)], axis=1)
    source, middle = (away * aside + along[:, None] * [1, 0, 0] for away in (50, -50))
    across, down = still * [1, 0, 0], np.cross(aside, [1, 0, 0])
    assert seen_grid(rift.Vectors(source, middle, across, down, 16, 16)).shape[1] >= 16


def test_a_fan_sees_a_slice():
    grid = seen_grid(CONE.fan())
    assert grid.shape == (16, 16) and grid.spacing == pytest.approx((0.4, 0.4))
    with pytest.raises(InputError, match="spacing"):
        seen_grid(CONE, -1)


def test_slices_beyond_are_those_that_rays_of_the_first_and_last_rows_meet():
    """By the rays themselves: from the source through a row's edge, on both sides of the axis."""
    for row in (7.5, -20.0, 40.0):
        cone = rift.Cone(ANGLES, 16, 32, 2.0, 60.0, 120.0, (row, 15.5))
        grid = seen_grid(cone)
        below, above = slices_beyond(cone, grid)
        radius, (dz, *_) = grid.shape[1] * grid.spacing[1] / 2, grid.spacing
        ends = (
            (np.array([-0.5, 15.5]) - row)[:, None] * 2.0 * (60 + radius * np.array([-1, 1])) / 120
        )
        low = grid.center[0] - (grid.shape[0] / 2 + below) * dz
        high = grid.center[0] + (grid.shape[0] / 2 + above) * dz
        assert low - 1e-9 <= ends.min() <= low + dz and high - dz <= ends.max() <= high + 1e-9
