"""Splats to the screen, and gradients from the screen to splats and camera.

The drivers of ``kernels/splat/splat_project.cl`` and its gradient, which say what is computed;
``rift_cl.reference.splat_projection`` is their twin.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.memory import as_device_array
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Aperture, Camera
from rift_cl.splat.orders import Modal, ModeOrders
from rift_cl.splat.projected import Projected, SplatGradients
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

_MODELS = {"pinhole": 0, "ortho": 1, "fisheye": 2}
# Moments of dL/dsigma that stand before the features' gradients; numbers of the camera's.
MOMENTS, _CAMERA = 6, 16
# Devices count in float32.
_LARGEST = float(np.finfo(np.float32).max)


def project(device: Device, splats: Splats, camera: Camera, settings: SplatSettings) -> Projected:
    """Project splats to the screen and find the tiles that each may touch.

    Raises:
        InputError: the camera cannot be used with these settings, or its aperture with float32.
        ShapeError: one of the splats' arrays is a strided view.
        DeviceError: one of them lives on another device.
        DeviceMemoryError: the device has too little memory.
    """
    _check(device, splats, camera, settings)
    count = len(splats)
    projected = Projected(
        device.empty((count, 8)),
        device.empty((count,)),
        device.empty((count, 4), np.int32),
        device.empty((count,), np.uint8),
    )
    device.launch(
        "splat_project",
        (count,),
        **projection_arguments(splats, camera, settings),
        opacities=splats.opacities,
        screen=projected.screen,
        depths=projected.depths,
        boxes=projected.boxes,
        culled=projected.culled,
        radius_clip=settings.radius_clip,
        shape_modes=splats.shape_modes,
        color_modes=splats.color_modes,
        **mode_macros(splats, settings),
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
    sums: DeviceArray,
    with_camera: bool = True,
    depth_channel: bool = False,
    first_moments: bool = True,
    view_parts: DeviceArray | None = None,
) -> SplatGradients:
    """The gradient of ``project``.

    Args:
        device: where the arrays are.
        splats: as given to ``project``.
        camera: as given to ``project``.
        settings: as given to ``project``.
        projected: what it returned.
        sums: (N, 6 + D), with ``absgrad`` (N, 8 + D), what ``sum_slots`` returned: see
            ``kernels/splat/splat_project_grad.cl``.
        with_camera: leave the parts of the camera's gradient as well.
        depth_channel: the last of the D channels is the splats' depth.
        first_moments: numbers 1 and 2 are the first moments of dL/dsigma; otherwise they are the
            gradient by the position on the screen.
        view_parts: (N, 6) what flows into the screen's square root besides, from
            ``project_modes_grad``; nothing if not given.

    Raises:
        ShapeError: the sums do not fit.
    """
    fixed = MOMENTS + 2 * settings.absgrad
    channels = sums.shape[-1] - fixed
    if channels < 1:
        raise ShapeError(
            f"project_grad: sums has shape {sums.shape}, wanted (N, {fixed} + channels)"
        )
    as_device_array(device, sums, (len(splats), fixed + channels), name="sums")
    out = _empty_gradients(
        device, splats, channels, settings.absgrad, camera if with_camera else None
    )
    device.launch(
        "splat_project_grad",
        (len(splats),),
        **projection_arguments(splats, camera, settings),
        opacities=splats.opacities,
        culled=projected.culled,
        sums=sums,
        grad_means=out.means,
        grad_quats=out.quats,
        grad_scales=out.scales,
        grad_covars=out.covars,
        grad_opacities=out.opacities,
        grad_features=out.features,
        grad_means2d=out.means2d,
        grad_means2d_abs=out.means2d_abs,
        camera_parts=out.camera,
        aperture_parts=out.aperture,
        view_parts=view_parts,
        CHANNELS=channels,
        ABSGRAD=settings.absgrad,
        DEPTH=depth_channel,
        FIRST_MOMENTS=first_moments,
        VIEW_PARTS=view_parts is not None,
        CAMERA_GRADIENT=with_camera,
    )
    return out


def _check(device: Device, splats: Splats, camera: Camera, settings: SplatSettings) -> None:
    for name, array in vars(splats).items():
        if array is not None:
            as_device_array(device, array, array.shape, name=name)
    if settings.mode == "xray" and camera.model == "fisheye":
        raise InputError("xray mode wants a pinhole or ortho camera, this one is fisheye")
    if settings.mode == "xray" and camera.aperture is not None:
        raise InputError(
            "xray mode wants a camera without aperture: X-rays pass no lens, so that line "
            "integrals are sharp at every depth"
        )
    if camera.model == "pinhole" and settings.near <= 0:
        raise InputError(
            f"SplatSettings: near is {settings.near}, a pinhole camera wants a positive distance"
        )


def is_modal(splats: Modal, settings: SplatSettings) -> bool:
    """Whether splats have Hermite modes or another activation, and so kernels of their own."""
    modes = splats.shape_modes is not None or splats.color_modes is not None
    return modes or settings.activation != "clamp"


def mode_macros(splats: Splats, settings: SplatSettings) -> dict[str, int]:
    """What ``hermite_project.h`` and ``hermite_extent.h`` are told; nothing for plain splats."""
    if not is_modal(splats, settings):
        return {}
    orders = ModeOrders.of(splats)
    return {
        "MODAL": 1,
        "SHAPE_ORDER": orders.shape,
        "COLOR_ORDER": orders.color,
        "COLOR_CHANNELS": orders.channels,
        "SQUARE": settings.activation == "square",
    }


def projection_arguments(
    splats: Splats, camera: Camera, settings: SplatSettings
) -> dict[str, DeviceArray]:
    """What every kernel is told that includes ``gaussian.h`` and ``camera.h``.

    The camera goes by value, so that no copy waits for the queue.
    """
    view: NDArray[np.float32] = camera.view[:3].astype(np.float32, order="C")
    return {
        "means": splats.means,
        "quats": splats.quats,
        "scales": splats.scales,
        "covars": splats.covars,
        "count": len(splats),
        **{f"view_{axis}": row for axis, row in zip("xyz", view, strict=True)},
        "intrinsics": np.array(camera.intrinsics, np.float32),
        "width": camera.width,
        "height": camera.height,
        "aperture": None if camera.aperture is None else _of_aperture(camera.aperture),
        "near_plane": settings.near,
        "far_plane": settings.far,
        "eps2d": settings.eps2d,
        "MODEL": _MODELS[camera.model],
        "XRAY": settings.mode == "xray",
        "ANTIALIASED": settings.antialiased,
        "COVARIANCES": splats.covars is not None,
        "DEFOCUS": camera.aperture is not None,
    }


def _of_aperture(aperture: Aperture) -> NDArray[np.float32]:
    """Radius, inverse focus, and the diffraction's standard deviation per focal length.

    Raises:
        InputError: one of them is too large for float32.
    """
    radius = aperture.radius
    diffraction = aperture.wavelength / (math.sqrt(2) * math.pi * radius)
    numbers = (radius, 1 / aperture.focus, diffraction)
    if max(numbers) > _LARGEST:
        raise InputError(f"{aperture}: too wide, too near or too small for float32")
    return np.array([*numbers, 0], np.float32)


def _empty_gradients(
    device: Device, splats: Splats, channels: int, absgrad: bool, camera: Camera | None
) -> SplatGradients:
    count, given = len(splats), splats.covars is not None
    lens = camera is not None and camera.aperture is not None
    return SplatGradients(
        means=device.empty((count, 3)),
        quats=None if given else device.empty((count, 4)),
        scales=None if given else device.empty((count, 3)),
        covars=device.empty((count, 6)) if given else None,
        opacities=device.empty((count,)),
        features=device.empty((count, channels)),
        means2d=device.empty((count, 2)),
        means2d_abs=device.empty((count, 2)) if absgrad else None,
        camera=None if camera is None else device.empty((count, _CAMERA)),
        aperture=device.empty((count, 2)) if lens else None,
    )
