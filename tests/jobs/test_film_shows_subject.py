"""What was photographed is in every frame of a film and in the first view: found by its picture."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.feature import match_template
from skimage.transform import resize

import rift_cl as rift
from rift_cl.cli import main
from rift_cl.geometry import Camera
from rift_cl.io.capture import camera_at, open_capture, read_view
from rift_cl.io.image import read_image
from rift_cl.jobs.camera_path import orbit
from rift_cl.jobs.cameras.film import first_view
from rift_cl.jobs.cameras.fit_cameras import open_fit_cameras
from rift_cl.jobs.orbit_input import OrbitInput
from rift_cl.sample import wall
from rift_cl.splat.renderer import Renderer

# Correlation with the photograph from which on the subject is there, and how far from the middle
# it may be, as a share of the frame's shorter edge.
LIKE, OFF = 0.6, 0.25
# By which photographs are made smaller.
FACTOR = 2


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A short fit of a capture from one side."""
    out = tmp_path_factory.mktemp("wall") / "fit"
    words = ["--steps", "100", "--splats", "1500", "--downscale", str(FACTOR), "--quiet"]
    assert main(["fit", str(wall()), "--out", str(out), "--checkpoint-every", "0", *words]) == 0
    return out


def found(fit, camera: Camera, frame):
    """How well the subject of the nearest photograph is found in a frame, and how far off."""
    cameras = open_fit_cameras(fit)
    view = min(cameras.views, key=lambda v: np.linalg.norm(v.camera.center - camera.center))
    photograph = read_view(view, downscale=FACTOR)[..., :3].mean(axis=2)
    taken = camera_at(view, FACTOR)
    near, far = (np.linalg.norm(c.center - cameras.focus) for c in (taken, camera))
    scale = camera.intrinsics[0] / taken.intrinsics[0] * near / far
    size = tuple(round(edge * scale) for edge in photograph.shape)
    photograph = resize(photograph, size, anti_aliasing=scale < 1)
    x, y = (round(p * scale) for p in place(taken, cameras.focus))
    half = min(frame.shape[:2]) // 4
    subject = photograph[max(0, y - half) : y + half, max(0, x - half) : x + half]
    scores = match_template(frame.mean(axis=2), subject)
    at = np.unravel_index(scores.argmax(), scores.shape)
    off = np.add(at, np.array(subject.shape) / 2) - np.array(frame.shape[:2]) / 2
    return float(scores.max()), float(np.abs(off).max() / min(frame.shape[:2]))


def place(camera, point):
    x, y, z = camera.view[:3, :3] @ point + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return x / z * fx + cx, y / z * fy + cy


def drawn(fit, cameras):
    scene = OrbitInput(fit).open_scene()
    device = rift.default_device()
    renderer, splats = Renderer(scene.drawing, device=device), scene.splats.upload(device)
    return [device.get(renderer.forward(splats, c).image)[..., :3] for c in cameras]


def test_the_subject_is_in_every_frame_of_a_film(fitted, tmp_path):
    words = ["--frames", "8", "--size", "200", "150", "--film", "apng", "--quiet"]
    assert main(["render", str(fitted), "--out", str(tmp_path / "film"), *words]) == 0
    for view in open_capture(tmp_path / "film").views:
        like, off = found(fitted, view.camera, read_image(tmp_path / "film" / view.name))
        assert like > LIKE and off < OFF, view.name


def test_the_subject_is_in_the_first_view(fitted):
    asked = OrbitInput(fitted)
    camera, _ = first_view(asked.bounds(asked.open_scene()))
    [frame] = drawn(fitted, [camera])
    assert found(fitted, camera, frame)[0] > LIKE


def test_a_full_turn_would_be_told(fitted):
    """The comparison itself: from behind, the subject is not found."""
    asked = OrbitInput(fitted)
    bounds = asked.bounds(asked.open_scene())
    turn = orbit(bounds, frames=8, elevation=0, distance=bounds.distance, size=(150, 200), fov=40)
    scores = [found(fitted, c, f)[0] for c, f in zip(turn, drawn(fitted, turn), strict=True)]
    # Half of a full turn is behind the wall, and beside it there is little to see.
    assert sum(score < 0.5 for score in scores) >= 4 and max(scores) > LIKE
