"""Splats to the screen, and gradients from the screen to splats and camera.

The drivers of ``kernels/splat_project.cl``, ``splat_shade.cl`` and their gradients, which say
what is computed; ``rift_cl.reference.splat_projection`` is their twin.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.memory import as_device_array
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.splat.projected import Projected, SplatGradients
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

_MODELS = {"pinhole": 0, "ortho": 1, "fisheye": 2}
# Numbers of a record before its colours, and of the camera's gradient.
_MOMENTS, _CAMERA = 6, 16
_RUN = 64


def project(device: Device, splats: Splats, camera: Camera, settings: SplatSettings) -> Projected:
    """Project splats to the screen and find the tiles that each may touch.

    Raises:
        InputError: the camera cannot be used with these settings.
        ShapeError: one of the splats' arrays is a strided view.
        DeviceError: one of them lives on another device.
        DeviceMemoryError: the device has too little memory.
    """
    _check(device, splats, camera, settings)
    count = len(splats)
    projected = Projected(
        device.empty((count, 8)),
        device.empty((count, 4), np.int32),
        device.empty((count, 2), np.int32),
        device.empty((count,), np.uint8),
    )
    device.launch(
        "splat_project",
        (count,),
        *(splats.means, *_shapes(splats), splats.opacities),
        *(projected.screen, projected.boxes, projected.radii, projected.culled),
        *_camera_arguments(camera),
        *(float(settings.near), float(settings.far), float(settings.radius_clip)),
        *(float(settings.eps2d), count),
        **_macros(splats, camera, settings),
        TILE=settings.tile,
        SMOOTH=settings.smooth_cutoff,
    )
    return projected


def project_grad(
    device: Device,
    splats: Splats,
    camera: Camera,
    settings: SplatSettings,
    *,
    projected: Projected,
    slots: Any,
    records: Any,
    with_camera: bool = True,
    depth_channel: bool = False,
) -> SplatGradients:
    """The gradient of ``project``, from the records that the raster gradient left.

    Args:
        device: where the arrays are.
        splats: as given to ``project``.
        camera: as given to ``project``.
        settings: as given to ``project``.
        projected: what it returned.
        slots: (N + 1,) int32, where each splat's records begin.
        records: (M, 6 + D), with ``absgrad`` (M, 8 + D): see ``kernels/splat_project_grad.cl``.
        with_camera: leave the parts of the camera's gradient as well.
        depth_channel: the last of the D channels is the splats' depth.

    Raises:
        ShapeError: slots or records do not fit.
    """
    channels = _channels(device, splats, settings, slots, records)
    out = _empty_gradients(device, splats, channels, settings.absgrad, with_camera)
    device.launch(
        "splat_project_grad",
        (len(splats),),
        *(splats.means, *_shapes(splats), splats.opacities, projected.culled, slots, records),
        *_camera_arguments(camera),
        *(float(settings.near), float(settings.far), float(settings.eps2d), len(splats)),
        *(out.means, *((out.quats, out.scales) if splats.covars is None else (out.covars,))),
        *(out.opacities, out.colors, out.means2d, out.means2d_abs, out.camera),
        **_macros(splats, camera, settings),
        CHANNELS=channels,
        ABSGRAD=settings.absgrad,
        DEPTH=depth_channel,
        CAMERA_GRADIENT=with_camera,
    )
    return out


def shade(device: Device, splats: Splats, camera: Camera, projected: Projected) -> Any:
    """Colours (N, 3) of splats with spherical harmonics, as seen from the camera's centre.

    Raises:
        InputError: the splats have no spherical harmonics.
    """
    colors = device.empty((len(splats), 3))
    center = np.array([*camera.center, 0], np.float32)
    device.launch(
        "splat_shade",
        (len(splats),),
        *(splats.means, _harmonics(splats), projected.culled, colors, center, len(splats)),
        COEFFICIENTS=splats.sh.shape[1],
    )
    return colors


def shade_grad(
    device: Device, splats: Splats, camera: Camera, *, colors: Any, gradients: SplatGradients
) -> Any:
    """The gradient of ``shade``.

    Args:
        device: where the arrays are.
        splats: as given to ``shade``.
        camera: as given to ``shade``.
        colors: what it returned.
        gradients: what ``project_grad`` returned; the first three of its colours are what comes
            in. What flows through the viewing direction is added to its means and camera.

    Returns:
        (N, K, 3) gradient by the coefficients.

    Raises:
        InputError: the splats have no spherical harmonics.
        ShapeError: the gradient has less than three channels.
    """
    stride = gradients.colors.shape[1]
    if stride < 3:
        raise ShapeError(f"shade_grad: gradients.colors has {stride} channels, wanted 3 or more")
    grad_sh = device.empty(_harmonics(splats).shape)
    inverse = np.linalg.inv(camera.view[:3, :3]).T
    rows = np.column_stack([inverse, camera.center]).astype(np.float32, order="C")
    device.launch(
        "splat_shade_grad",
        (len(splats),),
        *(splats.means, splats.sh, colors, gradients.colors, *rows, len(splats)),
        *(grad_sh, gradients.means, gradients.camera),
        COEFFICIENTS=splats.sh.shape[1],
        STRIDE=stride,
        CAMERA_GRADIENT=gradients.camera is not None,
    )
    return grad_sh


def sum_columns(device: Device, table: Any) -> Any:
    """Sum over the rows of a (N, C) device array, in an order that N alone decides: (C,)."""
    rows, columns = table.shape
    if rows == 0:
        return device.zeros((columns,))
    while rows > 1:
        runs = -(-rows // _RUN)
        sums = device.empty((runs, columns))
        device.launch("sum_columns", (runs * columns,), table, sums, rows, columns, RUN=_RUN)
        table, rows = sums, runs
    return table.reshape((columns,))


def _check(device: Device, splats: Splats, camera: Camera, settings: SplatSettings) -> None:
    for name, array in vars(splats).items():
        if array is not None:
            as_device_array(device, array, array.shape, name=name)
    if settings.mode == "xray" and camera.model == "fisheye":
        raise InputError("xray mode wants a pinhole or ortho camera, this one is fisheye")
    if camera.model == "pinhole" and settings.near <= 0:
        raise InputError(
            f"SplatSettings: near is {settings.near}, a pinhole camera wants a positive distance"
        )


def _macros(splats: Splats, camera: Camera, settings: SplatSettings) -> dict[str, int]:
    return {
        "MODEL": _MODELS[camera.model],
        "XRAY": settings.mode == "xray",
        "ANTIALIASED": settings.antialiased,
        "COVARIANCES": splats.covars is not None,
    }


def _shapes(splats: Splats) -> tuple[Any, ...]:
    return (splats.quats, splats.scales) if splats.covars is None else (splats.covars,)


def _camera_arguments(camera: Camera) -> tuple[Any, ...]:
    """What ``camera.h`` wants: by value, so that no copy waits for the queue."""
    rows: NDArray[np.float32] = camera.view[:3].astype(np.float32, order="C")
    return (*rows, np.array(camera.intrinsics, np.float32), camera.width, camera.height)


def _harmonics(splats: Splats) -> Any:
    if splats.sh is None:
        raise InputError("shade: these splats have no spherical harmonics; draw their colors")
    return splats.sh


def _channels(
    device: Device, splats: Splats, settings: SplatSettings, slots: Any, records: Any
) -> int:
    """Number of colour channels that the records have."""
    if slots.shape != (len(splats) + 1,) or slots.dtype != np.int32:
        raise ShapeError(
            f"project_grad: slots is {slots.dtype} of shape {slots.shape}, wanted int32 of shape "
            f"({len(splats) + 1},)"
        )
    fixed = _MOMENTS + 2 * settings.absgrad
    if len(records.shape) != 2 or records.shape[1] <= fixed:
        raise ShapeError(
            f"project_grad: records has shape {records.shape}, wanted (M, {fixed} + channels)"
        )
    as_device_array(device, records, records.shape, name="records")
    return int(records.shape[1]) - fixed


def _empty_gradients(
    device: Device, splats: Splats, channels: int, absgrad: bool, with_camera: bool
) -> SplatGradients:
    count, given = len(splats), splats.covars is not None
    return SplatGradients(
        means=device.empty((count, 3)),
        quats=None if given else device.empty((count, 4)),
        scales=None if given else device.empty((count, 3)),
        covars=device.empty((count, 6)) if given else None,
        opacities=device.empty((count,)),
        colors=device.empty((count, channels)),
        means2d=device.empty((count, 2)),
        means2d_abs=device.empty((count, 2)) if absgrad else None,
        camera=device.empty((count, _CAMERA)) if with_camera else None,
    )
