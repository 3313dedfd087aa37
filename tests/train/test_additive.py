"""Line integrals as a linear map of densities: what the renderer draws, and the transpose of it."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from density_scenes import SIZE, cameras_of, scene

import rift_cl as rift
from rift_cl.splat.orders import count_of
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.xray.additive import Additive

pytestmark = pytest.mark.once

VIEWS = 3


def additive_of(device, order, rows=SIZE):
    parameters = Parameters.of(device, scene(order), density=True)
    renderer = Renderer(SplatSettings(mode="xray"), device=device)
    given = renderer, cameras_of(VIEWS, rows), parameters.drawn
    return Additive(*given, modes=count_of(order)), parameters


@pytest.mark.full
@pytest.mark.parametrize("order", [0, 1, 2])
def test_pictures_are_those_of_densities_with_modes(device, order):
    additive, parameters = additive_of(device, order)
    densities = device.get(parameters.drawn.opacities).astype(float)
    c = densities[:, None, None] * np.ones(additive.domain)
    if order:
        c[:, 1:, 0] *= device.get(parameters.raw["shape_modes"])
    frames = [additive.renderer.forward(parameters.drawn, camera) for camera in additive.cameras]
    wanted = np.stack([device.get(frame.image)[..., :1] for frame in frames])
    np.testing.assert_allclose(additive(c), wanted, atol=1e-5 * wanted.max())


@pytest.mark.parametrize("order", [0, 1, 3])
@pytest.mark.parametrize("rows", [1, 5])
def test_the_adjoint_is_the_transpose(device, order, rows):
    additive, _ = additive_of(device, order, rows)
    random = np.random.default_rng(order)
    c = random.normal(size=additive.domain)
    seen = additive(c)
    assert seen.shape == (VIEWS, rows, SIZE, 1)
    other = random.normal(size=seen.shape)
    scale = np.linalg.norm(seen) * np.linalg.norm(other)
    assert scale > 1
    wanted = pytest.approx(np.vdot(seen, other), abs=1e-6 * scale)
    assert np.vdot(c, additive.T(other)) == wanted


@pytest.mark.full
@pytest.mark.parametrize("kept", [0, 1])
def test_what_is_not_kept_is_drawn_anew_to_the_same_bits(device, monkeypatch, kept):
    additive, parameters = additive_of(device, 1)
    c = np.random.default_rng(0).normal(size=additive.domain)
    seen = additive(c)
    back = additive.T(seen)
    frame = additive._kept[0]
    one = frame.raster_pass.memory.fixed
    one += frame.raster_pass.memory.lists(frame.lists.n_entries, frame.lists.tiles.count)
    monkeypatch.setattr(rift.Device, "budget", (2 * kept + 1) * one + one // 2)
    few = Additive(additive.renderer, additive.cameras, parameters.drawn, modes=4)
    assert bool(few._kept) == (kept > 0) and len(few._kept) < VIEWS
    assert few(c).tobytes() == seen.tobytes()
    assert few.T(seen).tobytes() == back.tobytes()
    assert few.energies().tobytes() == additive.energies().tobytes()


@pytest.mark.full
def test_a_pickle_gives_the_same_bits():
    additive, _ = additive_of(rift.default_device(), 1)
    again = pickle.loads(pickle.dumps(additive))
    c = np.random.default_rng(0).normal(size=additive.domain)
    assert again(c).tobytes() == additive(c).tobytes()
    assert repr(again) == repr(additive)


def test_energies_are_about_the_squared_norms_of_pictures(device):
    additive, _ = additive_of(device, 0)
    found = additive.energies()
    for number in range(additive.domain[0]):
        one = np.zeros(additive.domain)
        one[number] = 1
        assert found[number] == pytest.approx(np.square(additive(one)).sum(), rel=0.1)
