"""One picture of the viewer: what is drawn where a photograph is gone, and of X-rays."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from viewer_wire import Wire, dialled, until

import rift_cl as rift
from rift_cl.commands.cameras.camera_path import pinhole
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.commands.pictures.depth_picture import depth_and_alpha, depth_picture, depth_window
from rift_cl.commands.view.job import ViewJob
from rift_cl.commands.view.photographs import photographs_of
from rift_cl.commands.view.picture import Painter
from rift_cl.commands.view.settings import ViewSettings
from rift_cl.commands.view.wish import Wish
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture
from rift_cl.geometry.pose import look_at
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.scenes.splat_scene import SplatScene, XrayScene
from rift_cl.splat.splats import Splats

HERE, UP = [3.0, 0, 0.5], np.array([0.0, 0, 1])


def test_a_photograph_that_is_gone_is_said_and_the_picture_drawn(capture, tmp_path):
    moved = tmp_path / "transforms.json"
    moved.write_bytes((capture / "transforms.json").read_bytes())
    photographs = photographs_of(open_capture(moved, photographs=False).views)
    device = rift.default_device()
    given = {"means": [[0.0, 0, 0]], "quats": [[1.0, 0, 0, 0]], "scales": np.ones((1, 3))}
    splats = Splats.upload(device, opacities=[0.5], colors=np.ones((1, 3)), **given)
    camera = photographs[0].camera
    painter = Painter(np.zeros(3, np.float32), "display", bounds_of_cameras([camera]))
    wish = Wish(comparison="wipe", share=0.5, photograph=photographs[0])
    picture = painter.paint(splats, rift.Renderer(device=device), camera, wish, 0)
    assert picture.shape == (*camera.size, 3) and photographs[0].name in painter.trouble


@pytest.fixture
def xray(tmp_path):
    """The settings of a viewer of one Gaussian that X-rays were fitted to."""
    XrayScene(
        means=[[0.0, 0, 0]],
        log_scales=np.full((1, 3), np.log(0.3)),
        quats=[[1.0, 0, 0, 0]],
        logit_opacities=[0.0],
        sh=np.full((1, 1, 3), 0.5 / 0.28209479177387814),
    ).save(tmp_path / "xray.ply")
    return ViewSettings(tmp_path / "xray.ply", port=0)


def test_x_rays_are_drawn_as_line_integrals_and_through_no_lens(xray):
    scene = xray.open_scene(densities=True)
    with pytest.raises(InputError, match="X-ray"):
        xray.open_scene()
    device = rift.default_device()
    painter = Painter(np.zeros(3, np.float32), "display", xray.bounds(scene))
    camera = pinhole((40, 40), 40, look_at(HERE, [0, 0, 0], UP))
    given = (scene.splats.upload(device), rift.Renderer(scene.rendering, device=device), camera)
    picture = painter.paint(*given, Wish(), 0)
    rows = picture[20, :, 0]
    # A Gaussian's shadow is a Gaussian: its logarithm is a parabola with the right width.
    place = (np.arange(40) + 0.5 - 20) / camera.K[0, 0] * np.linalg.norm(HERE)
    middle = np.abs(place) < 0.5
    parabola = np.polyfit(place[middle], np.log(rows[middle]), 2)
    assert -0.5 / parabola[0] == pytest.approx(0.3**2, rel=0.1)
    # What the cameras of a capture were taken through is nothing to X-rays.
    through = painter.paint(*given, Wish(aperture=Aperture(0.1, 3.0)), 0)
    np.testing.assert_array_equal(through, picture)


def pictures_in_order(scene, bounds, targets, wish):
    """What one painter draws of several standpoints, by what the camera looks at."""
    device = rift.default_device()
    painter = Painter(np.zeros(3, np.float32), "display", bounds)
    splats, renderer = scene.splats.upload(device), rift.Renderer(scene.rendering, device=device)
    return {
        target: painter.paint(
            splats, renderer, pinhole((40, 40), 40, look_at(HERE, target, UP)), wish, 0
        )
        for target in targets
    }


AT, PAST, AWAY = (0.0, 0, 0), (0.0, 1.0, 0.5), (6.0, 0, 1)


def test_the_grey_of_x_rays_does_not_depend_on_who_looked_where_before(xray):
    scene = xray.open_scene(densities=True)
    orders = (AT, PAST, AWAY), (AWAY, PAST, AT), (PAST, AT)
    first, *others = (
        pictures_in_order(scene, xray.bounds(scene), order, Wish()) for order in orders
    )
    # From black to white, and black alone where nothing is.
    assert first[AT].max() > 0.9 and first[AT].min() < 0.01 and not first[AWAY].any()
    for found in others:
        for target, picture in found.items():
            np.testing.assert_array_equal(picture, first[target])


def test_the_colours_of_depth_are_those_of_a_render_with_the_same_cameras():
    scene = SplatScene(
        means=[[0.0, 0, 0], [-3.0, 1, 0]],
        log_scales=np.full((2, 3), np.log(0.3)),
        quats=[[1.0, 0, 0, 0]] * 2,
        logit_opacities=[6.0] * 2,
        sh=np.zeros((2, 1, 3)),
    )
    device, wish = rift.default_device(), Wish(kind="depth")
    cameras = [pinhole((40, 40), 40, look_at(at, [0, 0, 0], UP)) for at in (HERE, [3.0, 1, 0.5])]
    opened = SimpleNamespace(splats=scene, rendering=rift.SplatSettings())
    pictures = pictures_in_order(opened, bounds_of_cameras(cameras), (PAST, AT), wish)
    splats, renderer = scene.upload(device), rift.Renderer(device=device)
    window = depth_window(renderer, splats, cameras)
    for target, picture in pictures.items():
        camera = pinhole((40, 40), 40, look_at(HERE, target, UP))
        depth, alpha = depth_and_alpha(renderer, splats, camera)
        np.testing.assert_array_equal(picture, depth_picture(depth, alpha, window))


@pytest.mark.parametrize("kinds", [("colour",), ("colour", "depth")])
def test_depth_is_offered_for_light_and_not_for_x_rays(xray, tmp_path, kinds):
    pytest.importorskip("viser", reason="viser is not installed")
    if "depth" in kinds:
        scene = SplatScene(
            means=np.zeros((1, 3)),
            log_scales=np.zeros((1, 3)),
            quats=[[1.0, 0, 0, 0]],
            logit_opacities=[6.0],
            sh=np.zeros((1, 1, 3)),
        )
        scene.save(tmp_path / "light.ply")
        xray = ViewSettings(tmp_path / "light.ply", port=0)
    with ViewJob(xray) as job, dialled(job.url) as socket:
        page = Wire(socket)
        [shown] = page.wait(lambda m: m.get("props", {}).get("label") == "show")
        assert tuple(shown["props"]["options"]) == kinds
        assert shown["props"]["visible"] is (len(kinds) > 1)
        # A page may ask for anything.
        page.press("show", "depth")
        page.press("size", 321)
        until(lambda: job._viewer._page.wish.edge == 321)
        assert job._viewer._page.wish.kind == kinds[-1]
