"""Splats with Hermite modes: to the screen, and from the screen's moments back.

The drivers of ``kernels/splat/hermite_project.cl`` and its gradient, which say what is computed;
``rift_cl.reference.hermite_projection`` is their twin. A mode of order (i, j, k) is
He~_i(x) He~_j(y) He~_k(z), He~_n = He_n / sqrt(n!), in the splat's own coordinates. Modes stand in
graded order: by i + j + k, and within one of these (1,0,0), (0,1,0), (0,0,1); (2,0,0), (1,1,0),
(1,0,1), (0,2,0), (0,1,1), (0,0,2); and so on. The constant, which is 1, is not stored.
``rift_cl.splat.renderer.Renderer`` draws splats with modes and differentiates the drawing, in
every mode, activation and camera; ``project_modes`` and its gradient are the part of it in between.
"""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.memory import as_device_array
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.splat.orders import HIGHEST, ModeOrders, count_of, order_of
from rift_cl.splat.projected import Projected
from rift_cl.splat.projection import (
    MOMENTS,
    is_modal,
    mode_macros,
    projection_arguments,
)
from rift_cl.splat.screen_modes import ScreenModes
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

__all__ = [
    "HIGHEST",
    "ModeGradients",
    "check_modal",
    "count_of",
    "is_modal",
    "moment_count",
    "order_of",
    "project_modes",
    "project_modes_grad",
    "table_width",
]


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


def check_modal(splats: Splats, settings: SplatSettings) -> None:
    """Refuse what is not there for splats with modes or another activation than clamp.

    Raises:
        InputError: magnitudes of gradients are asked for.
    """
    if settings.absgrad and is_modal(splats, settings):
        raise InputError(
            "SplatSettings: absgrad is not there for splats with Hermite modes or an activation "
            "other than clamp: leave it off"
        )


def project_modes(
    device: Device, splats: Splats, camera: Camera, settings: SplatSettings, projected: Projected
) -> ScreenModes:
    """The modes of splats as the camera sees them.

    Args:
        device: where the arrays are.
        splats: as given to ``project``.
        camera: as given to ``project``.
        settings: as given to ``project``.
        projected: what it returned.

    Raises:
        DeviceMemoryError: the device has too little memory.
    """
    macros = mode_macros(splats, settings)
    orders, channels = (splats.shape_order, splats.color_order), macros["COLOR_CHANNELS"]
    table = device.empty((len(splats), table_width(splats)))
    device.launch(
        "hermite_project",
        (len(splats),),
        **projection_arguments(splats, camera, settings),
        shape_modes=splats.shape_modes,
        color_modes=splats.color_modes,
        culled=projected.culled,
        screen_modes=table,
        **macros,
    )
    return ScreenModes(table, *orders, channels)


def project_modes_grad(
    device: Device,
    splats: Splats,
    camera: Camera,
    settings: SplatSettings,
    *,
    projected: Projected,
    modes: ScreenModes,
    moments: DeviceArray,
    channels: int,
) -> ModeGradients:
    """The gradient of ``project_modes``, and what ``project_grad`` goes on with.

    Args:
        device: where the arrays are.
        splats: as given to ``project``.
        camera: as given to ``project``.
        settings: as given to ``project``.
        projected: what it returned.
        modes: what ``project_modes`` returned.
        moments: (N, P) sums of the raster's records: see ``kernels/splat/hermite_project_grad.cl``.
        channels: D, of the image.

    Raises:
        ShapeError: the moments do not fit.
    """
    count = len(splats)
    as_device_array(device, moments, (count, moment_count(splats, channels)), name="moments")
    out = ModeGradients(
        device.empty((count, MOMENTS + channels)),
        device.empty((count, 6)),
        None if splats.shape_modes is None else device.empty(splats.shape_modes.shape),
        None if splats.color_modes is None else device.empty(splats.color_modes.shape),
    )
    device.launch(
        "hermite_project_grad",
        (count,),
        **projection_arguments(splats, camera, settings),
        shape_modes=splats.shape_modes,
        color_modes=splats.color_modes,
        culled=projected.culled,
        screen_modes=modes.table,
        moments=moments,
        sums=out.sums,
        view_parts=out.view_parts,
        grad_shape_modes=out.shape_modes,
        grad_color_modes=out.color_modes,
        **mode_macros(splats, settings),
        CHANNELS=channels,
    )
    return out


def table_width(splats: Splats) -> int:
    """Floats of a splat's row in the table of its modes on the screen."""
    return ModeOrders.of(splats).row_length


def moment_count(splats: Splats, channels: int) -> int:
    """Floats that the raster's gradient leaves of a splat drawn in so many channels."""
    return ModeOrders.of(splats).record_length(channels)
