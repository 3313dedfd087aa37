"""The part that phantoms are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class Ellipsoid:
    """A solid ellipsoid of constant value; where several overlap, their values add.

    Args:
        center: (z, y, x) of the middle, in the grid's unit of length.
        semi_axes: half lengths of the axes (z, y, x) before the rotation, all positive.
        angle: rotation about z in radians, from the x axis towards the y axis.
        value: density inside.

    Raises:
        ShapeError: ``center`` or ``semi_axes`` is not three numbers.
        InputError: a number is not finite, or a semi-axis not positive.
    """

    center: tuple[float, float, float]
    semi_axes: tuple[float, float, float]
    angle: float
    value: float

    def __post_init__(self) -> None:
        """Check the arguments and bring them into their normal form."""
        for name in ("center", "semi_axes"):
            numbers = tuple(float(v) for v in getattr(self, name))
            if len(numbers) != 3:
                raise ShapeError(f"Ellipsoid: {name} is {numbers}, wanted three lengths (z, y, x)")
            object.__setattr__(self, name, numbers)
        object.__setattr__(self, "angle", float(self.angle))
        object.__setattr__(self, "value", float(self.value))
        if min(self.semi_axes) <= 0:
            raise InputError(f"Ellipsoid: semi_axes is {self.semi_axes}, wanted positive lengths")
        if not np.isfinite([*self.center, *self.semi_axes, self.angle, self.value]).all():
            raise InputError(f"Ellipsoid: every number must be finite, this is {self!r}")

    @classmethod
    def ball(
        cls,
        radius: float,
        value: float = 1.0,
        center: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Ellipsoid:
        """A uniform ball: the object whose reconstruction says whether densities are right."""
        return cls(center, (radius, radius, radius), 0.0, value)

    def placed(self, scale: float, center: tuple[float, float, float]) -> Ellipsoid:
        """This ellipsoid enlarged about the origin by ``scale``, then moved by ``center``."""
        z, y, x = (scale * c + o for c, o in zip(self.center, center, strict=True))
        c, b, a = (scale * s for s in self.semi_axes)
        return Ellipsoid((z, y, x), (c, b, a), self.angle, self.value)

    def section(self, z: Reals | None) -> Reals:
        """Squared size of the section at every z relative to the equatorial one; <= 0: missed."""
        if z is None:
            return np.ones(1)
        return 1 - ((z - self.center[0]) / self.semi_axes[0]) ** 2
