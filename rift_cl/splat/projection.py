"""Splats to the screen, and gradients from the screen to splats and camera.

The drivers of ``kernels/splat/splat_project.cl``, ``hermite_project.cl`` and their gradients, which
say what is computed; ``rift_cl.reference.splat_projection`` and ``hermite_projection`` are their
twins.

A Hermite mode of order (i, j, k) is He~_i(x) He~_j(y) He~_k(z), He~_n = He_n / sqrt(n!), in the
splat's own coordinates. Modes stand in graded order: by i + j + k, and within one of these (1,0,0),
(0,1,0), (0,0,1); (2,0,0), (1,1,0), (1,0,1), (0,2,0), (0,1,1), (0,0,2); and so on. The constant,
which is 1, is not stored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_device_array
from rift_cl.errors import InputError, SettingError, ShapeError
from rift_cl.geometry import Aperture, Camera
from rift_cl.splat.orders import Modal, ModeOrders
from rift_cl.splat.raster import MOMENTS, ScreenModes
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

_MODELS = {"pinhole": 0, "ortho": 1, "fisheye": 2}
# Numbers of the camera's gradient.
_CAMERA = 16
# Devices count in float32.
_LARGEST = float(np.finfo(np.float32).max)
# The meaning of the codes in ``Projection.culled``.
CULL_REASONS = (
    "visible",
    "out of depth",
    "not finite or degenerate",
    "too faint",
    "off screen",
    "clipped for its radius",
)


@dataclass(frozen=True, eq=False)
class Projection:
    """N splats as a camera sees them, with what they were projected from.

    Args:
        device: where the arrays are.
        splats: what was projected.
        camera: the view.
        settings: how splats are drawn.
        screen: (N, 8): mean x, mean y, conic a, b, c, weight, extent x, extent y; pixels. Weight
            is opacity times a factor: 1, or Mip-Splatting's compensation, or in xray mode the
            line integral through a unit peak; times what keeps the light that an aperture
            spreads. What is drawn of it in light mode lacks the share (1/255) / weight, as alphas
            below 1/255 do not count: much where a small splat is spread far. Extents are half the
            sides of the rectangle round all that is drawn of a splat.
        depths: (N,) distances along the camera's axis, in scene units; from a fisheye itself.
        boxes: (N, 4) int32 tile rectangles (x0, y0, x1, y1), x1 and y1 exclusive.
        culled: (N,) uint8, an index into ``CULL_REASONS``; splats with another code than 0 have
            zeros everywhere.
        modes: the splats' polynomials on the screen; None for Gaussians.
    """

    device: Device
    splats: Splats
    camera: Camera
    settings: SplatSettings
    screen: DeviceArray
    depths: DeviceArray
    boxes: DeviceArray
    culled: DeviceArray
    modes: ScreenModes | None = None


@dataclass(frozen=True, eq=False)
class SplatGradients:
    """Gradients of a loss by everything that was projected; device arrays.

    Args:
        means, quats, scales, covars, opacities: as in ``Splats``; None where it has None.
        features: (N, D) gradient by what was drawn in each channel.
        means2d: (N, 2) gradient by the position on the screen, in 1 / pixels.
        means2d_abs: (N, 2) the sum over pixels of its magnitudes; None without ``absgrad``.
        camera: (runs, 16) the part of each run of splats (``Traits.runs``) in the gradient by the
            camera, for ``sum_columns``: the upper 3 rows of the view matrix, then fx, fy, cx, cy;
            None if not asked for.
        aperture: (runs, 2) the same by the aperture's radius and focus; None as with the camera,
            and for a camera without aperture.
        shape_modes: (N, K - 1) by the modes of the densities; None where there are none.
        color_modes: (N, K - 1, C) by those of the colours; None where there are none.
    """

    means: DeviceArray
    quats: DeviceArray | None
    scales: DeviceArray | None
    covars: DeviceArray | None
    opacities: DeviceArray
    features: DeviceArray
    means2d: DeviceArray
    means2d_abs: DeviceArray | None
    camera: DeviceArray | None
    aperture: DeviceArray | None = None
    shape_modes: DeviceArray | None = None
    color_modes: DeviceArray | None = None


@dataclass(frozen=True, eq=False)
class ModeGradients:
    """What comes of the raster's moments; device arrays.

    Args:
        sums: (N, 6 + D) for ``project_grad`` without first moments.
        view_parts: (N, 6) for it as well.
        shape_modes: (N, K - 1) gradient by the modes of the densities; None where there are none.
        color_modes: (N, K - 1, C) by those of the colours; None where there are none.
    """

    sums: DeviceArray
    view_parts: DeviceArray
    shape_modes: DeviceArray | None
    color_modes: DeviceArray | None


def project(device: Device, splats: Splats, camera: Camera, settings: SplatSettings) -> Projection:
    """Project splats to the screen and find the tiles that each may touch.

    Raises:
        InputError: the camera cannot be used with these settings, or its aperture with float32.
        ShapeError: one of the splats' arrays is a strided view.
        DeviceError: one of them lives on another device.
        DeviceMemoryError: the device has too little memory.
    """
    _check(device, splats, camera, settings)
    settings = settings.for_image(camera.size, cpu=device.traits.is_cpu)
    count = len(splats)
    projection = Projection(
        *(device, splats, camera, settings),
        screen=device.empty((count, 8)),
        depths=device.empty((count,)),
        boxes=device.empty((count, 4), np.int32),
        culled=device.empty((count,), np.uint8),
    )
    device.launch(
        "splat_project",
        (device.traits.runs(count),),
        **_arguments(projection),
        opacities=splats.opacities,
        screen=projection.screen,
        depths=projection.depths,
        boxes=projection.boxes,
        radius_clip=settings.radius_clip,
        shape_modes=splats.shape_modes,
        color_modes=splats.color_modes,
        **_extent_macros(splats, settings),
        RUN=device.traits.run,
        TILE=settings.edge,
        SMOOTH=settings.smooth_cutoff,
    )
    if not is_modal(splats, settings):
        return projection
    return replace(projection, modes=project_modes(projection))


def project_modes(projection: Projection) -> ScreenModes:
    """The modes of splats as the camera sees them, from all else that a projection holds.

    Raises:
        DeviceMemoryError: the device has too little memory.
    """
    device, splats = projection.device, projection.splats
    macros = _mode_macros(splats)
    table = device.empty((len(splats), table_width(splats)))
    device.launch(
        "hermite_project",
        (device.traits.runs(len(splats)),),
        **_arguments(projection),
        shape_modes=splats.shape_modes,
        color_modes=splats.color_modes,
        screen_modes=table,
        RUN=device.traits.run,
        **macros,
    )
    return ScreenModes(table, splats.shape_order, splats.color_order, macros["COLOR_CHANNELS"])


def project_grad(
    projection: Projection,
    sums: DeviceArray,
    *,
    with_camera: bool = True,
    depth_channel: bool = False,
    first_moments: bool = True,
) -> SplatGradients:
    """The gradient of ``project``.

    Args:
        projection: what it returned.
        sums: (N, 6 + D), with ``absgrad`` (N, 8 + D), what ``sum_slots`` returned: see
            ``kernels/splat/splat_project_grad.cl``. Of splats with modes (N, P): see
            ``project_modes_grad``.
        with_camera: leave the parts of the camera's gradient as well.
        depth_channel: the last of the D channels is the splats' depth.
        first_moments: numbers 1 and 2 are the first moments of dL/dsigma; otherwise they are the
            gradient by the position on the screen, as they always are of splats with modes.

    Raises:
        ShapeError: the sums do not fit.
    """
    modes = None if projection.modes is None else project_modes_grad(projection, sums)
    sums = sums if modes is None else modes.sums
    device, splats, settings = projection.device, projection.splats, projection.settings
    camera, fixed = projection.camera, MOMENTS + 2 * settings.absgrad
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
        (device.traits.runs(len(splats)),),
        **_arguments(projection),
        opacities=splats.opacities,
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
        view_parts=None if modes is None else modes.view_parts,
        RUN=device.traits.run,
        CHANNELS=channels,
        ABSGRAD=settings.absgrad,
        DEPTH=depth_channel,
        FIRST_MOMENTS=first_moments and modes is None,
        VIEW_PARTS=modes is not None,
        CAMERA_GRADIENT=with_camera,
    )
    if modes is None:
        return out
    return replace(out, shape_modes=modes.shape_modes, color_modes=modes.color_modes)


def project_modes_grad(projection: Projection, moments: DeviceArray) -> ModeGradients:
    """The gradient of ``project_modes``, and what ``project_grad`` goes on with.

    Args:
        projection: of splats with modes.
        moments: (N, P) sums of the raster's records: see ``kernels/splat/hermite_project_grad.cl``.

    Raises:
        ShapeError: the moments do not fit.
    """
    device, splats, modes = projection.device, projection.splats, projection.modes
    fixed, count = moment_count(splats, 0), len(splats)
    channels = moments.shape[-1] - fixed
    if channels < 1:
        raise ShapeError(f"moments has shape {moments.shape}, wanted (N, {fixed} + channels)")
    as_device_array(device, moments, (count, fixed + channels), name="moments")
    out = ModeGradients(
        device.empty((count, MOMENTS + channels)),
        device.empty((count, 6)),
        None if splats.shape_modes is None else device.empty(splats.shape_modes.shape),
        None if splats.color_modes is None else device.empty(splats.color_modes.shape),
    )
    device.launch(
        "hermite_project_grad",
        (device.traits.runs(count),),
        **_arguments(projection),
        shape_modes=splats.shape_modes,
        color_modes=splats.color_modes,
        screen_modes=None if modes is None else modes.table,
        moments=moments,
        sums=out.sums,
        view_parts=out.view_parts,
        grad_shape_modes=out.shape_modes,
        grad_color_modes=out.color_modes,
        **_mode_macros(splats),
        SQUARE=projection.settings.activation == "square",
        RUN=device.traits.run,
        CHANNELS=channels,
    )
    return out


def table_width(splats: Splats) -> int:
    """Floats of a splat's row in the table of its modes on the screen."""
    return ModeOrders.of(splats).row_length


def moment_count(splats: Splats, channels: int) -> int:
    """Floats per splat that the raster's gradient sums, for a number of channels."""
    return ModeOrders.of(splats).record_length(channels)


def check_modal(splats: Splats, settings: SplatSettings) -> None:
    """Refuse what is not there for splats with modes or another activation than clamp.

    Raises:
        InputError: magnitudes of gradients are asked for.
    """
    if settings.absgrad and is_modal(splats, settings):
        raise SettingError(
            settings,
            "absgrad",
            "is not there for splats with Hermite modes or an activation other than clamp: leave "
            "it off",
        )


def is_modal(splats: Modal, settings: SplatSettings) -> bool:
    """Whether splats have Hermite modes or another activation, and so kernels of their own."""
    modes = splats.shape_modes is not None or splats.color_modes is not None
    return modes or settings.activation != "clamp"


def _mode_macros(splats: Splats) -> dict[str, int]:
    """What ``hermite_project.h`` is told of the modes."""
    orders = ModeOrders.of(splats)
    return {
        "SHAPE_ORDER": orders.shape,
        "COLOR_ORDER": orders.color,
        "COLOR_CHANNELS": orders.channels,
    }


def _extent_macros(splats: Splats, settings: SplatSettings) -> dict[str, int]:
    """What ``hermite_extent.h`` is told of the modes; nothing for plain splats."""
    if not is_modal(splats, settings):
        return {}
    return {"MODAL": 1, "SQUARE": settings.activation == "square"} | _mode_macros(splats)


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
    if camera.model == "pinhole" and settings.near_plane <= 0:
        raise SettingError(
            settings,
            "near",
            f"is {settings.near_plane}, a pinhole camera wants a positive distance",
        )


def _arguments(projection: Projection) -> dict[str, Any]:
    """What every kernel is told that includes ``gaussian.h`` and ``camera.h``.

    The camera goes by value, so that no copy waits for the queue.
    """
    splats, settings = projection.splats, projection.settings
    camera = projection.camera
    view: NDArray[np.float32] = camera.view[:3].astype(np.float32, order="C")
    return {
        "means": splats.means,
        "quats": splats.quats,
        "scales": splats.scales,
        "covars": splats.covars,
        "culled": projection.culled,
        "count": len(splats),
        **{f"view_{axis}": row for axis, row in zip("xyz", view, strict=True)},
        "intrinsics": np.array(camera.intrinsics, np.float32),
        "width": camera.width,
        "height": camera.height,
        "aperture": None if camera.aperture is None else _of_aperture(camera.aperture),
        "near_plane": settings.near_plane,
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
    runs = device.traits.runs(count)
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
        camera=None if camera is None else device.empty((runs, _CAMERA)),
        aperture=device.empty((runs, 2)) if lens else None,
    )
