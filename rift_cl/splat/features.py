"""What splats show: their colours by the viewing direction, features of any number, depth.

All of it stands in one table of features, (N, D), in this order: three shaded colours, the splats'
own ``colors``, depth; each where it is asked for. ``kernels/splat/splat_shade.cl`` says what a
colour of spherical harmonics is, ``kernels/splat/lobe_shade.cl`` what one of lobes is.

``angular`` names the functions: ``sh`` with ``sh`` (N, K, 3) alone, or one of the lobes of
``rift_cl.basis.angular`` with ``sh`` (N, L, 3) as their linear coefficients and ``lobes`` (N, G)
as their geometry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rift_cl.basis.angular import ANGULAR_BASES, AngularBasis, angular_basis
from rift_cl.cl.adam import AdamStep
from rift_cl.cl.arithmetic import copy_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_device_array
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.splat.environment import shade_environment
from rift_cl.splat.host_shading import shade_on_host, shade_on_host_grad
from rift_cl.splat.projection import Projection, SplatGradients
from rift_cl.splat.sight import sight_macros, sight_of
from rift_cl.splat.splats import Splats

# The numbers that kernels/include/shading/lobe.h knows the kinds of lobes by.
_LOBES = {"hg": 0, "lg": 1, "sg": 2, "asg": 3}


@dataclass(frozen=True, eq=False)
class Shading:
    """What shades one kind of functions.

    Args:
        kernel: its name; that of its gradient is the same with ``_grad``.
        parameters: the arrays it reads besides means, by its names, in which its gradient is
            taken.
        sizes: what it is built for.
        on_host: the basis, where it has no kernel and is evaluated on the host.
    """

    kernel: str
    parameters: dict[str, DeviceArray]
    sizes: dict[str, int]
    on_host: AngularBasis | None = None

    @classmethod
    def of(
        cls, means: DeviceArray, sh: DeviceArray | None, lobes: DeviceArray | None, angular: str
    ) -> Shading:
        """See that coefficients and lobes fit the functions, and choose; see ``shade``.

        Raises:
            InputError: there are none, or the functions are unknown.
            ShapeError: they do not fit.
        """
        ANGULAR_BASES[angular]
        if sh is None:
            raise InputError("shade: these splats have no spherical harmonics; draw their colors")
        if angular == "sh":
            if lobes is not None:
                raise InputError(
                    "shade: these splats have lobes, which angular='sh' would leave out: say which "
                    f"lobes they are, one of {', '.join(_LOBES)}"
                )
            return cls("splat_shade", {"sh": sh}, {"COEFFICIENTS": sh.shape[1]})
        if lobes is None:
            raise InputError(
                f"shade: angular is {angular!r}, but these splats have no lobes: give lobes, or "
                "draw them with angular='sh'"
            )
        basis = angular_basis(angular, sh.shape[1])
        wanted_shape = (means.shape[0], basis.n_geometry)
        if lobes.shape != wanted_shape:
            raise ShapeError(
                f"shade: lobes has shape {lobes.shape}, wanted {wanted_shape} for {sh.shape[1]} "
                f"functions of {angular!r}"
            )
        parameters = {"linear": sh, "lobes": lobes}
        if angular not in _LOBES:
            return cls("", parameters, {}, basis)
        sizes = {"LOBES": _LOBES[angular], "FUNCTIONS": sh.shape[1]}
        return cls("lobe_shade", parameters, sizes)


@dataclass(frozen=True)
class Channels:
    """How many channels of each kind there are.

    Args:
        shaded: 3 where colours depend on the viewing direction, otherwise 0.
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


def gather_features(projection: Projection, channels: Channels) -> DeviceArray:
    """The table of features, (N, D), as seen from the camera; see ``shade`` for the errors."""
    device, splats, angular = projection.device, projection.splats, projection.settings.angular
    if splats.colors is not None and channels.total == channels.own:
        return splats.colors
    features = device.empty((len(splats), channels.total))
    if channels.shaded:
        lit = splats.environment is not None
        if lit:
            shade_environment(device, splats, projection.camera, projection.culled, into=features)
        given = (splats.means, splats.sh, projection.camera, projection.culled)
        shade(device, *given, into=features, lobes=splats.lobes, angular=angular, lit=lit)
    if splats.colors is not None:
        copy_columns(device, splats.colors, 0, features, channels.shaded, channels.own)
    if channels.depth:
        copy_columns(device, projection.depths, 0, features, channels.color, 1)
    return features


def own_columns(device: Device, table: DeviceArray, channels: Channels) -> DeviceArray | None:
    """The columns of a table of features that belong to the splats' ``colors``; None if none."""
    if not channels.own or channels.total == channels.own:
        return table if channels.own else None
    own = device.empty((table.shape[0], channels.own))
    copy_columns(device, table, channels.shaded, own, 0, channels.own)
    return own


def shade(
    device: Device,
    means: DeviceArray,
    sh: DeviceArray | None,
    camera: Camera,
    culled: DeviceArray,
    *,
    into: DeviceArray | None = None,
    lobes: DeviceArray | None = None,
    angular: str = "sh",
    lit: bool = False,
) -> DeviceArray:
    """Colours of splats in the directions that a camera sees them in.

    That is from where it stands, and along its axis where it is orthographic.

    Args:
        device: where the arrays are.
        means: (N, 3) positions.
        sh: (N, K, 3) coefficients of spherical harmonics, or the linear ones of the lobes.
        camera: the view.
        culled: (N,) why a splat is not drawn; those that are not are black.
        into: a table of features whose first three columns are written; a new one if not given.
        lobes: (N, G) geometry of the lobes; None for spherical harmonics.
        angular: what the colours are made of.
        lit: whether the three columns hold reflected light already, which colours are added to.

    Returns:
        The table, (N, 3) if it is new.

    Raises:
        InputError: the splats have no coefficients, or no such functions are known.
        ShapeError: the coefficients and the lobes do not fit the functions.
    """
    shading = Shading.of(means, sh, lobes, angular)
    count = means.shape[0]
    features = device.empty((count, 3)) if into is None else into
    if shading.on_host is not None:
        linear, geometry = shading.parameters["linear"], shading.parameters["lobes"]
        given = (means, linear, geometry, camera, culled, features)
        shade_on_host(device, shading.on_host, *given, lit=lit)
        return features
    center = np.array([*sight_of(camera), 0], np.float32)
    device.launch(
        shading.kernel,
        (device.traits.runs(count),),
        means=means,
        **shading.parameters,
        culled=culled,
        features=features,
        center=center,
        count=count,
        RUN=device.traits.run,
        STRIDE=features.shape[1],
        **shading.sizes,
        **({"LIT": True} if lit else {}),
        **sight_macros(camera),
    )
    return features


def shade_grad(
    device: Device,
    means: DeviceArray,
    sh: DeviceArray | None,
    camera: Camera,
    *,
    features: DeviceArray,
    gradients: SplatGradients,
    lobes: DeviceArray | None = None,
    angular: str = "sh",
    grad_lobes: DeviceArray | None = None,
    sh_step: AdamStep | None = None,
) -> DeviceArray | None:
    """The gradient of ``shade``.

    Args:
        device: where the arrays are.
        means: as given to ``shade``.
        sh: as given to ``shade``.
        camera: as given to ``shade``.
        features: the table it wrote to.
        gradients: the first three of its features are what comes in; what flows through the
            viewing direction is added to its means and camera.
        lobes: as given to ``shade``.
        angular: as given to ``shade``.
        grad_lobes: (N, G) array that the gradient by the lobes is written to; it is left out if
            not given.
        sh_step: a step of Adam that ``sh`` takes in place by its gradient, which is not kept;
            not for lobes that are evaluated on the host.

    Returns:
        (N, K, 3) gradient by the coefficients; None where they took a step.

    Raises:
        InputError: the splats have no coefficients, or no such functions are known.
        ShapeError: the gradient and the features have not the same channels, three or more, or
            the coefficients, the moments of their step, the lobes and their gradient do not fit.
    """
    shading = Shading.of(means, sh, lobes, angular)
    count = means.shape[0]
    _check_incoming(gradients.features, features)
    if shading.on_host is not None:
        linear, geometry = shading.parameters["linear"], shading.parameters["lobes"]
        by_linear, by_lobes = shade_on_host_grad(
            device, shading.on_host, means, linear, geometry, camera, features, gradients
        )
        if grad_lobes is not None:
            copy_columns(device, by_lobes, 0, grad_lobes, 0, by_lobes.shape[1])
        return by_linear
    coefficients, *others = shading.parameters
    found = {f"grad_{name}": device.empty(shading.parameters[name].shape) for name in others}
    if grad_lobes is not None and lobes is not None:
        found["grad_lobes"] = as_device_array(
            device, grad_lobes, lobes.shape, name="shade_grad: grad_lobes"
        )
    by_sh = device.empty(shading.parameters[coefficients].shape) if sh_step is None else None
    step = {f"grad_{coefficients}": by_sh}
    if sh_step is not None:
        step = sh_step.arguments
        for name, moment in (("first", sh_step.first), ("second", sh_step.second)):
            shape = shading.parameters[coefficients].shape
            as_device_array(device, moment, shape, name=f"shade_grad: sh_step.{name}")
    inverse = np.linalg.inv(camera.view[:3, :3]).T
    rows = np.column_stack([inverse, sight_of(camera)]).astype(np.float32, order="C")
    device.launch(
        f"{shading.kernel}_grad",
        (device.traits.runs(count),),
        means=means,
        **shading.parameters,
        features=features,
        grad_features=gradients.features,
        **{f"inverse_{axis}": row for axis, row in zip("xyz", rows, strict=True)},
        count=count,
        **found,
        **step,
        grad_means=gradients.means,
        camera_parts=gradients.camera,
        RUN=device.traits.run,
        STRIDE=features.shape[1],
        CAMERA_GRADIENT=gradients.camera is not None,
        ADAM=sh_step is not None,
        **shading.sizes,
        **sight_macros(camera),
    )
    return by_sh


def _check_incoming(incoming: DeviceArray, features: DeviceArray) -> None:
    if incoming.shape != features.shape or features.shape[1] < 3:
        raise ShapeError(
            f"shade_grad: gradients.features has shape {incoming.shape}, wanted that of "
            f"features, {features.shape}, with 3 channels or more"
        )
