"""A capture that faces a wall: its subject is in every frame of the film and in the first view.

Nobody gives an option. The subject is looked for in the drawn pictures themselves, by comparison
with photographs: the part of the nearest photograph that shows it is found again, and where.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from skimage.feature import match_template
from skimage.transform import resize

import rift_cl as rift
from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.cli import main
from rift_cl.commands.render.settings import RenderSettings
from rift_cl.geometry import Camera
from rift_cl.io import open_capture, read_image, read_view
from rift_cl.sample import wall

# Correlation of a blurred likeness with a photograph of the same thing, and of another.
_ALIKE = 0.55
# The picture with the mask: what hangs on the wall's middle, and not its corners, whose look
# depends most on where one stands.
_HALF = np.array([0.7, 0.2, 0.55])


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A short fit of the wall, and a film of it."""
    folder = tmp_path_factory.mktemp("wall")
    fit, film = folder / "fit", folder / "film"
    steps = ("--steps", "300", "--splats", "2500", "--checkpoint-every", "0")
    assert main(["fit", str(wall()), "--out", str(fit), *steps]) == 0
    assert main(["render", str(fit), "--out", str(film), "--frames", "16"]) == 0
    return SimpleNamespace(fit=fit, film=film)


def box(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Corners (x, y) of the subject's rectangle in a picture, in pixels; all lie before it."""
    corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * _HALF
    local = corners @ camera.view[:3, :3].T + camera.view[:3, 3]
    assert (local[:, 2] > 0).all()
    fx, fy, cx, cy = camera.intrinsics
    places = local[:, :2] / local[:, 2:] * [fx, fy] + [cx, cy]
    return places.min(axis=0), places.max(axis=0)


def likeness(image: np.ndarray, camera: Camera) -> tuple[float, float]:
    """How like the subject of the nearest photograph the likest part of a picture is, and how far
    that part is from where the subject should be, as a share of the picture's width."""
    views = open_capture(wall()).views
    far = [np.linalg.norm(view.camera.center - camera.center) for view in views]
    nearest = views[int(np.argmin(far))]
    low, high = box(nearest.camera)
    (left, top), (right, bottom) = np.floor(low).astype(int), np.ceil(high).astype(int)
    part = read_view(nearest)[top:bottom, left:right].mean(axis=2)
    there_low, there_high = box(camera)
    scale = (there_high - there_low) / (high - low)
    part = resize(part, np.maximum(2, np.rint(part.shape * scale[::-1])).astype(int))
    found = match_template(image[..., :3].mean(axis=2), part)
    y, x = np.unravel_index(found.argmax(), found.shape)
    away = np.linalg.norm(np.array([x, y]) - there_low)
    return float(found.max()), float(away / camera.width)


def assert_shows_the_subject(image: np.ndarray, camera: Camera) -> None:
    low, high = box(camera)
    assert (low >= 0).all() and (high <= camera.size[::-1]).all()
    alike, away = likeness(image, camera)
    assert alike > _ALIKE and away < 0.05, (alike, away)


@pytest.mark.full
def test_the_subject_is_in_every_frame_of_the_film(fitted):
    views = open_capture(fitted.film).views
    assert len(views) == 16
    for view in views:
        assert_shows_the_subject(read_image(view.image), view.camera)


def drawn(fit, camera: Camera) -> np.ndarray:
    splats = rift.SplatScene.load(fit / "scene.ply").upload(rift.default_device())
    frame = rift.Renderer().forward(splats, camera)
    return np.clip(rift.default_device().get(frame.image), 0, 1)


@pytest.mark.full
def test_the_first_view_is_a_photographs_and_shows_the_subject(fitted):
    settings = RenderSettings(scene=fitted.fit)
    camera, _ = first_view(settings.bounds(settings.open_scene()))
    centers = [view.camera.center for view in open_capture(wall()).views]
    assert min(np.linalg.norm(center - camera.center) for center in centers) < 1e-6
    assert_shows_the_subject(drawn(fitted.fit, camera), camera)


@pytest.mark.full
def test_from_behind_the_wall_no_subject_is_found(fitted):
    """The comparison can tell: what an orbit would draw there is not like the photographs."""
    view = open_capture(fitted.film).views[0]
    turned = np.diag([-1.0, -1, 1, 1])
    behind = Camera(view.camera.size, view.camera.K, view.camera.view @ turned)
    alike, away = likeness(drawn(fitted.fit, behind), behind)
    assert alike < _ALIKE or away > 0.05
