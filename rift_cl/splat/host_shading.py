"""Colours of splats by an angular basis that has no kernel: one of a user's own, in NumPy.

The sums are those of ``kernels/splat/lobe_shade.cl`` and ``lobe_shade_grad.cl``, taken on the host
in float64. That costs copies from and to the device in each frame, and holds for any basis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular import AngularBasis
from rift_cl.cl.arithmetic import axpby, copy_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.geometry import Camera
from rift_cl.splat.projection import SplatGradients
from rift_cl.splat.sight import sight_gradient, ways_to

Floats = NDArray[np.float64]


def shade_on_host(
    device: Device,
    basis: AngularBasis,
    means: DeviceArray,
    linear: DeviceArray,
    lobes: DeviceArray,
    camera: Camera,
    culled: DeviceArray,
    features: DeviceArray,
    *,
    lit: bool = False,
) -> None:
    """Write the colours of splats into the first three columns of ``features``; see ``shade``."""
    away = ways_to(camera, device.get(means).astype(float))
    colors = basis.evaluate(device.get(linear), device.get(lobes), away) + 0.5
    if lit:
        colors += device.get(features)[:, :3]
    drawn = np.isfinite(colors).all(axis=1) & (device.get(culled) == 0)
    shown = np.where(drawn[:, None], np.maximum(colors, 0), 0)
    copy_columns(device, device.array(shown), 0, features, 0, 3)


def shade_on_host_grad(
    device: Device,
    basis: AngularBasis,
    means: DeviceArray,
    linear: DeviceArray,
    lobes: DeviceArray,
    camera: Camera,
    features: DeviceArray,
    gradients: SplatGradients,
) -> tuple[DeviceArray, DeviceArray]:
    """The gradient of ``shade_on_host``, as ``shade_grad`` has it.

    Returns:
        The gradients by the coefficients, (N, L, 3), and by the geometry, (N, G); those by means
        and camera are added to ``gradients``.
    """
    away = ways_to(camera, device.get(means).astype(float))
    colors, incoming = (device.get(a)[:, :3] for a in (features, gradients.features))
    incoming = np.where(colors > 0, incoming, 0).astype(float)
    found = basis.evaluate(device.get(linear), device.get(lobes), away, grad=True)
    black = ~incoming.any(axis=1)
    by_linear = found.by_coeff[:, :, None] * incoming[:, None, :]
    by_lobes = np.einsum("ngc,nc->ng", found.by_geometry, incoming)
    by_away = np.einsum("nic,nc->ni", found.by_directions, incoming)
    for array in (by_linear, by_lobes, by_away):
        array[black] = 0
    by_mean, by_view = sight_gradient(camera, by_away)
    axpby(device, 1.0, device.array(by_mean), 1.0, gradients.means)
    if gradients.camera is not None:
        # Of the rows that are summed in the end the first one takes it all.
        parts = np.zeros(gradients.camera.shape)
        parts[:1, :12] = by_view.ravel()
        axpby(device, 1.0, device.array(parts), 1.0, gradients.camera)
    return device.array(by_linear), device.array(by_lobes)
