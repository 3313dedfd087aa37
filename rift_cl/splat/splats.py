"""The parameters of splats, on a device: Gaussians in space with opacity and colour.

Values are what the rasterizer works with, after a trainer's activations: scales are lengths, not
their logarithms, opacities are not logits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.memory import as_plain, as_real_array, upload
from rift_cl.errors import DTypeError, InputError, ShapeError

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
        scales: (N, 3) standard deviations along the rotated axes; None with ``covars``.
        opacities: (N,) opacities, 0 to 1; densities at the peak, per length, in xray mode.
        colors: (N, D) features, or None.
        sh: (N, K, 3) coefficients of spherical harmonics, K = 1, 4, 9, 16 or 25, or None.
        covars: (N, 6) upper triangles xx, xy, xz, yy, yz, zz of covariance matrices, in place
            of ``quats`` and ``scales``.

    Raises:
        ShapeError: an array does not fit the others.
        DTypeError: an array is not float32.
        InputError: a splat's shape is given twice or not at all.
    """

    means: Any
    quats: Any
    scales: Any
    opacities: Any
    colors: Any = None
    sh: Any = None
    covars: Any = None

    def __post_init__(self) -> None:
        """Check that the arrays fit each other."""
        given = [self.quats is not None, self.scales is not None, self.covars is not None]
        if given not in ([True, True, False], [False, False, True]):
            raise InputError("Splats: give either quats and scales, or covars alone")
        for name in ("means", "quats", "scales", "opacities", "colors", "sh", "covars"):
            array = getattr(self, name)
            if array is not None:
                _check_shape(name, array.shape, self.means.shape[0] if self.means.shape else 0)
                if array.dtype != np.float32:
                    raise DTypeError(f"Splats: {name} has type {array.dtype}, wanted float32")

    def __len__(self) -> int:
        """Number of splats."""
        return int(self.means.shape[0])

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
    ) -> Splats:
        """Copy splats to a device; see the class for the arguments.

        Non-finite values are let through: the projection leaves such splats out and counts them.
        Covariances may also come as (N, 3, 3).

        Raises:
            ShapeError: an array does not fit the others.
            DTypeError: an array does not hold real numbers.
            InputError: a covariance is not symmetric, or a splat's shape is given twice or not
                at all.
        """
        hosts = {"means": means, "quats": quats, "scales": scales, "opacities": opacities}
        hosts |= {"colors": colors, "sh": sh, "covars": covars}
        ready: dict[str, Any] = dict.fromkeys(hosts)
        for name, values in hosts.items():
            if values is not None:
                array = as_real_array(values, name=f"Splats: {name}")
                if name == "covars" and array.shape[1:] == (3, 3):
                    array = _upper_triangles(array)
                ready[name] = as_plain(array, np.float32)
        # Arrays that do not fit are refused before anything is allocated.
        cls(**ready)
        return cls(**{name: _sent(device, host) for name, host in ready.items()})


def _sent(device: Device, host: NDArray[np.float32] | None) -> Any:
    return None if host is None else upload(device, host)


def _check_shape(name: str, shape: tuple[int, ...], count: int) -> None:
    fits = {
        "means": shape == (count, 3),
        "quats": shape == (count, 4),
        "scales": shape == (count, 3),
        "opacities": shape == (count,),
        "colors": len(shape) == 2 and shape[0] == count and shape[1] >= 1,
        "sh": shape in [(count, k, 3) for k in _COEFFICIENTS],
        "covars": shape == (count, 6),
    }
    wanted = {
        "means": "(N, 3)",
        "quats": f"({count}, 4)",
        "scales": f"({count}, 3)",
        "opacities": f"({count},)",
        "colors": f"({count}, D)",
        "sh": f"({count}, K, 3) with K = 1, 4, 9, 16 or 25",
        "covars": f"({count}, 6) or ({count}, 3, 3)",
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
