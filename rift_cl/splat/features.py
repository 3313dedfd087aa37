"""What splats show: their colours from spherical harmonics, features of any number, depth.

All of it stands in one table of features, (N, D), in this order: three colours of the harmonics,
the splats' own ``colors``, depth; each where it is asked for. ``kernels/splat_shade.cl`` says what
a colour is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.cl.arithmetic import copy_columns
from rift_cl.cl.device import Device
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.splat.projected import Projected, SplatGradients
from rift_cl.splat.splats import Splats


@dataclass(frozen=True)
class Channels:
    """How many channels of each kind there are.

    Args:
        shaded: 3 where colours come from spherical harmonics, otherwise 0.
        own: of the splats' ``colors``.
        depth: 1 where depth is drawn, otherwise 0.

    Raises:
        InputError: there are none.
    """

    shaded: int
    own: int
    depth: int

    def __post_init__(self) -> None:
        """Check that something is drawn."""
        if self.total == 0:
            raise InputError(
                "these splats have neither colors nor sh: give one of them, or ask for depth"
            )

    @classmethod
    def of(cls, splats: Splats, *, depth: bool) -> Channels:
        """The channels of these splats."""
        own = 0 if splats.colors is None else splats.colors.shape[1]
        return cls(0 if splats.sh is None else 3, own, int(depth))

    @property
    def color(self) -> int:
        """Channels that a background has: all but depth."""
        return self.shaded + self.own

    @property
    def total(self) -> int:
        """All channels."""
        return self.shaded + self.own + self.depth


def gather_features(
    device: Device, splats: Splats, camera: Camera, projected: Projected, channels: Channels
) -> Any:
    """The table of features, (N, D), as seen from the camera."""
    if channels.total == channels.own:
        return splats.colors
    features = device.empty((len(splats), channels.total))
    if channels.shaded:
        shade(device, splats.means, splats.sh, camera, projected.culled, into=features)
    if channels.own:
        copy_columns(device, splats.colors, 0, features, channels.shaded, channels.own)
    if channels.depth:
        copy_columns(device, projected.depths, 0, features, channels.color, 1)
    return features


def own_columns(device: Device, table: Any, channels: Channels) -> Any:
    """The columns of a table of features that belong to the splats' ``colors``; None if none."""
    if not channels.own or channels.total == channels.own:
        return table if channels.own else None
    own = device.empty((table.shape[0], channels.own))
    copy_columns(device, table, channels.shaded, own, 0, channels.own)
    return own


def shade(
    device: Device, means: Any, sh: Any, camera: Camera, culled: Any, *, into: Any = None
) -> Any:
    """Colours of splats with spherical harmonics, as seen from the camera's centre.

    Args:
        device: where the arrays are.
        means: (N, 3) positions.
        sh: (N, K, 3) coefficients.
        camera: the view.
        culled: (N,) why a splat is not drawn; those that are not are black.
        into: a table of features whose first three columns are written; a new one if not given.

    Returns:
        The table, (N, 3) if it is new.

    Raises:
        InputError: the splats have no spherical harmonics.
    """
    _check_harmonics(sh)
    count = means.shape[0]
    features = device.empty((count, 3)) if into is None else into
    center = np.array([*camera.center, 0], np.float32)
    device.launch(
        "splat_shade",
        (count,),
        *(means, sh, culled, features, center, count),
        COEFFICIENTS=sh.shape[1],
        STRIDE=features.shape[1],
    )
    return features


def shade_grad(
    device: Device,
    means: Any,
    sh: Any,
    camera: Camera,
    *,
    features: Any,
    gradients: SplatGradients,
) -> Any:
    """The gradient of ``shade``.

    Args:
        device: where the arrays are.
        means: as given to ``shade``.
        sh: as given to ``shade``.
        camera: as given to ``shade``.
        features: the table it wrote to.
        gradients: the first three of its features are what comes in; what flows through the
            viewing direction is added to its means and camera.

    Returns:
        (N, K, 3) gradient by the coefficients.

    Raises:
        InputError: the splats have no spherical harmonics.
        ShapeError: the gradient and the features have not the same channels, three or more.
    """
    _check_harmonics(sh)
    count = means.shape[0]
    if gradients.features.shape != features.shape or features.shape[1] < 3:
        raise ShapeError(
            f"shade_grad: gradients.features has shape {gradients.features.shape}, wanted that of "
            f"features, {features.shape}, with 3 channels or more"
        )
    grad_sh = device.empty(sh.shape)
    inverse = np.linalg.inv(camera.view[:3, :3]).T
    rows = np.column_stack([inverse, camera.center]).astype(np.float32, order="C")
    device.launch(
        "splat_shade_grad",
        (count,),
        *(means, sh, features, gradients.features, *rows, count),
        *(grad_sh, gradients.means, gradients.camera),
        COEFFICIENTS=sh.shape[1],
        STRIDE=features.shape[1],
        CAMERA_GRADIENT=gradients.camera is not None,
    )
    return grad_sh


def _check_harmonics(sh: Any) -> None:
    if sh is None:
        raise InputError("shade: these splats have no spherical harmonics; draw their colors")
