"""The way of a film: along the cameras of a one-sided capture, round where they stood all round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_start import ring

from rift_cl.commands.cameras.camera_path import orbit, pinhole
from rift_cl.commands.cameras.film_path import (
    capture_arc,
    farthest_from_cameras,
    film,
    first_view,
    frame_of,
)
from rift_cl.commands.cameras.focus import focus_among
from rift_cl.commands.cameras.route import route_through
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.geometry import Camera
from rift_cl.geometry.pose import look_at

MIDDLE, UP = np.array([1.0, -2, 0.5]), np.array([0.0, 0, 1])
FOX = (480, 270)


def from_angles(azimuths, elevations, distances, *, aside=0.0, seed=0):
    """Cameras that look about the middle, as far from it as people's do by chance."""
    random = np.random.default_rng(seed)
    cameras = []
    for a, e, d in zip(np.radians(azimuths), np.radians(elevations), distances, strict=True):
        way = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        target = MIDDLE + aside * random.normal(size=3)
        cameras.append(pinhole(FOX, 70, look_at(MIDDLE + d * way, target, UP)))
    return cameras


def handheld():
    """As the fox: from one side, several rows, by hand."""
    random = np.random.default_rng(7)
    azimuths = np.tile(np.linspace(-45, 45, 16), 3) + random.normal(scale=2, size=48)
    elevations = np.repeat([-15, 10, 35], 16) + random.normal(scale=3, size=48)
    return from_angles(azimuths, elevations, random.uniform(3.8, 6.3, 48), aside=0.3)


def horseshoe():
    azimuths = np.linspace(-125, 125, 40)
    return from_angles(azimuths, np.full(40, 20.0), np.full(40, 4.0))


def wall():
    """Side by side before a wall, axes parallel but for the hand's shaking."""
    random = np.random.default_rng(3)
    stands = np.array([(x, -5, z) for z in (0.0, 0.7) for x in np.linspace(-3, 3, 12)])
    shaken = stands + np.array([0, 1, 0]) + random.normal(scale=0.01, size=stands.shape)
    return [pinhole(FOX, 60, look_at(*pair, UP)) for pair in zip(stands, shaken, strict=True)]


def corridor():
    """Straight ahead, one photograph behind the other."""
    return [pinhole(FOX, 60, look_at((0, y, 0), (0.01 * y, y + 1, 0), UP)) for y in range(12)]


def filmed(cameras, frames=96, **more):
    bounds = bounds_of_cameras(cameras)
    size, fov = frame_of(bounds, None, None)
    return bounds, film(bounds, frames=frames, size=size, fov=fov, **more)


def places(cameras):
    return np.array([camera.center for camera in cameras])


@pytest.mark.parametrize("make", [handheld, horseshoe, wall, corridor])
def test_every_frame_is_as_near_to_a_photograph_as_photographs_are_to_each_other(make):
    cameras = make()
    _, path = filmed(cameras)
    apart = np.linalg.norm(places(path)[:, None] - places(cameras), axis=2)
    among = np.linalg.norm(places(cameras)[:, None] - places(cameras), axis=2)
    # No hop between neighbours is longer than the least that joins all of them.
    joins = max(min(row[row > 0]) for row in among)
    assert apart.min(axis=1).max() < 1.6 * joins
    nearest = apart.argmin(axis=1)
    for frame, number in zip(path, nearest, strict=True):
        turn = frame.view[2, :3] @ cameras[number].view[2, :3]
        assert np.degrees(np.arccos(min(1, turn))) < 25


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count", [2, 3, 7, 60])
def test_no_place_of_a_route_is_farther_from_a_camera_than_its_longest_hop(seed, count):
    random = np.random.default_rng((seed, count))
    angles = random.uniform((-80, -20), (80, 50), (count, 2)).T
    cameras = from_angles(*angles, random.uniform(3, 6, count), aside=0.3, seed=seed)
    route = route_through(cameras, MIDDLE, about=True)
    apart = np.linalg.norm(route.places[:, None] - places(cameras), axis=2)
    assert apart.min(axis=1).max() <= route.longest
    away = np.linalg.norm(route.places - MIDDLE, axis=1)
    assert away.min() > 2, "the way keeps its distance from the subject"


@pytest.mark.parametrize("make", [handheld, horseshoe])
def test_a_film_stays_on_the_side_that_was_photographed(make):
    cameras = make()
    bounds, path = filmed(cameras)
    assert not capture_arc(bounds).closed
    assert farthest_from_cameras(path, bounds) < 15
    azimuths = np.degrees(np.arctan2(*(places(path) - MIDDLE)[:, 1::-1].T))
    taken = np.degrees(np.arctan2(*(places(cameras) - MIDDLE)[:, 1::-1].T))
    assert taken.min() < azimuths.min() and azimuths.max() < taken.max()
    # And it shows much of that side.
    assert np.ptp(azimuths) > 0.6 * np.ptp(taken)
    away = np.linalg.norm(places(path) - bounds.center, axis=1)
    assert away.min() > 0.9 * np.linalg.norm(places(cameras) - bounds.center, axis=1).min()


@pytest.mark.parametrize("make", [handheld, horseshoe])
def test_the_subject_is_in_the_middle_of_every_frame_upright(make):
    bounds, path = filmed(make())
    for camera in path:
        x, y, z = camera.view[:3, :3] @ bounds.center + camera.view[:3, 3]
        assert z > 0 and abs(x / z) < 1e-9 and abs(y / z) < 1e-9
        assert abs(camera.view[0, :3] @ bounds.up) < 1e-9 and camera.view[1, :3] @ bounds.up < 0


@pytest.mark.parametrize("make", [handheld, horseshoe, wall, corridor])
def test_a_film_is_smooth_and_closes(make):
    _, path = filmed(make())
    steps = np.diff(places([*path, path[0]]), axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    assert lengths.max() < 1.7 * np.pi / 2 * lengths.mean()
    # No jerk: a step differs from the next by little of the longest.
    assert np.linalg.norm(np.diff(steps, axis=0), axis=1).max() < 0.25 * lengths.max()
    np.testing.assert_allclose(places(path)[1:48], places(path)[:48:-1], atol=1e-9)


def strip(azimuths, elevation=10.0):
    return from_angles(azimuths, np.full(len(azimuths), elevation), np.full(len(azimuths), 4.0))


def with_strays():
    return strip([*np.linspace(-40, 40, 21), 170])


def front_and_back():
    return strip(np.concatenate([np.linspace(-20, 20, 11), np.linspace(160, 200, 11)]))


def two_fronts():
    return strip(np.concatenate([np.linspace(-20, 20, 11), np.linspace(100, 140, 11)]))


def with_views_from_above():
    """From one side, and three photographs from overhead that are at every azimuth."""
    return strip(np.linspace(-50, 50, 21)) + strip([0.0, 120, 240], 84.0)


@pytest.mark.parametrize("make", [with_strays, front_and_back, two_fronts, with_views_from_above])
def test_a_film_leads_over_no_gap(make):
    bounds, path = filmed(make())
    assert not capture_arc(bounds).closed
    assert farthest_from_cameras(path, bounds) < 10
    shown = np.degrees(np.arccos(np.clip(ways(path) @ ways(path).T, -1, 1))).max()
    assert shown > 25, "the larger group is shown, and not one camera of it"


def ways(cameras):
    """Unit vectors from the middle."""
    ways = places(cameras) - MIDDLE
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def test_photographs_twice_from_each_place_are_one_route():
    azimuths = np.repeat(np.linspace(-60, 60, 9), 2) + np.tile([0, 0.01], 9)
    _, path = filmed(strip(azimuths))
    shown = np.degrees(np.arccos(np.clip(ways(path) @ ways(path).T, -1, 1))).max()
    assert shown > 70


def test_a_half_sphere_seen_from_everywhere_is_closed():
    random = np.random.default_rng(5)
    angles = random.uniform(0, 360, 60), np.degrees(np.arcsin(random.uniform(0.05, 1, 60)))
    assert capture_arc(bounds_of_cameras(from_angles(*angles, np.full(60, 4.0)))).closed


def test_a_ring_gives_the_orbit_that_it_always_gave():
    bounds = bounds_of_cameras(ring(12))
    size, fov = (480, 640), 45.0
    expected = orbit(
        bounds, frames=9, elevation=bounds.elevation, distance=bounds.distance, size=size, fov=fov
    )
    assert film(bounds, frames=9, size=size, fov=fov) == expected
    assert capture_arc(bounds).closed and not capture_arc(bounds_of_cameras(ring(4))).closed


def test_a_ring_that_looks_outwards_is_no_ring_round_a_subject():
    turned = []
    for camera in ring(12):
        view = np.diag([-1.0, 1, -1, 1]) @ camera.view
        turned.append(Camera(camera.size, camera.K, view))
    arc = capture_arc(bounds_of_cameras(turned))
    assert not arc.inward and not arc.closed


def test_what_is_asked_for_is_kept():
    bounds, path = filmed(handheld(), elevation=10.0, distance=5.0)
    ways = places(path) - bounds.center
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 5)
    np.testing.assert_allclose(np.degrees(np.arcsin(ways @ bounds.up / 5)), 10)


@pytest.mark.parametrize("size", [None, (480, 640), (640, 480), (90, 160)])
def test_no_frame_shows_more_than_photographs_did(size):
    bounds = bounds_of_cameras(handheld())
    found, fov = frame_of(bounds, size, None)
    camera, photograph = pinhole(found, fov, np.eye(4)), bounds.cameras[0]
    for edge, focal in ((0, 1), (1, 0)):
        seen = camera.size[edge] / camera.intrinsics[focal]
        taken = photograph.size[edge] / photograph.intrinsics[focal]
        assert seen <= taken * 1.01
    assert size is not None or (max(found) == 640 and not found[0] % 2 and not found[1] % 2)


def test_the_first_view_is_that_of_the_photograph_in_the_middle():
    bounds = bounds_of_cameras(handheld())
    camera, target = first_view(bounds)
    assert camera in bounds.cameras
    way = camera.center - MIDDLE
    assert abs(np.degrees(np.arctan2(way[1], way[0]))) < 15
    assert camera.view[2, :3] @ (target - camera.center) > 0
    alone = replace(bounds, cameras=())
    assert np.allclose(first_view(alone)[1], bounds.center)


def test_one_photograph_makes_a_film_of_itself():
    [camera] = ring(1)
    _, path = filmed([camera], frames=3)
    assert [frame.center.tolist() for frame in path] == [camera.center.tolist()] * 3


def test_the_focus_of_parallel_axes_is_among_the_points():
    cameras = wall()
    points = np.random.default_rng(0).uniform((-4, -0.2, -1), (4, 0.2, 2), (500, 3))
    focus = focus_among(cameras, points.astype(np.float32))
    assert abs(focus[1]) < 0.3
    behind = focus_among(cameras, None)
    assert behind[1] > -5, "what cameras look at is before them"
    # Where axes meet among the points, nothing is changed.
    inward = handheld()
    ball = MIDDLE + np.random.default_rng(1).normal(size=(500, 3))
    np.testing.assert_array_equal(
        focus_among(inward, ball.astype(np.float32)), focus_among(inward, None)
    )
