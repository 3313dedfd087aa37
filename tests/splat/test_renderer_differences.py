"""Gradients against finite differences, through smooth cut-offs, of the whole way in float64 NumPy.

The twins of ``rift_cl.reference`` are the second oracle: they share no line with torch's.
"""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import camera_of, random_splats

import rift_cl as rift
from rift_cl.geometry import Aperture
from rift_cl.reference.splat_projection import covariances, project_splats, shade_splats
from rift_cl.reference.splat_raster import Rules, raster
from rift_cl.reference.tile_lists import tile_lists
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

pytestmark = pytest.mark.dealt

SIZE = (33, 41)
STEP = 1e-5
WAYS = {
    "pinhole": ("pinhole", {}),
    "fisheye, antialiased": ("fisheye", {"antialiased": True}),
    "ortho": ("ortho", {}),
    "xray, cone": ("pinhole", {"mode": "xray"}),
    "xray, parallel": ("ortho", {"mode": "xray"}),
    "lens": ("lens", {}),
    "lens, antialiased": ("lens", {"antialiased": True}),
}


def values_of(model):
    """Everything that an image is made of, by name, in float64 of float32 numbers."""
    values = random_splats(25, coefficients=4, wide=0.8)
    values["opacities"] = np.clip(values["opacities"], 0.1, 0.8)
    values["scales"] = np.maximum(values["scales"], 0.05)
    focal = {"ortho": 11.0, "fisheye": 40.0}.get(model, 45.0)
    camera = camera_of(model.replace("lens", "pinhole"), focal=focal)
    values["background"] = np.float32([0.2, 0.5, 0.9])
    values["view"] = camera.view[:3]
    values["lens"] = np.array([focal, focal * 1.05, 20.3, 16.6])
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
    """The image from the definitions; every splat is in every tile, which smooth edges allow."""
    camera = camera_from(values, model)
    covars = covariances(values["quats"], values["scales"])
    options = {"antialiased": False, "mode": "light"} | changes
    seen = project_splats(values["means"], covars, values["opacities"], camera, **options)
    screen = np.concatenate([seen.means, seen.conics, seen.weights[:, None]], axis=1)
    colors = shade_splats(values["means"], values["sh"], camera)
    everywhere = np.tile([0, 0, 3, 3], (len(screen), 1))
    sort = options["mode"] == "light"
    lists = tile_lists(everywhere, seen.depths, tiles_x=3, tiles_y=3, sort=sort)
    rules = Rules(16, 0.99, additive=not sort, smooth=True)
    image, _ = raster(
        screen, colors, lists.entries, lists.starts, SIZE, rules, values["background"]
    )
    return image


@pytest.mark.parametrize("way", WAYS)
def test_gradients_are_differences(device, way):
    model, changes = WAYS[way]
    values, weights = values_of(model), np.random.default_rng(1).normal(size=(*SIZE, 3))
    weights = weights.astype(np.float32)
    renderer = Renderer(SplatSettings(smooth_cutoff=True, **changes), device=device)
    own = {name: values[name] for name in ("means", "quats", "scales", "opacities", "sh")}
    frame = renderer.forward(
        Splats.upload(device, **own),
        camera_from(values, model),
        background=device.array(values["background"]),
    )
    np.testing.assert_allclose(device.get(frame.image), twin(values, model, changes), atol=2e-5)
    found = renderer.backward(frame, device.array(weights), with_camera=True)
    camera = device.get(found.camera)
    gradients = {name: device.get(getattr(found.splats, name)) for name in list(own)[:4]}
    gradients |= {"sh": device.get(found.sh), "view": camera[:12], "lens": camera[12:]}
    if model == "lens":
        gradients["aperture"] = device.get(found.aperture)
    if changes.get("mode") != "xray":
        gradients["background"] = device.get(found.background)
    for name, gradient in gradients.items():
        way = np.random.default_rng(2).normal(size=values[name].shape)
        way *= np.abs(values[name]).mean() if name == "lens" else 1
        loss = [
            (
                twin(values | {name: values[name] + sign * STEP * way}, model, changes) * weights
            ).sum()
            for sign in (1, -1)
        ]
        slope = (loss[0] - loss[1]) / (2 * STEP)
        scale = np.linalg.norm(gradient) * np.linalg.norm(way)
        assert abs((gradient.ravel() * way.ravel()).sum() - slope) < 1e-3 * scale, name


@pytest.mark.full
def test_absgrad_is_the_sum_of_every_pixels_magnitude(device):
    """A pixel's gradient hangs on that pixel alone, so each can be asked for by itself."""
    size = (9, 7)
    camera = rift.Camera(size, [[9, 0, 3.5], [0, 9, 4.5], [0, 0, 1]], camera_of("pinhole").view)
    values = random_splats(12, coefficients=1, wide=0.6)
    renderer = Renderer(SplatSettings(absgrad=True, tile=8), device=device)
    frame = renderer.forward(Splats.upload(device, **values), camera)
    weights = np.random.default_rng(3).normal(size=(*size, 3)).astype(np.float32)
    whole = renderer.backward(frame, device.array(weights)).splats
    magnitudes, signed = np.zeros((12, 2)), np.zeros((12, 2))
    for y, x in np.ndindex(size):
        alone = np.zeros_like(weights)
        alone[y, x] = weights[y, x]
        by_pixel = device.get(renderer.backward(frame, device.array(alone)).splats.means2d)
        magnitudes += np.abs(by_pixel)
        signed += by_pixel
    np.testing.assert_allclose(device.get(whole.means2d), signed, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(device.get(whole.means2d_abs), magnitudes, rtol=1e-3, atol=1e-4)
