"""One picture of the viewer: what is drawn where a photograph is gone, and of X-rays."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cameras.camera_path import pinhole
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.commands.view.photographs import photographs_of
from rift_cl.commands.view.picture import Painter
from rift_cl.commands.view.settings import ViewSettings
from rift_cl.commands.view.wish import Wish
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture
from rift_cl.geometry.pose import look_at
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.scenes.splat_scene import XrayScene
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


def test_x_rays_are_drawn_as_line_integrals_and_through_no_lens(tmp_path):
    XrayScene(
        means=[[0.0, 0, 0]],
        log_scales=np.full((1, 3), np.log(0.3)),
        quats=[[1.0, 0, 0, 0]],
        logit_opacities=[0.0],
        sh=np.full((1, 1, 3), 0.5 / 0.28209479177387814),
    ).save(tmp_path / "xray.ply")
    settings = ViewSettings(tmp_path / "xray.ply", port=0)
    scene = settings.open_scene(densities=True)
    with pytest.raises(InputError, match="X-ray"):
        settings.open_scene()
    device = rift.default_device()
    painter = Painter(np.zeros(3, np.float32), "display", settings.bounds(scene))
    camera = pinhole((40, 40), 40, look_at(HERE, [0, 0, 0], UP))
    given = (scene.splats.upload(device), rift.Renderer(scene.rendering, device=device), camera)
    picture = painter.paint(*given, Wish(), 0)
    rows = picture[20, :, 0]
    # A Gaussian's shadow is a Gaussian: its logarithm is a parabola with the right width.
    place = (np.arange(40) + 0.5 - 20) / camera.K[0, 0] * np.linalg.norm(HERE)
    middle = np.abs(place) < 0.5
    parabola = np.polyfit(place[middle], np.log(rows[middle]), 2)
    assert -0.5 / parabola[0] == pytest.approx(0.3**2, rel=0.1)
    with pytest.raises(InputError, match="no lens"):
        painter.paint(*given, Wish(aperture=Aperture(0.1, 3.0)), 0)
