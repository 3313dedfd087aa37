"""Gradients of the projection of modes: from moments to parameters, against differences.

The loss is linear in what a few pixels of every splat see, with the weights that a rasterizer
would have; its moments go in, and its differences in float64 are what must come out. No pixel
belongs to two splats, so that one difference serves all of them.
"""

from __future__ import annotations

import numpy as np
import pytest
from hermite_projection_scenes import (
    MODALS,
    in_double,
    modal_splats,
    polynomials,
    twin_of,
    whitened,
)

import rift_cl as rift
from rift_cl.cl.arithmetic import sum_columns
from rift_cl.errors import ShapeError
from rift_cl.geometry import Aperture
from rift_cl.splat.projection import project, project_grad
from rift_cl.splat.splats import Splats

pytestmark = pytest.mark.dealt

PIXELS, STEP = 7, 1e-5
CHANNELS = 4


class Loss:
    """Weights of what is seen at random pixels: dL/dE, and w v_c of every channel."""

    def __init__(self, values, modal, seed=3):
        random = np.random.default_rng(seed)
        self.values, self.modal = in_double(values), modal
        seen, modes = twin_of(values, modal)
        count = len(values["means"])
        u = random.normal(0, 1.2, (count, PIXELS, 2))
        away = np.einsum("nab,npb->npa", np.linalg.inv(modes.whitening), u)
        self.pixels = seen.means[:, None] + away
        self.by_density = random.normal(size=(count, PIXELS))
        self.by_color = random.normal(size=(count, PIXELS, CHANNELS))

    def parts(self, values, camera=None):
        """Weight g, Q, all modes, and the colours' polynomials without their constants."""
        seen, modes = twin_of(values, self.modal, camera)
        u = whitened(seen, modes, self.pixels)
        he = polynomials(modes, (self.modal.shape + 2, self.modal.color), u)
        peak = seen.weights[:, None] * np.exp(-(u**2).sum(2) / 2)
        shape, color = modes.shape.shape[1], modes.color.shape[1]
        q = 1 + np.einsum("mnp,nm->np", he[1 : 1 + shape], modes.shape)
        tint = np.einsum("mnp,nmc->npc", he[1 : 1 + color], modes.color)
        return peak, q, he, tint

    def __call__(self, values, camera=None):
        """The loss of each splat."""
        peak, q, _, tint = self.parts(values, camera)
        density = peak * q * (q if self.square else 1)
        loss = (self.by_density * density).sum(1)
        return loss + (self.by_color[..., : tint.shape[2]] * tint).sum((1, 2))

    @property
    def square(self):
        return self.modal.settings.activation == "square"

    def moments(self):
        peak, q, he, _ = self.parts(self.values)
        h = self.by_density * peak * (q if self.square else 1)
        orders = self.modal.shape, self.modal.color
        shape, color = ((n + 1) * (n + 2) // 2 for n in (orders[0] + 2, orders[1]))
        parts = [np.einsum("mnp,np->nm", he[:shape], h), self.by_color.sum(1)]
        if orders[1]:
            tint = np.einsum("mnp,npc->nmc", he[1:color], self.by_color[..., :3])
            parts.append(tint.reshape(len(h), -1))
        return np.concatenate(parts, 1)


def run(device, values, modal, moments):
    """All gradients on the device, on the host; and which splats are drawn."""
    splats, given = Splats.upload(device, **values), (modal.camera, modal.settings)
    projected = project(device, splats, *given)
    gradients = project_grad(projected, device.array(moments.astype(np.float32)))
    host = {name: device.get(array) for name, array in vars(gradients).items() if array is not None}
    for name in {"camera", "aperture"} & set(host):
        host[name] = device.get(sum_columns(device, getattr(gradients, name)))
    return host, device.get(projected.culled) == 0


def shifted(values, name, way, step):
    return values | {name: values[name] + step * way}


def slope(loss, name, way):
    """The derivative of every splat's loss along a way."""
    here, there = (loss(shifted(loss.values, name, way, sign * STEP)) for sign in (1, -1))
    return (here - there) / (2 * STEP)


def error(found, right):
    return np.linalg.norm(found - right) / np.linalg.norm(right)


@pytest.mark.parametrize("name", MODALS)
def test_gradients_are_differences(device, name):
    modal = MODALS[name]
    values = modal_splats(modal)
    values.pop("sh")
    values["colors"] = np.zeros((100, 3), np.float32)
    values["scales"] = np.maximum(values["scales"], 0.03)
    loss = Loss(values, modal)
    found, drawn = run(device, values, modal, loss.moments())
    assert drawn.sum() > 60
    np.testing.assert_allclose(found["features"][drawn], loss.by_color.sum(1)[drawn], rtol=1e-5)
    random = np.random.default_rng(5)
    names = {"means", "quats", "scales", "opacities", "shape_modes", "color_modes"} & set(values)
    for what in sorted(names):
        way = random.standard_normal(values[what].shape)
        axes = tuple(range(1, way.ndim))
        right = slope(loss, what, way)[drawn]
        mine = (found[what] * way).sum(axes)[drawn]
        # Splats are as different as 1 to 1e4 in what a loss hangs on: each counts as much.
        size = np.linalg.norm((found[what] * way).reshape(100, -1), axis=1)[drawn]
        assert np.abs(mine - right).max() <= 1e-3 * np.abs(right).max(), what
        assert np.median(np.abs(mine - right) / size) < 1e-4, what
        assert np.linalg.norm(found[what][~drawn]) == 0, what


@pytest.mark.parametrize("name", MODALS)
def test_gradient_by_the_camera_is_differences(device, name):
    modal = MODALS[name]
    values = modal_splats(modal)
    values.pop("sh")
    values["colors"] = np.zeros((100, 3), np.float32)
    values["scales"] = np.maximum(values["scales"], 0.03)
    loss = Loss(values, modal)
    found, drawn = run(device, values, modal, loss.moments())
    camera, random = modal.camera, np.random.default_rng(6)
    numbers = np.concatenate([camera.view[:3].ravel(), camera.intrinsics])
    way = random.standard_normal(16) * np.where(np.arange(16) < 12, 1, 20)

    def at(step):
        view = np.vstack([(numbers + step * way)[:12].reshape(3, 4), [0, 0, 0, 1]])
        fx, fy, cx, cy = (numbers + step * way)[12:]
        K = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
        other = rift.Camera(camera.size, K, view, camera.model, camera.aperture)
        return loss(loss.values, other)[drawn].sum()

    right = (at(STEP) - at(-STEP)) / (2 * STEP)
    scale = np.linalg.norm(found["camera"] * way)
    assert abs((found["camera"] * way).sum() - right) < 1e-3 * scale


@pytest.mark.full
def test_gradient_by_the_aperture_is_differences(device):
    modal = MODALS["lens"]
    values = modal_splats(modal)
    values.pop("sh")
    values["colors"] = np.zeros((100, 3), np.float32)
    loss = Loss(values, modal)
    found, drawn = run(device, values, modal, loss.moments())
    aperture, camera = modal.aperture, modal.camera

    def at(radius, focus):
        other = Aperture(radius, focus, aperture.wavelength)
        other = rift.Camera(camera.size, camera.K, camera.view, aperture=other)
        return loss(loss.values, other)[drawn].sum()

    here, step = (aperture.radius, aperture.focus), 1e-6
    right = [
        (at(here[0] + step, here[1]) - at(here[0] - step, here[1])) / (2 * step),
        (at(here[0], here[1] + step) - at(here[0], here[1] - step)) / (2 * step),
    ]
    np.testing.assert_allclose(found["aperture"], right, rtol=1e-3)


def test_moments_of_another_length_are_refused(device):
    modal = MODALS["order 1"]
    values = modal_splats(modal, 5)
    with pytest.raises(ShapeError, match="moments"):
        run(device, values, modal, np.zeros((5, 7)))
