"""Which kernel gives splats their colour by the viewing direction, and whether their arrays fit it.

Spherical harmonics have coefficients alone; lobes have a geometry as well, whose size depends on
their kind and number (``rift_cl.basis.angular``).
"""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.basis.angular import ANGULAR_BASES, AngularBasis, angular_basis
from rift_cl.cl.array import DeviceArray
from rift_cl.errors import InputError, ShapeError

# The numbers that kernels/include/lobe.h knows the kinds of lobes by.
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
