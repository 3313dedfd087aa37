"""The memory that dry runs speak of is what frames of such splats are known to take.

``tests/splat`` compares ``FrameMemory.of`` with what is allocated.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

import rift_cl as rift
from rift_cl.cl.budget import format_bytes
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.render.job import Render
from rift_cl.commands.render.settings import RenderSettings
from rift_cl.splat.bands import FrameMemory
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.strategy import DefaultSettings

MANY = 10**6
# Degrees of harmonics would join in fits too long for a test.
KINDS = {
    "magnitudes": {"sh_degree": 0, "strategy": "default", "strategy.absgrad": True},
    "modes": {"sh_degree": 0, "basis": "hermite", "order": 2, "color_order": 1},
    "activation": {"sh_degree": 0, "activation": "exp"},
    "lobes": {"angular": "lg", "modes": 4, "basis": "hermite", "order": 1, "color_order": 0},
}


@pytest.fixture(scope="module", params=KINDS)
def fitted(request, capture, tmp_path_factory):
    """A little fit: its settings, and the scene that it left."""
    given = {"steps": 12, "splats": 30, "hold_out": 0, "checkpoint_every": 0}
    out = tmp_path_factory.mktemp("fit") / "fit"
    settings = FitPhotosSettings.of(capture, out, **given, **KINDS[request.param])
    list(Fit(settings).run())
    return settings, rift.SplatScene.load(out / "scene.ply")


@pytest.mark.full
def test_a_fit_wants_what_frames_of_its_splats_take(fitted, tmp_path):
    settings, scene = fitted
    training = replace(settings.training, splats=MANY)
    job = Fit(replace(settings, out=tmp_path / "none", training=training))
    size = job.training_views[0].camera.size
    absgrad = isinstance(training.strategy, DefaultSettings)
    rendering = SplatSettings(absgrad=absgrad, activation=scene.activation)
    frame = FrameMemory.of(scene.upload(rift.default_device()), size, 3, rendering)
    need = replace(frame, splats=MANY, gradient=True).fixed + 8 * frame.parameters * MANY
    assert job.plan()["device memory"].startswith(f"{need / 2**20:.0f} MiB, and about ")
    assert frame.parameters == training.numbers


@pytest.mark.parametrize("depth", [False, True])
def test_a_rendering_wants_what_frames_of_its_scene_take(fitted, tmp_path, depth):
    settings, scene = fitted
    job = Render(RenderSettings(settings.out, out=tmp_path / "none", size=(64, 48), depth=depth))
    rendering = SplatSettings(activation=scene.activation, angular=scene.angular)
    splats = scene.upload(rift.default_device())
    frame = FrameMemory.of(splats, (48, 64), 3 + depth, rendering)
    assert job.plan()["device memory"] == f"{format_bytes(frame.fixed)} and the tile lists"
