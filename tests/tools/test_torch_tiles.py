"""The rasterizer in torch draws what ours draws, so that the race compares equal work."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

torch = pytest.importorskip("torch", reason="torch is not installed")


@pytest.fixture
def tiles(tool):
    return tool("bench.torch_tiles")


@pytest.fixture
def case(tool):
    return tool("bench.splats").SplatCase(300, 64, rift.default_device())


def large(values):
    """Splats that finish every pixel, and some that must not be drawn."""
    values = {**values, "scales": 8 * values["scales"]}
    values["opacities"] = np.linspace(0.3, 1, 300, dtype=np.float32)
    values["means"] = values["means"].copy()
    values["means"][:5] = (0, 0, -5), (9, 0, 0), (0, -9, 0), (0, 0, -4), (0.5, 0, -4)
    values["opacities"][5:10] = 0.003
    return values


SCENES = {"small splats": lambda values: values, "large splats": large}


def ours(case, values, camera):
    """Image and gradients by name, the background's among them."""
    device = case.device
    renderer, background = Renderer(device=device), device.array(case.background)
    frame = renderer.forward(Splats.upload(device, **values), camera, background=background)
    grad = device.array(case.grad_image[: camera.height, : camera.width])
    found = renderer.backward(frame, grad)
    arrays = {name: getattr(found.splats, name) for name in values if name != "sh"}
    arrays |= {"sh": found.sh, "background": found.background}
    return device.get(frame.image), {name: device.get(array) for name, array in arrays.items()}


def theirs(tiles, case, values, camera):
    leaves = {name: torch.tensor(value, requires_grad=True) for name, value in values.items()}
    leaves["background"] = torch.tensor(case.background, requires_grad=True)
    parameters = {name: leaves[name] for name in values}
    image = tiles.draw(parameters, camera, leaves["background"])
    grad = torch.tensor(case.grad_image[: camera.height, : camera.width])
    (image * grad).sum().backward()
    return image.detach().numpy(), {name: leaf.grad.numpy() for name, leaf in leaves.items()}


def relative(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("size", [(64, 64), (45, 61)])
def test_image_and_gradients_are_those_of_our_renderer(tiles, case, scene, size):
    values, camera = (
        SCENES[scene](case.parameters),
        rift.Camera(size, case.camera.K, case.camera.view),
    )
    expected, gradients = ours(case, values, camera)
    image, found = theirs(tiles, case, values, camera)
    assert image.shape == (*size, 3)
    # A splat at a threshold may count for one of us alone.
    assert np.abs(image - expected).max() < 5e-3
    assert np.abs(image - expected).mean() < 1e-5
    for name, gradient in gradients.items():
        assert relative(found[name], gradient) < 1e-3, name


@pytest.mark.parametrize("changed", [{"_CHUNK": 7}, {"_PAIRS": 1}, {"_KEPT_PAIRS": 0}], ids=str)
def test_nothing_depends_on_how_the_work_is_cut(tiles, case, monkeypatch, changed):
    values = large(case.parameters)
    expected, gradients = theirs(tiles, case, values, case.camera)
    for name, value in changed.items():
        monkeypatch.setattr(tiles, name, value)
    image, found = theirs(tiles, case, values, case.camera)
    np.testing.assert_allclose(image, expected, rtol=0, atol=1e-5)
    for name, gradient in gradients.items():
        assert relative(found[name], gradient) < 1e-4, name


def test_large_splats_finish_pixels_and_some_are_culled(case):
    """What the scene above is for, lest it stops doing it."""
    device, renderer = case.device, Renderer(device=case.device)
    frame = renderer.forward(Splats.upload(device, **large(case.parameters)), case.camera)
    opaque = device.get(frame.transmittance) < 2e-3
    assert 0.1 < opaque.mean() < 0.9
    assert {"out of depth", "too faint", "off screen"} <= set(renderer.culled(frame))


def test_nothing_in_sight_shows_the_background(tiles, case):
    values = {**case.parameters, "means": case.parameters["means"] - (0, 0, 9)}
    leaves = {name: torch.tensor(value, dtype=torch.float32) for name, value in values.items()}
    image = tiles.draw(leaves, case.camera, torch.tensor(case.background))
    assert (image.numpy() == case.background).all()


def test_the_number_of_threads_is_left_as_it_was(tiles):
    before = torch.get_num_threads()
    with tiles.on_threads(before + 1):
        assert torch.get_num_threads() == before + 1
    assert torch.get_num_threads() == before
    with tiles.on_threads(None):
        assert torch.get_num_threads() == before


@pytest.mark.parametrize("before", [False, True])
def test_denormals_are_left_as_they_were(tiles, before):
    tiny = torch.tensor([1e-40])
    try:
        torch.set_flush_denormal(before)
        with tiles.flushed_denormals():
            assert not (tiny * 1).any()
        assert bool((tiny * 1).any()) is not before
    finally:
        torch.set_flush_denormal(False)


def test_the_race_records_both_and_how_far_apart_they_are(tool, case):
    every, race = tool("bench.rasterizers").RASTERIZERS, tool("bench.race")
    kinds = [kind for kind in every if kind.fits(case.device)]
    skipped: dict[str, str] = {}
    record = race.compared(kinds, case.device, case, rounds=1, seed=0, skipped=skipped)
    assert skipped == {}
    assert [entry["ours"] for entry in record["contenders"]] == [True, False, False]
    apart = [entry["accuracy"] for entry in record["contenders"]]
    assert apart[0] == {"draw": 0, "draw and gradient": 0}
    assert all(0 < distance < 1e-3 for each in apart[1:] for distance in each.values())
    assert [up["operation"] for up in record["speed_ups"]] == list(apart[1])
    table = tool("bench.tables")._rasterizers([{"name": "scene", "left_out": {}, **record}])
    assert [row[:2] for row in table.rows] == [("scene", name) for name in apart[1]]


def test_without_torch_the_peer_is_left_out_with_the_reason(tool, case, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    skipped: dict[str, str] = {}
    kinds = [kind for kind in tool("bench.rasterizers").RASTERIZERS if kind.fits(case.device)]
    record = tool("bench.race").compared(
        kinds, case.device, case, rounds=1, seed=0, skipped=skipped
    )
    assert [entry["name"] for entry in record["contenders"]] == ["rift_cl, device"]
    assert all("torch" in skipped[kind.name] for kind in kinds if not kind.ours)
    scene = {"name": "scene", "left_out": skipped, **record}
    assert "one thread left out: " in tool("bench.tables")._rasterizers([scene]).notes[-1]
