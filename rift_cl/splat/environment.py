"""Environment light on splats: what they reflect of a light that they share, and its gradient.

``rift_cl.basis.angular.environment`` says what is reflected; ``kernels/splat/light_shade.cl`` and
its gradients compute it. It is written to the features before the splats' own colours, which are
added to it, so that their sum is what is held above zero.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rift_cl.basis.angular.environment import environment_axes, lattice_sharpness
from rift_cl.cl.arithmetic import sum_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.geometry import Camera
from rift_cl.splat.projection import SplatGradients
from rift_cl.splat.sight import sight_macros, sight_of
from rift_cl.splat.splats import Splats

# Numbers of a lobe's row and of a splat's for the light's gradient, and splats of a chunk of it.
_LOBE, ARRIVAL, CHUNK = 8, 8, 512


class EnvironmentGradients(NamedTuple):
    """Gradients of a loss by what light is reflected with; device arrays as in ``Splats``."""

    normals: DeviceArray
    reflectance: DeviceArray
    environment: DeviceArray


def shade_environment(
    device: Device, splats: Splats, camera: Camera, culled: DeviceArray, *, into: DeviceArray
) -> None:
    """Write the light that splats reflect towards a camera.

    Args:
        device: where the arrays are.
        splats: with an environment light.
        camera: the view.
        culled: (N,) why a splat is not drawn; those that are not reflect nothing.
        into: a table of features whose first three columns are written.
    """
    count = len(splats)
    device.launch(
        "light_shade",
        (device.traits.runs(count),),
        **_given(device, splats),
        culled=culled,
        features=into,
        center=np.array([*sight_of(camera), 0], np.float32),
        count=count,
        RUN=device.traits.run,
        STRIDE=into.shape[1],
        **sight_macros(camera),
    )


def shade_environment_grad(
    device: Device,
    splats: Splats,
    camera: Camera,
    *,
    features: DeviceArray,
    gradients: SplatGradients,
) -> EnvironmentGradients:
    """The gradient of ``shade_environment``.

    Args:
        device: where the arrays are.
        splats: as given to ``shade_environment``.
        camera: as given there.
        features: the table after the splats' own colours were added.
        gradients: the first three of its features are what comes in; what flows through the
            viewing direction is added to its means and camera.
    """
    count, given = len(splats), _given(device, splats)
    lobes, lobe_count = given["lobes"], _lobe_count(splats)
    by_normals, by_reflectance = device.empty((count, 3)), device.empty((count, 7))
    arrivals = device.empty((count, ARRIVAL))
    inverse = np.linalg.inv(camera.view[:3, :3]).T
    inverse_rows = np.column_stack([inverse, sight_of(camera)]).astype(np.float32, order="C")
    device.launch(
        "light_shade_grad",
        (device.traits.runs(count),),
        **given,
        features=features,
        grad_features=gradients.features,
        **{f"inverse_{axis}": row for axis, row in zip("xyz", inverse_rows, strict=True)},
        count=count,
        grad_normals=by_normals,
        grad_reflectance=by_reflectance,
        arrivals=arrivals,
        grad_means=gradients.means,
        camera_parts=gradients.camera,
        RUN=device.traits.run,
        STRIDE=features.shape[1],
        CAMERA_GRADIENT=gradients.camera is not None,
        **sight_macros(camera),
    )
    chunks = -(-count // CHUNK)
    parts = device.empty((chunks, 3 * lobe_count))
    device.launch(
        "light_grad",
        (-(-lobe_count // device.traits.macros["LANES"]), chunks),
        arrivals=arrivals,
        lobes=lobes,
        parts=parts,
        lobe_count=lobe_count,
        count=count,
        CHUNK=CHUNK,
    )
    by_environment = sum_columns(device, parts).reshape((lobe_count, 3))
    return EnvironmentGradients(by_normals, by_reflectance, by_environment)


def _lobe_count(splats: Splats) -> int:
    return 0 if splats.environment is None else int(splats.environment.shape[0])


def _given(device: Device, splats: Splats) -> dict[str, Any]:
    """What both kernels read; the lobes of the light are made for each."""
    count = _lobe_count(splats)
    lobes = device.empty((count, _LOBE))
    device.launch(
        "light_lobes",
        (device.traits.runs(count),),
        axes=device.array(environment_axes(count).astype(np.float32)),
        light=splats.environment,
        lobes=lobes,
        count=count,
        RUN=device.traits.run,
    )
    return {
        "means": splats.means,
        "normals": splats.normals,
        "reflectance": splats.reflectance,
        "lobes": lobes,
        "lattice": lattice_sharpness(count),
        "lobe_count": count,
    }
