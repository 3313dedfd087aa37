"""A stranger's capture that faces a wall: the fox is in every frame of the film, and whole.

The part of the nearest photograph about the subject is found again in the middle of each frame, and
the head, which stands out from the wall, is not cut off by the frame's edges.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from skimage.feature import match_template
from skimage.transform import resize

from rift_cl.commands.cameras.fit_cameras import FitCameras, open_fit_cameras
from rift_cl.commands.cli import main
from rift_cl.commands.render.job import Render
from rift_cl.commands.render.settings import RenderSettings
from rift_cl.geometry import Camera
from rift_cl.geometry.pose import look_at
from rift_cl.io import open_capture, read_image, read_view
from rift_cl.io.captures.capture import View, camera_at
from rift_cl.splat.renderer import Renderer

FOX = Path(__file__).parents[3] / "shared" / "data" / "fox"
# By which photographs are made smaller; correlation from which on the subject is there, how much
# more that is than from behind, and how far off it may be, as a share of a frame's shorter edge.
FACTOR, LIKE, APART, OFF = 8, 0.5, 0.15, 0.2
# The head's reach to any side of its middle, as a share of the cameras' distance.
HEAD = 0.1

pytestmark = pytest.mark.skipif(not FOX.is_dir(), reason="shared data are not there")


@pytest.mark.full
def test_the_head_is_in_every_frame(tmp_path):
    fit, film = tmp_path / "fit", tmp_path / "film"
    steps = ("--steps", "400", "--splats", "4000", "--downscale", str(FACTOR))
    assert main(["fit", str(FOX), "--out", str(fit), *steps, "--checkpoint-every", "0"]) == 0
    shape = ("--frames", "6", "--film", "apng")
    assert main(["render", str(fit), "--out", str(film), *shape]) == 0
    cameras = open_fit_cameras(fit)
    render = Render(RenderSettings(fit, out=tmp_path / "none"))
    subject = render.subject
    alike = []
    for view in open_capture(film).views:
        alike.append(found(cameras, subject, view.camera, read_image(view.image)))
        assert alike[-1] > LIKE, (view.name, alike)
        x, y = place(view.camera, subject)
        reach = HEAD * np.linalg.norm(view.camera.center - subject)
        reach *= view.camera.intrinsics[0] / depth(view.camera, subject)
        width, height = view.camera.size[::-1]
        assert reach < x < width - reach and reach < y < height - reach, view.name
    # The comparison can tell: from behind the wall, the head is much less like itself.
    behind = [looking_back(camera, subject, render.bounds.up) for camera in render.cameras[::12]]
    strange = [found(cameras, subject, camera, drawn(render, camera)) for camera in behind]
    assert np.mean(alike) > np.mean(strange) + APART, (alike, strange)


def looking_back(camera: Camera, subject, up) -> Camera:
    """The camera on the other side of the wall."""
    view = look_at(2 * subject - camera.center, subject, up)
    return Camera(camera.size, camera.K, view)


def drawn(render: Render, camera: Camera):
    scene, device = render.scene, render.device
    renderer = Renderer(scene.rendering, device=device)
    return device.get(renderer.forward(scene.splats.upload(device), camera).image)


def found(cameras: FitCameras, subject, camera: Camera, frame) -> float:
    """How well the subject of the nearest photograph is found about where it should be."""

    def away(view: View) -> float:
        return float(np.linalg.norm(view.camera.center - camera.center))

    nearest = min(cameras.views, key=away)
    taken = camera_at(nearest, FACTOR)
    photograph = read_view(nearest, downscale=FACTOR)
    scale = camera.intrinsics[0] / taken.intrinsics[0]
    scale *= depth(taken, subject) / depth(camera, subject)
    photograph = resize(photograph, [round(edge * scale) for edge in photograph.shape[:2]])
    half = min(frame.shape[:2]) // 4
    part = around(photograph, np.multiply(place(taken, subject), scale), half)
    near = around(frame, place(camera, subject), half + round(OFF * min(frame.shape[:2])))
    return float(match_template(near[..., :3], part[..., :3]).max())


def around(picture, middle, half: int):
    x, y = (round(p) for p in middle)
    return picture[max(0, y - half) : y + half, max(0, x - half) : x + half]


def depth(camera: Camera, point) -> float:
    return float(camera.view[2, :3] @ point + camera.view[2, 3])


def place(camera: Camera, point) -> tuple[float, float]:
    x, y, z = camera.view[:3, :3] @ point + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return x / z * fx + cx, y / z * fy + cy
