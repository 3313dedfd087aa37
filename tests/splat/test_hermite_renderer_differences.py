"""Splats with Hermite modes, the whole way: image and every gradient against float64 twins.

Gradients are compared with differences of the twins, through smooth cut-offs; every splat is then
in every tile, and the twins' tile lists need no rectangles.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from projection_scenes import camera_of, random_splats

import rift_cl as rift
from rift_cl.geometry import Aperture
from rift_cl.reference.hermite_projection import project_modes, splat_roots
from rift_cl.reference.hermite_raster import HermiteRules, HermiteSplats, hermite_raster
from rift_cl.reference.splat_projection import project_splats, shade_splats
from rift_cl.reference.splat_raster import Rules
from rift_cl.reference.tile_lists import tile_lists
from rift_cl.splat.orders import count_of
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

pytestmark = pytest.mark.dealt

SIZE, STEP, COUNT = (17, 23), 1e-5, 12
# Orders of shape and colour, camera, settings.
WAYS = {
    "clamp": (1, 1, "pinhole", {}),
    "exp, antialiased": (2, 1, "pinhole", {"activation": "exp", "antialiased": True}),
    "square, ortho": (2, 0, "ortho", {"activation": "square"}),
    "square, lens": (1, 1, "lens", {"activation": "square"}),
    "exp, lens, antialiased": (1, 0, "lens", {"activation": "exp", "antialiased": True}),
    "colour alone, fisheye": (0, 2, "fisheye", {}),
    "xray, cone": (2, 1, "pinhole", {"mode": "xray"}),
    "xray, parallel": (3, 0, "ortho", {"mode": "xray"}),
    "exp without modes": (0, 0, "pinhole", {"activation": "exp"}),
}
PARAMETERS = ("means", "quats", "scales", "opacities", "sh", "colors", "shape_modes", "color_modes")


@cache
def values_of(way):
    """Everything that an image is made of, by name, in float64 of float32 numbers."""
    shape, color, model, _ = WAYS[way]
    values, random = random_splats(COUNT, coefficients=4, wide=0.6), np.random.default_rng(9)
    values["opacities"] = np.clip(values["opacities"], 0.1, 0.8)
    values["scales"] = np.maximum(values["scales"], 0.08)
    values["colors"] = random.uniform(0, 1, (COUNT, 1))
    if shape:
        values["shape_modes"] = 0.3 * random.standard_normal((COUNT, count_of(shape) - 1))
    if color:
        values["color_modes"] = 0.3 * random.standard_normal((COUNT, count_of(color) - 1, 4))
    focal = {"ortho": 6.0, "fisheye": 22.0}.get(model, 25.0)
    values["background"] = np.array([0.2, 0.5, 0.9, 0.4])
    values["view"] = camera_of(model.replace("lens", "pinhole")).view[:3]
    values["lens"] = np.array([focal, focal * 1.05, 11.3, 8.6])
    if model == "lens":
        values["aperture"] = np.array([0.3, 3.8])
    return {name: np.asarray(value, np.float32).astype(float) for name, value in values.items()}


def camera_from(values, model):
    fx, fy, cx, cy = values["lens"]
    view = np.vstack([values["view"], [0, 0, 0, 1]])
    K = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
    if model != "lens":
        return rift.Camera(SIZE, K, view, model)
    radius, focus = map(float, values["aperture"])
    return rift.Camera(SIZE, K, view, aperture=Aperture(radius, focus, wavelength=0.02))


def twin(values, model, changes):
    """The image from the definitions."""
    camera = camera_from(values, model)
    changes = {"antialiased": False, "mode": "light", "activation": "clamp"} | changes
    activation = changes.pop("activation")
    roots = splat_roots(values["quats"], values["scales"])
    covars = roots @ roots.transpose(0, 2, 1)
    seen = project_splats(values["means"], covars, values["opacities"], camera, **changes)
    modes = project_modes(
        *(values["means"], roots, seen.covars, camera),
        *(values.get("shape_modes"), values.get("color_modes")),
    )
    screen = np.concatenate([seen.means, seen.conics, seen.weights[:, None]], axis=1)
    colors = shade_splats(values["means"], values["sh"], camera)
    features = np.concatenate([colors, values["colors"]], axis=1)
    additive = changes["mode"] == "xray"
    everywhere = np.tile([0, 0, 2, 2], (len(screen), 1))
    lists = tile_lists(everywhere, seen.depths, tiles_x=2, tiles_y=2, sort=not additive)
    how = HermiteRules(Rules(16, 0.99, additive=additive, smooth=True), activation)
    splats = HermiteSplats(screen, modes.table[:, :3], modes.shape, features, modes.color)
    back = values["background"]
    return hermite_raster(splats, lists.entries, lists.starts, SIZE, how, back)[0]


@cache
def weights():
    return np.random.default_rng(1).normal(size=(*SIZE, 4)).astype(np.float32)


def direction(name, value):
    way = np.random.default_rng(2).normal(size=value.shape)
    return way * (np.abs(value).mean() if name == "lens" else 1)


@cache
def slope(way, name):
    """How the loss of a way to draw changes with one of its arrays."""
    _, _, model, changes = WAYS[way]
    values = values_of(way)
    along = direction(name, values[name])
    there, here = (
        (
            twin(values | {name: values[name] + sign * STEP * along}, model, changes) * weights()
        ).sum()
        for sign in (1, -1)
    )
    return (there - here) / (2 * STEP)


def draw(device, way):
    values, (_, _, model, changes) = values_of(way), WAYS[way]
    own = {name: values[name] for name in PARAMETERS if name in values}
    renderer = Renderer(SplatSettings(smooth_cutoff=True, **changes), device=device)
    camera, background = camera_from(values, model), device.array(values["background"])
    return renderer, renderer.forward(Splats.upload(device, **own), camera, background=background)


def gradients_of(renderer, frame):
    """All gradients by name, on the host."""
    device = renderer.device
    found = renderer.backward(frame, device.array(weights()), with_camera=True)
    arrays = {
        name: getattr(found.splats, name) for name in ("means", "quats", "scales", "opacities")
    }
    names = ("sh", "colors", "shape_modes", "color_modes", "background", "aperture")
    arrays |= {name: getattr(found, name) for name in names}
    host = {name: device.get(array) for name, array in arrays.items() if array is not None}
    camera = device.get(found.camera)
    return host | {"view": camera[:12].reshape(3, 4), "lens": camera[12:]}


@pytest.mark.full
@pytest.mark.parametrize("way", WAYS)
def test_image_is_the_twins(device, way):
    _, _, model, changes = WAYS[way]
    _, frame = draw(device, way)
    right = twin(values_of(way), model, changes)
    assert np.abs(device.get(frame.image) - right).max() < 1e-4 * max(1, np.abs(right).max())


@pytest.mark.parametrize("way", WAYS)
def test_gradients_are_differences(device, way):
    values, found = values_of(way), gradients_of(*draw(device, way))
    xray = WAYS[way][3].get("mode") == "xray"
    assert set(found) == set(values) - ({"background"} if xray else set())
    for name, gradient in found.items():
        along = direction(name, values[name])
        scale = np.linalg.norm(gradient) * np.linalg.norm(along)
        assert scale > 0, name
        assert abs((gradient * along).sum() - slope(way, name)) < 1e-3 * scale, name


@pytest.mark.full
def test_depth_is_a_channel_without_polynomial(device):
    """It comes after the channels that have one, and its gradient finds its place."""
    values = values_of("clamp")
    own = {name: values[name] for name in PARAMETERS if name in values}
    camera = camera_from(values, "pinhole")
    renderer = Renderer(SplatSettings(smooth_cutoff=True), device=device)
    splats = Splats.upload(device, **own)
    plain = renderer.forward(splats, camera)
    frame = renderer.forward(splats, camera, depth="accumulated")
    np.testing.assert_allclose(
        device.get(frame.image)[..., :4], device.get(plain.image), rtol=1e-5, atol=1e-6
    )
    coming = np.zeros((*SIZE, 5), np.float32)
    coming[..., 4] = weights()[..., 0]
    found = renderer.backward(frame, device.array(coming), with_background=False)
    step = 1e-2

    def loss(sign):
        moved = own | {"shape_modes": own["shape_modes"] + sign * step * along}
        drawn = renderer.forward(Splats.upload(device, **moved), camera, depth="accumulated")
        return (device.get(drawn.image).astype(float) * coming).sum()

    along = direction("shape_modes", own["shape_modes"])
    right = (loss(1) - loss(-1)) / (2 * step)
    gradient = device.get(found.shape_modes)
    scale = np.linalg.norm(gradient) * np.linalg.norm(along)
    assert abs((gradient * along).sum() - right) < 2e-3 * scale
    assert not device.get(found.color_modes).any()
