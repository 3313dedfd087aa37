"""Pictures of random splats with Hermite modes, small enough to draw many of them."""

from __future__ import annotations

import numpy as np
from hermite_projection_scenes import Modal, modal_splats
from projection_scenes import camera_of

import rift_cl as rift
from rift_cl.splat import Renderer, Splats, SplatSettings

SIZE = (48, 64)


def few(count=40, shape=2, color=1, **options):
    """Random splats of some size in front of the camera."""
    values = modal_splats(Modal(shape, color), count, coefficients=4, wide=1.0, **options)
    values["scales"] = np.maximum(values["scales"], 0.05)
    return values


def camera(model="pinhole", view=None):
    full = camera_of(model, focal={"pinhole": 60.0, "ortho": 16.0, "fisheye": 50.0}[model])
    K = full.K.copy()
    K[:2, 2] = 31.3, 24.7
    return rift.Camera(SIZE, K, full.view if view is None else view, model)


def drawn(device, values, *, how=None, model="pinhole", view=None, **settings):
    renderer = how or Renderer(SplatSettings(**settings), device=device)
    return renderer, renderer.forward(Splats.upload(device, **values), camera(model, view))


def image(device, values, **options):
    return device.get(drawn(device, values, **options)[1].image).astype(float)
