"""The parameters of splats, on a device: Gaussians in space with opacity and colour.

Values are what the rasterizer works with, after a trainer's activations: scales are lengths, not
their logarithms, opacities are not logits. A splat may have Hermite modes, of its shape and of
its colour: with x' its own coordinates, R^T (x - mean) / scale, the density is
opacity * (1 + sum of shape_modes He~(x')) exp(-|x'|^2 / 2), and each channel of the colour is a
feature plus the sum of color_modes He~(x').
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular.environment import MOST_LOBES, REFLECTANCE
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_plain, as_real_array, upload
from rift_cl.errors import DTypeError, InputError, ShapeError, WrongTypeError
from rift_cl.splat.orders import count_of, order_of
from rift_cl.splat.rounded_places import check_rounding, distances_moved
from rift_cl.splat.settings import SplatSettings

# Numbers of spherical harmonics of degree 0 to 4.
_COEFFICIENTS = (1, 4, 9, 16, 25)
# How far a covariance may be from symmetric, relative to its largest entry.
_SYMMETRIC = 1e-5


@dataclass(frozen=True, eq=False)
class Splats:
    """N splats; every array is a float32 device array.

    Args:
        means: (N, 3) positions in world coordinates.
        quats: (N, 4) rotations as quaternions (w, x, y, z) of any length; None with ``covars``.
        scales: (N, 3) standard deviations along the rotated axes, all above 0, or a splat is not
            drawn; None with ``covars``.
        opacities: (N,) opacities, 0 to 1; densities at the peak, per length, in xray mode. What
            they are belongs to the settings they are drawn with, so that they are not checked here.
            A splat of density 0 or below is not drawn and gets no gradient.
        colors: (N, D) features, or None.
        sh: (N, K, 3) coefficients of spherical harmonics, K = 1, 4, 9, 16 or 25, or None.
        covars: (N, 6) upper triangles xx, xy, xz, yy, yz, zz of covariance matrices, in place
            of ``quats`` and ``scales``.
        shape_modes: (N, K - 1) coefficients of the density's modes of order 1 and more, in
            graded order (see ``rift_cl.splat.projection``), K = 4, 10, 20, 35.. for the orders to
            1, 2, 3, 4..; None for Gaussians.
        color_modes: (N, K - 1, C) coefficients of the colours' modes, C = all channels but
            depth; None for splats of one colour.
        lobes: (N, G) geometry of the splats' angular lobes, in place of spherical harmonics (see
            ``SplatSettings.angular``); ``sh`` are then their (N, L, 3) linear coefficients, L >= 1.
        normals: (N, 3) normals, of any length, of surfaces that reflect ``environment``; the side
            does not matter, and a splat without one reflects nothing.
        reflectance: (N, 7) how they reflect it: logits of tint and of grazing tint, three each,
            and the natural logarithm of the sharpness; see ``rift_cl.basis.angular.environment``.
        environment: (K, 3) natural logarithms of the radiance of the K lobes of a light that all
            splats share, K = 1 to 4096. These three come together or not at all, with ``sh``.

    Raises:
        ShapeError: an array does not fit the others.
        DTypeError: an array is not float32.
        InputError: a splat's shape is given twice or not at all, covariances have modes, lobes
            or reflected light have no coefficients beside them, or a number of modes belongs to no
            order.
    """

    means: DeviceArray
    quats: DeviceArray | None
    scales: DeviceArray | None
    opacities: DeviceArray
    colors: DeviceArray | None = None
    sh: DeviceArray | None = None
    covars: DeviceArray | None = None
    shape_modes: DeviceArray | None = None
    color_modes: DeviceArray | None = None
    lobes: DeviceArray | None = None
    normals: DeviceArray | None = None
    reflectance: DeviceArray | None = None
    environment: DeviceArray | None = None

    def __post_init__(self) -> None:
        """Check that the arrays fit each other."""
        given = [self.quats is not None, self.scales is not None, self.covars is not None]
        if given not in ([True, True, False], [False, False, True]):
            raise InputError("Splats: give either quats and scales, or covars alone")
        for name, array in vars(self).items():
            if array is not None or name == "means":
                if not hasattr(array, "shape"):
                    kind = type(array).__name__
                    raise WrongTypeError(f"Splats: {name} is a {kind}, wanted an array")
                count = self.means.shape[0] if self.means.shape else 0
                _check_shape(name, array.shape, count, lobed=self.lobes is not None)
                if array.dtype != np.float32:
                    raise DTypeError(f"Splats: {name} has type {array.dtype}, wanted float32")
        _check_modes(self)
        _check_light(self)

    def __len__(self) -> int:
        """Number of splats."""
        return int(self.means.shape[0])

    @property
    def shape_order(self) -> int:
        """Highest order of the density's modes; 0 for Gaussians."""
        return 0 if self.shape_modes is None else order_of(self.shape_modes.shape[1] + 1)

    @property
    def color_order(self) -> int:
        """Highest order of the colours' modes; 0 for splats of one colour."""
        return 0 if self.color_modes is None else order_of(self.color_modes.shape[1] + 1)

    @classmethod
    def upload(
        cls,
        device: Device,
        *,
        means: Any,
        opacities: Any,
        quats: Any = None,
        scales: Any = None,
        colors: Any = None,
        sh: Any = None,
        covars: Any = None,
        shape_modes: Any = None,
        color_modes: Any = None,
        lobes: Any = None,
        normals: Any = None,
        reflectance: Any = None,
        environment: Any = None,
    ) -> Splats:
        """Copy splats to a device; see the class for the arguments.

        Non-finite values are let through: the projection leaves such splats out and counts them.
        Covariances may also come as (N, 3, 3).

        Raises:
            ShapeError: an array does not fit the others.
            DTypeError: an array does not hold real numbers.
            InputError: a scale is negative, as a logarithm is, a covariance is not symmetric, a
                splat's shape is given twice or not at all, covariances have modes, a number of
                modes belongs to no order, or ``means`` are float64 and so far from the origin that
                float32 moves splats by more than a tenth of a width.
            ResourceLimitError: they do not fit the device's memory budget.
        """
        hosts = {"means": means, "quats": quats, "scales": scales, "opacities": opacities}
        hosts |= {"colors": colors, "sh": sh, "covars": covars, "lobes": lobes}
        hosts |= {"shape_modes": shape_modes, "color_modes": color_modes}
        hosts |= {"normals": normals, "reflectance": reflectance, "environment": environment}
        ready: dict[str, Any] = dict.fromkeys(hosts)
        for name, values in hosts.items():
            if values is not None:
                array = as_real_array(values, name=f"Splats: {name}")
                if name == "covars" and array.shape[1:] == (3, 3):
                    array = _upper_triangles(array)
                ready[name] = as_plain(array, np.float32)
        if scales is not None:
            check_scales(float(np.fmin.reduce(ready["scales"], axis=None, initial=0)))
        # Arrays that do not fit are refused before anything is allocated.
        count = len(cls(**ready))
        if scales is not None and (places := np.asarray(means)).dtype == np.float64:
            moved = distances_moved(places, ready["means"])
            with np.errstate(divide="ignore"):
                check_rounding("Splats: means", moved, ready["means"], np.log(ready["scales"]))
        need = sum(host.nbytes for host in ready.values() if host is not None)
        plan_chunks(1, need, 0, device.budget, what=f"scene of {count} splats")
        return cls(**{name: _sent(device, host) for name, host in ready.items()})


def check_scales(least: float) -> None:
    """Refuse the logarithms of scales, which files of splats hold.

    Raises:
        InputError: the least scale is negative.
    """
    if least < 0:
        raise InputError(
            f"scales go down to {least:.3g}, wanted lengths: of their logarithms take exp(scales)"
        )


def check_opacities(least: float, most: float, settings: SplatSettings) -> None:
    """Refuse opacities that are none, such as logits, which files of splats hold.

    Args:
        least: of the opacities.
        most: of them.
        settings: by which they are drawn.

    Raises:
        InputError: an opacity is below 0 or above 1, or a density of xray mode below 0.
    """
    if settings.mode == "xray":
        if least < 0:
            raise InputError(
                f"opacities, which are densities in xray mode, go down to {least:.3g}, and none "
                "below 0 is drawn: fit their logarithms, and draw exp of these"
            )
    elif settings.activation == "clamp" and (least < 0 or most > 1):
        raise InputError(
            f"opacities go from {least:.3g} to {most:.3g}, wanted 0 to 1: of their logits take "
            "sigmoid(opacities), 1 / (1 + exp(-opacities))"
        )


def _sent(device: Device, host: NDArray[np.float32] | None) -> Any:
    return None if host is None else upload(device, host)


def _check_modes(splats: Splats) -> None:
    given = [name for name in ("shape_modes", "color_modes") if getattr(splats, name) is not None]
    if given and splats.covars is not None:
        raise InputError(
            f"Splats: {given[0]} want quats and scales: a covariance has no axes of its own for "
            "modes to lie along"
        )
    for name in given:
        try:
            order_of(getattr(splats, name).shape[1] + 1)
        except InputError as error:
            raise InputError(f"Splats: {name}: {error} (the first, 1, is not stored)") from error
    if splats.lobes is not None and splats.sh is None:
        raise InputError("Splats: lobes want sh, the linear coefficients of their functions")
    if splats.color_modes is not None:
        channels = 0 if splats.colors is None else splats.colors.shape[1]
        channels += 0 if splats.sh is None else 3
        if splats.color_modes.shape[2] != channels:
            raise ShapeError(
                f"Splats: color_modes has shape {tuple(splats.color_modes.shape)}, its last "
                f"length wants to be {channels}, the channels of sh and colors together"
            )


def _check_light(splats: Splats) -> None:
    names = ("normals", "reflectance", "environment")
    given = [name for name in names if getattr(splats, name) is not None]
    if given and (len(given) < len(names) or splats.sh is None):
        raise InputError(
            f"Splats: {' and '.join(given)} alone reflect no light: give normals, reflectance, "
            "environment and sh"
        )


def _check_shape(name: str, shape: tuple[int, ...], count: int, *, lobed: bool) -> None:
    fits = {
        "means": shape == (count, 3),
        "quats": shape == (count, 4),
        "scales": shape == (count, 3),
        "opacities": shape == (count,),
        "colors": len(shape) == 2 and shape[0] == count and shape[1] >= 1,
        "sh": shape in [(count, k, 3) for k in _COEFFICIENTS]
        or (lobed and len(shape) == 3 and shape[::2] == (count, 3) and shape[1] >= 1),
        "covars": shape == (count, 6),
        "shape_modes": len(shape) == 2 and shape[0] == count,
        "color_modes": len(shape) == 3 and shape[0] == count,
        "lobes": len(shape) == 2 and shape[0] == count and shape[1] >= 1,
        "normals": shape == (count, 3),
        "reflectance": shape == (count, REFLECTANCE),
        "environment": len(shape) == 2 and shape[1] == 3 and 1 <= shape[0] <= MOST_LOBES,
    }
    wanted = {
        "means": "(N, 3)",
        "quats": f"({count}, 4)",
        "scales": f"({count}, 3)",
        "opacities": f"({count},)",
        "colors": f"({count}, D)",
        "sh": f"({count}, K, 3) with "
        + ("K >= 1" if lobed else "K = 1, 4, 9, 16 or 25 (any K >= 1 with lobes)"),
        "covars": f"({count}, 6) or ({count}, 3, 3)",
        "shape_modes": f"({count}, K - 1) with K = {count_of(1)}, {count_of(2)}, {count_of(3)}..",
        "color_modes": f"({count}, K - 1, C) with K = {count_of(1)}, {count_of(2)}, "
        f"{count_of(3)}..",
        "lobes": f"({count}, G) with G >= 1",
        "normals": f"({count}, 3)",
        "reflectance": f"({count}, {REFLECTANCE})",
        "environment": f"(K, 3) with K = 1 to {MOST_LOBES}",
    }
    if not fits[name]:
        raise ShapeError(f"Splats: {name} has shape {tuple(shape)}, wanted {wanted[name]}")


def _upper_triangles(covars: NDArray[Any]) -> NDArray[Any]:
    with np.errstate(all="ignore"):
        gap = np.abs(covars - covars.transpose(0, 2, 1)).max(axis=(1, 2))
        # Not finite compares as false: such a splat is left to the projection.
        skew = np.flatnonzero(gap > _SYMMETRIC * np.abs(covars).max(axis=(1, 2)))
    if skew.size:
        raise InputError(
            f"Splats: covars[{skew[0]}] is not symmetric (nor are {skew.size - 1} others): pass "
            "covariance matrices, for example (C + C.T) / 2"
        )
    rows, columns = np.triu_indices(3)
    return covars[:, rows, columns]
