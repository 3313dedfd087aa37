"""Photographs in the viewer: laid over a picture where they belong, and jumped to."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from viewer_wire import Wire, dialled, until

import rift_cl as rift
from rift_cl.commands.cameras.camera_path import pinhole
from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.inputs.scene_bounds import SceneBounds, bounds_of_cameras
from rift_cl.commands.view import path_panel
from rift_cl.commands.view.crop import Crop, cropped
from rift_cl.commands.view.path_panel import KeyFrame, PathPanel, path_file, way_through
from rift_cl.commands.view.photographs import (
    Photograph,
    compared,
    photographs_of,
    seen_by,
    taken_from,
)
from rift_cl.commands.view.pose import Pose
from rift_cl.commands.view.standpoint import standpoint_of
from rift_cl.commands.view.viewer import SplatViewer
from rift_cl.geometry import Aperture
from rift_cl.geometry.pose import look_at
from rift_cl.io.captures.capture import open_capture
from rift_cl.splat.splats import Splats

HERE, UP = [3.0, 0, 0.5], np.array([0.0, 0, 1])
SEEN = pinhole((60, 80), 40, look_at(HERE, [0, 0, 0], UP))


def spot(camera, point):
    """A black photograph with a white spot of nine pixels where a camera sees a point."""
    image = np.zeros((*camera.size, 3), np.float32)
    x, y = pixel(camera, point)
    image[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2] = 1
    return Photograph("spot", camera, lambda: image)


def pixel(camera, point):
    local = camera.view[:3, :3] @ point + camera.view[:3, 3]
    return (camera.K @ local)[:2] / local[2]


@pytest.mark.parametrize(("size", "fov"), [((60, 80), 40), ((90, 70), 55), ((25, 30), 45)])
def test_a_photograph_is_laid_where_another_camera_in_its_place_sees_it(size, fov):
    point = np.array([0.1, 0.4, 0.2])
    page = pinhole(size, fov, look_at(HERE, [0.2, 0.3, -0.1], UP))
    seen, known = seen_by(spot(SEEN, point), page)
    assert seen.shape == (*size, 3) and known.any() and not known.all()
    weights = seen[..., 0]
    rows, columns = np.indices(size) + 0.5
    found = [(weights * axis).sum() / weights.sum() for axis in (columns, rows)]
    np.testing.assert_allclose(found, pixel(page, point), atol=0.8)


def test_what_is_behind_the_photographer_shows_nothing():
    page = pinhole((40, 40), 40, look_at(HERE, [6, 0, 1], UP))
    assert not seen_by(spot(SEEN, np.zeros(3)), page)[1].any()


def test_wipe_shows_the_photograph_left_of_the_line_and_blend_mixes():
    drawn, seen = np.zeros((4, 10, 3), np.float32), np.full((4, 10, 3), 0.5, np.float32)
    known = np.ones((4, 10), bool)
    known[:, 8:] = False
    wiped = compared(drawn, seen, known, "wipe", 0.5)[0, :, 0]
    np.testing.assert_array_equal(wiped, [0.5] * 3 + [1, 1] + [0] * 5)
    assert (compared(drawn, seen, known, "wipe", 1)[:, :8] == 0.5).all()
    assert (compared(drawn, seen, known, "wipe", 0) == 0).all()
    np.testing.assert_allclose(
        compared(drawn, seen, known, "blend", 0.5)[0, :, 0][[0, 9]], [0.25, 0]
    )


def test_photographs_are_compared_with_from_their_place_alone():
    near = dataclasses.replace
    photograph = spot(SEEN, np.zeros(3))
    page = pinhole((60, 80), 50, look_at(HERE, [1, 1, 1], UP))
    assert taken_from(photograph, page, 3.0)
    moved = pinhole((60, 80), 50, look_at([3.1, 0, 0.5], [0, 0, 0], UP))
    assert not taken_from(near(photograph), moved, 3.0)


@pytest.mark.parametrize("roll", [0.0, 0.4, np.pi / 2])
@pytest.mark.parametrize("aspect", [0.5, 2.0])
def test_a_standpoint_sees_all_of_the_photograph_as_it_was_held(roll, aspect):
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]]
    camera = rift.Camera(
        (60, 80), SEEN.K + np.array([[0, 0, 5], [0, 0, -3], [0, 0, 0]]), turn @ SEEN.view
    )
    there = standpoint_of(camera, np.zeros(3), UP, aspect)
    window = pinhole(
        (100, round(100 * aspect)),
        np.degrees(there.fov),
        look_at(there.position, there.target, there.up),
    )
    np.testing.assert_allclose(window.view, camera.view, atol=1e-9)
    corners = [np.linalg.solve(camera.K, [x, y, 1]) for x in (0, 80) for y in (0, 60)]
    shown = np.array([(window.K @ corner)[:2] for corner in corners])
    assert (shown >= -0.5).all() and (shown <= np.array(window.size[::-1]) + 0.5).all()


def test_the_crop_box_hides_what_is_outside():
    device = rift.default_device()
    means = np.array([[0, 0, 0], [2, 0, 0], [0, -2, 0]], np.float32)
    given = {"quats": np.tile([1.0, 0, 0, 0], (3, 1)), "scales": np.ones((3, 3))}
    splats = Splats.upload(device, means=means, opacities=np.full(3, 0.5), **given)
    shown = cropped(splats, Crop((-1, -1, -1), (1, 1, 1)), device)
    np.testing.assert_array_equal(device.get(shown.opacities), [0.5, 0, 0])
    np.testing.assert_array_equal(device.get(splats.opacities), [0.5] * 3)
    assert cropped(splats, None, device) is splats


def test_a_box_has_twelve_edges_each_along_one_axis():
    low, high = np.array([-1, -2, -3.0]), np.array([1, 2, 0.5])
    edges = Crop(tuple(low), tuple(high)).edges()
    lengths = np.abs(edges[:, 1] - edges[:, 0])
    assert edges.shape == (12, 2, 3) and (np.count_nonzero(lengths, axis=1) == 1).all()
    np.testing.assert_allclose(lengths.sum(axis=0), 4 * (high - low))
    assert len({edge.tobytes() for edge in edges}) == 12


def test_the_exported_path_is_read_back_as_the_way_that_was_played(tmp_path):
    keys = [
        KeyFrame(Pose((1.0, 0, 0, 0), (0.0, 0, -4), 0.8, 1.5), Aperture(0.1, 2.0)),
        KeyFrame(Pose((0.9, 0, 0.1, 0), (1.0, 0, -4), 0.6, 1.4), Aperture(0.1, 3.0)),
        KeyFrame(Pose((0.8, 0, 0.2, 0), (2.0, 1, -3), 0.7, 1.5)),
    ]
    way = way_through(keys, 3, 300)
    assert len(way) == 9 and {camera.size for camera in way} == {(200, 300)}
    np.testing.assert_allclose(way[4].center, keys[1].pose.position, atol=1e-12)
    (tmp_path / "path.json").write_bytes(path_file(way))
    views = open_capture(tmp_path / "path.json", photographs=False).views
    for view, camera in zip(views, way, strict=True):
        assert view.camera.size == camera.size
        np.testing.assert_allclose(view.camera.view, camera.view, atol=1e-6)
        np.testing.assert_allclose(view.camera.K, camera.K, rtol=1e-9)
        assert view.camera.aperture == camera.aperture


@pytest.fixture
def shown(capture):
    """A viewer of a capture, and its photographs."""
    pytest.importorskip("viser", reason="viser is not installed")
    photographs = photographs_of(open_capture(capture).views)
    bounds: SceneBounds = bounds_of_cameras([photograph.camera for photograph in photographs])
    with SplatViewer(bounds, photographs=photographs, port=0) as viewer:
        yield viewer, photographs


def test_a_page_opens_at_a_photograph_and_steps_to_the_next(shown):
    viewer, photographs = shown
    with dialled(viewer.url) as socket:
        page = Wire(socket)
        [first] = page.wait(lambda m: m["type"] == "SetCameraPositionMessage")[:1]
        cameras = [photograph.camera for photograph in photographs]
        number = cameras.index(first_view(bounds_of_cameras(cameras))[0])
        np.testing.assert_allclose(first["position"], photographs[number].camera.center, atol=1e-6)
        page.wait(lambda m: m["type"] == "CameraFrustumMessage")
        until(lambda: viewer._clients)
        page.press("photograph", "next")
        page.wait(lambda m: m["type"] == "SetCameraPositionMessage" and not m["initial"])
        page.wait(lambda m: m["type"] == "SetCameraLookAtMessage" and not m["initial"])
        there, camera = page.stands(), photographs[(number + 1) % len(photographs)].camera
        np.testing.assert_allclose(there["position"], camera.center, atol=1e-6)
        way = there["look_at"] - there["position"]
        np.testing.assert_allclose(way / np.linalg.norm(way), camera.view[2, :3], atol=1e-6)


def test_what_the_panels_are_set_to_is_what_is_wished_for(shown):
    viewer, photographs = shown
    with dialled(viewer.url) as socket:
        page = Wire(socket)
        until(lambda: viewer._clients)
        page.press("compare", "wipe")
        page.press("share", 0.25)
        page.press("crop")
        page.press("x", (-0.5, 0.25))
        page.press("size", 300)
        page.press("show", "depth")
        until(lambda: viewer._page.wish.kind == "depth")
        wish = viewer._page.wish
        assert (wish.comparison, wish.share, wish.edge) == ("wipe", 0.25, 300)
        assert wish.photograph in photographs
        assert (wish.crop.low[0], wish.crop.high[0]) == (-0.5, 0.25)
        # Nonsense is as if it were not said.
        page.press("x", (1, 2, 3))
        page.press("share", float("nan"))
        page.press("aperture", float("inf"))
        until(lambda: viewer._page.wish.share != 0.25)
        wish = viewer._page.wish
        assert (wish.crop, wish.share, wish.aperture) == (None, 0.0, None)


def test_key_frames_become_a_file_to_render(shown):
    viewer, _ = shown
    with dialled(viewer.url) as socket:
        page = Wire(socket)
        until(lambda: viewer._clients)
        for _ in range(2):
            page.press("key frames", "add")
        page.press("between", 4)
        until(lambda: len(viewer._page.path.cameras()) == 6)
        page.press("film", "export")
        [file] = page.wait(lambda m: m["type"] == "FileTransferStartDownload")
        assert file["filename"] == "path.json" and file["size_bytes"] > 1000
        page.press("key frames", "clear")
        until(lambda: not viewer._page.path.cameras())


def test_the_lens_is_that_of_the_photograph_until_it_is_set(shown):
    viewer, _ = shown
    lens = viewer._page.lens
    assert viewer._page.wish.aperture is None and viewer._page.hands_over is False
    lens.take(Aperture(0.05, 2.0))
    found = viewer._page.wish.aperture
    assert found.radius == pytest.approx(0.05, rel=0.01) and found.focus == pytest.approx(2.0)
    with dialled(viewer.url) as socket:
        page = Wire(socket)
        until(lambda: viewer._clients)
        page.press("photograph", "next")
        until(lambda: viewer._page.wish.aperture is None)


@pytest.mark.parametrize("end", ["stop", "leave"])
def test_a_way_is_played_no_further_once_nobody_sees_it(monkeypatch, end):
    keys = [KeyFrame(Pose((1.0, 0, 0, 0), (float(x), 0, -4), 0.8, 1.5)) for x in range(200)]
    panel, shown = PathPanel(MagicMock(), SimpleNamespace(aperture=None), lambda: 60), []

    def step(client, there):
        shown.append(there)
        if len(shown) == 3:
            panel.stop() if end == "stop" else panel.leave(client)

    monkeypatch.setattr(path_panel, "go", step)
    camera = SimpleNamespace(look_at=np.zeros(3), position=np.ones(3))
    panel._play(way_through(keys, 0, 60), SimpleNamespace(camera=camera))
    assert len(shown) == 3
