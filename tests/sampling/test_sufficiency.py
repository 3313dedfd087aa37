"""Orlov, Tuy and Crowther: rings, spheres and single views, and the cone that a ring leaves out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from observations_of_all_kinds import ring_directions, ring_of_cameras

import rift_cl as rift
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Parallel
from rift_cl.geometry.scan_cameras import scan_cameras
from rift_cl.sampling.coverage.density import half_sphere
from rift_cl.sampling.criteria.crowther import crowther, crowther_views
from rift_cl.sampling.criteria.orlov import orlov
from rift_cl.sampling.criteria.tuy import missed_planes, tuy
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

SPACE = Target((0, 0, 0), 1.0)


@pytest.mark.parametrize("degrees", [15, 30, 50])
@pytest.mark.parametrize("frequency", [8.0, 200.0])
def test_a_ring_at_an_elevation_misses_a_cone_less_half_a_slice(degrees, frequency):
    elevation = math.radians(degrees)
    found = orlov(Observations.along(ring_directions(2000, elevation)), SPACE, frequency=frequency)
    seen_beside = math.asin(0.5 / frequency)
    assert found.missing == pytest.approx(1 - math.cos(elevation - seen_beside), abs=2e-3)
    assert found.angle == pytest.approx(elevation, abs=2e-3)
    assert abs(found.axis[2]) > 0.999
    assert not found.satisfied and "no slice" in found.sentence


def test_a_ring_in_its_plane_and_a_sphere_miss_nothing():
    for directions in (ring_directions(200), half_sphere(600)):
        found = orlov(Observations.along(directions), SPACE, frequency=8.0)
        assert found.satisfied and found.missing == 0
        assert "every direction" in found.sentence


def test_one_view_misses_all_but_its_slice():
    found = orlov(Observations.along([[0, 0, 1]]), SPACE, frequency=10.0)
    assert found.missing == pytest.approx(0.95, abs=2e-3)
    assert abs(found.axis[2]) == pytest.approx(1, abs=1e-3)


def test_a_wedge_in_the_plane_is_found():
    """Lines of sight over 120 of 180 degrees leave a wedge of 60 in the plane's frequencies."""
    angles = np.linspace(0, 2 * np.pi / 3, 400)
    found = orlov(Parallel(angles, 100, 1e-3), Target.flat(1.0), frequency=50.0)
    assert found.missing == pytest.approx(1 / 3 - 2 * 0.01 / np.pi, abs=2e-3)
    assert found.angle == pytest.approx(np.pi / 6, abs=2e-3)
    toward = math.atan2(found.axis[1], found.axis[0]) % np.pi
    # Frequencies lie along the detector, (cos, sin) of the angle.
    assert toward == pytest.approx(5 * np.pi / 6, abs=2e-3)


def test_crowthers_count_is_that_of_an_even_set():
    assert crowther_views(100.0, 1.0) == 315
    assert crowther_views(1.0, math.pi / 20) == 20
    scan = Parallel(np.arange(60) * np.pi / 60, 100, 1e-3)
    found = crowther(scan, Target.flat(1.0))
    # The furthest direction is told up to K / (pi D); nine tenths of all up to a ninth part more.
    assert found.frequency == pytest.approx(60 / np.pi / 0.9, rel=0.01)
    assert found.needed == crowther_views(1.0, 1 / 16) == 51
    assert "60 views" in found.sentence


def test_more_views_reach_further_and_a_cluster_does_not():
    reached = [
        crowther(Observations.along(half_sphere(count)), SPACE).frequency for count in (10, 40, 160)
    ]
    assert reached[0] < reached[1] < reached[2]
    cluster = half_sphere(4000)[:160]
    assert crowther(Observations.along(cluster), SPACE).frequency < reached[0]


@pytest.mark.parametrize("height", [0.0, 2.0, -5.0, 20.0])
def test_a_circle_misses_the_planes_that_lie_flat(height):
    scan = rift.Cone(np.linspace(0, 2 * np.pi, 200), 9, 9, 1.0, 20, 30)
    points = [[0, 0, height], [6, -3, 0]]
    wanted = 1 - 20 / np.hypot(20, height)
    np.testing.assert_allclose(missed_planes(scan, points), [wanted, 0], atol=3e-4)


def test_a_helix_crosses_every_plane_and_an_arc_does_not():
    angles = np.linspace(0, 6 * np.pi, 500)
    helix = rift.Cone(angles, 9, 9, 1.0, 20, 30, heights=angles - angles.mean())
    arc = rift.Cone(angles[:60], 9, 9, 1.0, 20, 30)
    points = np.random.default_rng(0).uniform(-3, 3, (50, 3))
    assert missed_planes(helix, points).max() == 0
    assert missed_planes(arc, points).min() > 0.1
    np.testing.assert_array_equal(missed_planes(arc, points), missed_planes(arc.vectors(), points))


def test_coverage_takes_a_cone_as_its_cameras():
    cone = rift.Cone(np.linspace(0, 6, 20), 9, 9, 0.5, 20, 30)
    k = np.array([[0.1, 0.2, 0.0], [0.0, 0.0, 0.3]])
    target = Target((0, 0, 0), 4.0)
    cameras = scan_cameras(cone).cameras
    assert rift.coverage(cone, target, k).tolist() == rift.coverage(cameras, target, k).tolist()


def test_one_ring_fails_tuy_and_two_meet_it():
    one = ring_of_cameras(60)
    two = one + ring_of_cameras(60, axis=0)
    target = Target((0, 0, 0), 4.0)
    found = tuy(one, target)
    assert not found.satisfied and abs(found.normal[2]) > 0.99
    assert found.distance == pytest.approx(2, abs=1e-6)
    assert tuy(two, target).satisfied
    assert "every plane" in tuy(two, target).sentence.lower()
    # Of a target as large as the rings they miss planes again.
    assert not tuy(two, Target((0, 0, 0), 18.0)).satisfied


@pytest.mark.parametrize(("radius", "diameter"), [(3, 4), (10, 4), (10, 18), (10, 1)])
def test_the_planes_that_a_ring_does_not_meet_are_as_many_as_their_integral(radius, diameter):
    """At t from the axis the ring meets those up to ``radius sin(t)`` from the middle."""
    t = (np.arange(2000) + 0.5) / 2000 * np.pi / 2
    met = np.minimum(1, 2 * radius * np.sin(t) / diameter)
    wanted = np.mean(np.sin(t) * (1 - met)) * np.pi / 2
    found = tuy(ring_of_cameras(64, radius), Target((0, 0, 0), diameter))
    assert found.unmet == pytest.approx(wanted, rel=0.03, abs=3e-4)


def test_the_loneliest_plane_counts_although_it_is_no_share_of_all():
    found = tuy(ring_of_cameras(64, axis=0), Target((0, 0, 0), 0.1))
    assert found.unmet == 0 and not found.satisfied
    assert found.distance == pytest.approx(0.05)
    assert found.sentence.startswith("under 0.1% of the planes")


def test_a_flat_path_is_blind_along_its_own_normal_however_it_lies():
    turned = ring_of_cameras(40, axis=1) + ring_of_cameras(40, distance=11.0, axis=1)
    found = tuy(turned, Target((0, 0, 0), 4.0))
    assert abs(found.normal[1]) == pytest.approx(1, abs=1e-9)
    assert found.distance == pytest.approx(2, abs=1e-6)


@pytest.mark.parametrize("count", [8, 12, 96])
def test_tuy_hangs_neither_on_how_many_cameras_a_ring_has_nor_on_repeats(count):
    one, target = ring_of_cameras(count), Target((0, 0, 0), 4.0)
    found, twice = tuy(one, target), tuy([*one, *one, *one], target)
    assert not found.satisfied and found.unmet < 0.05
    assert twice.unmet == found.unmet
    assert found.unmet == pytest.approx(tuy(ring_of_cameras(200), target).unmet, abs=0.01)


def test_cameras_too_far_apart_are_no_path():
    """Four at right angles, and two groups that face each other, are not joined."""
    target = Target((0, 0, 0), 1.0)
    assert tuy(ring_of_cameras(4), target).unmet > 0.9
    facing = [ring_of_cameras(60)[k] for k in (0, 1, 2, 30, 31, 32)]
    assert tuy(facing, target).unmet > 0.6


def test_one_camera_works():
    one = ring_of_cameras(1)
    assert tuy(one, SPACE).unmet > 0.9 and orlov(one, SPACE).missing > 0.9
    found = crowther(one, SPACE)
    assert found.views == 1 and "1 view tells" in found.sentence


def test_only_views_that_see_a_point_count():
    cameras = ring_of_cameras(8, focal=4000.0)
    target = Target((0, 0, 0), 1.0, points=[[0, 0, 0], [0, 2.0, 0]])
    assert crowther(cameras, target, point=0).views == 8
    assert crowther(cameras, Target((0, 0, 0), 1.0, points=[[0, 0.1, 0]])).views == 8
    with pytest.raises(InputError, match="outside every picture"):
        crowther(cameras, Target((50, 0, 0), 1.0))


def test_bad_arguments_are_refused():
    observations = Observations.along([[0, 0, 1]])
    with pytest.raises(InputError, match="frequency is"):
        orlov(observations, SPACE, frequency=-1)
    for point in (3, -1, 0.5, "middle"):
        with pytest.raises(InputError, match=f"point is '?{point}"):
            orlov(observations, SPACE, point=point)
    with pytest.raises(InputError, match="wanted positive"):
        crowther_views(1.0, 0.0)
    with pytest.raises(InputError, match="tolerance"):
        tuy(ring_of_cameras(2), SPACE, tolerance=0)
    with pytest.raises(InputError, match="empty"):
        tuy([], SPACE)
    with pytest.raises(ShapeError, match="one view"):
        crowther([], SPACE)
