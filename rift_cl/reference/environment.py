"""Environment light on splats: the twin of ``light_shade.cl`` and its gradients.

In float64 from the formulas of ``rift_cl.basis.angular.environment``, one step after the other,
with slopes by the chain rule.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular.environment import (
    MOST_LOG_SHARPNESS,
    environment_axes,
    lattice_sharpness,
    reflected_light,
)
from rift_cl.geometry import Camera
from rift_cl.reference.sight import sights, sights_grad

Floats = NDArray[np.float64]


class LightGradients(NamedTuple):
    """Gradients of a loss by everything that reflected light depends on.

    Args:
        normals: (N, 3).
        reflectance: (N, 7).
        environment: (K, 3) by the logarithms of the radiance.
        means: (N, 3) by the positions.
        view: (3, 4) by the upper rows of the view matrix.
    """

    normals: Floats
    reflectance: Floats
    environment: Floats
    means: Floats
    view: Floats


def shade_light(
    means: Floats, normals: Floats, reflectance: Floats, environment: Floats, camera: Camera
) -> Floats:
    """What splats reflect towards a camera, (N, 3); see ``reflected_light`` for the arguments."""
    away = sights(means, camera)
    directions = away / np.linalg.norm(away, axis=1, keepdims=True)
    return reflected_light(normals, reflectance, environment, directions[:, None])[:, 0]


def shade_light_grad(
    means: Floats,
    normals: Floats,
    reflectance: Floats,
    environment: Floats,
    camera: Camera,
    incoming: Floats,
) -> LightGradients:
    """Gradients of the sum of reflected light times ``incoming`` (N, 3); see ``shade_light``."""
    away = sights(means, camera)
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    d, length = away / distance, np.linalg.norm(normals, axis=1, keepdims=True)
    n, count = normals / length, len(environment)
    g, axes, radiance = lattice_sharpness(count), environment_axes(count), np.exp(environment)
    facing = (d * n).sum(1, keepdims=True)
    r = d - 2 * facing * n
    free = np.abs(reflectance[:, 6:]) < MOST_LOG_SHARPNESS
    kappa = np.exp(np.clip(reflectance[:, 6:], -MOST_LOG_SHARPNESS, MOST_LOG_SHARPNESS))
    s = g * kappa / (g + kappa)
    w, near = s / g, r @ axes.T - 1
    lobes = np.exp(s * near)
    shares = 1 / (1 + np.exp(-reflectance[:, :6]))
    edge = np.maximum(1 - np.abs(facing), 0)
    tint = shares[:, :3] + edge**5 * shares[:, 3:]
    light = w * (lobes @ radiance)

    by_tint, by_light = incoming * light, incoming * tint
    q = lobes * (by_light @ radiance.T)
    by_s = q.sum(1, keepdims=True) / g + w * (q * near).sum(1, keepdims=True)
    by_r = w * s * (q @ axes)
    by_shares = np.concatenate([by_tint, edge**5 * by_tint], 1)
    by_log = by_s * s * g / (g + kappa) * free
    by_edge = 5 * edge**4 * (by_tint * shares[:, 3:]).sum(1, keepdims=True)
    by_facing = -np.sign(facing) * by_edge - 2 * (by_r * n).sum(1, keepdims=True)
    by_n = by_facing * d - 2 * facing * by_r
    by_d = by_r + by_facing * n
    by_means, view = sights_grad((by_d - (by_d * d).sum(1, keepdims=True) * d) / distance, camera)
    return LightGradients(
        normals=(by_n - (by_n * n).sum(1, keepdims=True) * n) / length,
        reflectance=np.concatenate([by_shares * shares * (1 - shares), by_log], 1),
        environment=radiance * (lobes.T @ (w * by_light)),
        means=by_means,
        view=view,
    )
