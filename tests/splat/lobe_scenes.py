"""Splats with lobes in front of a camera, shaded on a device and by the twin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from projection_scenes import camera_of

from rift_cl.basis.angular import angular_basis
from rift_cl.cl.arithmetic import sum_columns
from rift_cl.reference.lobes import shade_lobes, shade_lobes_grad
from rift_cl.splat.features import shade, shade_grad
from rift_cl.splat.projection import SplatGradients

CASES = [("hg", 8), ("lg", 9), ("sg", 4), ("asg", 4)]
# Each takes the compiler a quarter of a minute.
MOST_MODES = [("hg", 36), ("lg", 36)]
CAMERA = camera_of("pinhole")


@dataclass
class Lobes:
    """Float32 host arrays of N splats: means, linear coefficients and lobes."""

    kind: str
    means: np.ndarray
    linear: np.ndarray
    lobes: np.ndarray

    @property
    def basis(self):
        return angular_basis(self.kind, self.linear.shape[1])

    def exact(self):
        """The same numbers in float64."""
        return (a.astype(float) for a in (self.means, self.linear, self.lobes))

    def colors(self, camera=CAMERA):
        """What the twin sees."""
        return shade_lobes(self.basis, *self.exact(), camera)

    def gradients(self, incoming, camera=CAMERA):
        return shade_lobes_grad(self.basis, *self.exact(), camera, incoming.astype(float))


def random_lobes(kind, count, number=200, seed=0):
    """Lobes of all directions and widths, about the origin."""
    random, basis = np.random.default_rng(seed), angular_basis(kind, count)
    lobes = random.standard_normal((number, basis.n_geometry))
    if kind in ("hg", "lg"):
        # A few beyond their limits on either side.
        widths = random.uniform(np.log(0.015), 0.2, (number, basis.n_geometry - 4))
        lobes[:, 4:] = np.where(np.abs(widths) < 1e-3, -0.1, widths)
    arrays = (
        random.uniform(-1.6, 1.6, (number, 3)),
        0.4 * random.standard_normal((number, count, 3)),
        lobes,
    )
    return Lobes(kind, *(a.astype(np.float32) for a in arrays))


def facing(given, aside=0.05, seed=4):
    """The same splats with their (first) lobes turned to where the camera sees them."""
    random = np.random.default_rng(seed)
    away = given.means - CAMERA.center
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    away += aside * random.standard_normal(away.shape)
    start = given.basis.start_geometry(away)
    each = 3 if given.kind == "sg" else 4
    lobes = given.lobes.copy()
    lobes[:, :each] = start[:, :each]
    return Lobes(given.kind, given.means, given.linear, lobes)


def seen(device, given, *, camera=CAMERA, culled=None, into=None):
    """The table of features, on the device."""
    number = len(given.means)
    codes = np.zeros(number, np.uint8) if culled is None else culled
    arrays = (device.array(given.means), device.array(given.linear), camera, device.array(codes))
    lobes = device.array(given.lobes)
    return shade(device, *arrays, into=into, lobes=lobes, angular=given.kind)


def seen_grad(device, given, incoming, *, features=None, camera=CAMERA, before=0.0):
    """Host gradients of linear coefficients, lobes, means and view."""
    number = len(given.means)
    features = seen(device, given, camera=camera) if features is None else features
    means = device.array(np.full((number, 3), before, np.float32))
    parts = device.array(np.full((number, 16), before, np.float32))
    into = SplatGradients(means, None, None, None, None, device.array(incoming), None, None, parts)
    lobes = device.array(given.lobes)
    by_lobes = device.empty(given.lobes.shape)
    by_linear = shade_grad(
        device,
        *(device.array(given.means), device.array(given.linear), camera),
        features=features,
        gradients=into,
        lobes=lobes,
        angular=given.kind,
        grad_lobes=by_lobes,
    )
    view = device.get(sum_columns(device, parts))
    return {
        "linear": device.get(by_linear),
        "lobes": device.get(by_lobes),
        "means": device.get(means),
        "view": view[:12].reshape(3, 4),
        "lens": view[12:],
    }


def error(found, right):
    return np.linalg.norm(found - right) / np.linalg.norm(right)
