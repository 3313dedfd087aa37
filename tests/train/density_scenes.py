"""Splats of known densities before parallel views, and what these see of them."""

from __future__ import annotations

import numpy as np

from rift_cl.commands.fit_xray.input import Projections, XrayPictures
from rift_cl.geometry import Grid, Parallel
from rift_cl.splat.orders import count_of
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.start.points import start_splats

SIZE, COUNT = 20, 6
DRAWING = SplatSettings(mode="xray")


def projections(views, rows, values=None):
    angles = np.arange(views) * np.pi / views
    if values is None:
        values = np.zeros((views, rows, SIZE), np.float32)
    return Projections(Parallel(angles, SIZE), values, 1.0, Grid((rows, SIZE, SIZE)))


def cameras_of(views, rows):
    return projections(views, rows).views.cameras


def scene(order, seed=0, flat=False):
    """Raw values of splats that do not lie on one another, in a ball before any view."""
    random = np.random.default_rng(seed)
    places = ([-7, 0, 7], [-5, 5], [0]) if flat else ([-5, 5], [-5, 5], [-5, 5])
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 3)
    means = grid[:COUNT] + random.uniform(-1, 1, (COUNT, 3)) * (1, 1, not flat)
    raw = start_splats(means, np.ones((COUNT, 3)), seed=seed)
    raw["log_scales"] = np.log(random.uniform(1, 2, (COUNT, 3))).astype(np.float32)
    raw["logits"] = np.log(random.uniform(0.1, 0.5, COUNT)).astype(np.float32)
    if order:
        modes = 0.2 * random.normal(size=(COUNT, count_of(order) - 1))
        raw["shape_modes"] = modes.astype(np.float32)
    return raw


def pictures_of(device, raw, views=5, rows=SIZE):
    """What a scan would measure of a scene."""
    splats = Parameters.of(device, raw, density=True).drawn
    renderer = Renderer(DRAWING, device=device)
    drawn = [device.get(renderer.forward(splats, k).image) for k in cameras_of(views, rows)]
    return XrayPictures(device, projections(views, rows, np.stack(drawn)[..., 0]))
