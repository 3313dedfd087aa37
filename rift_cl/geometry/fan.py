"""How a target was looked at from a point: source and flat detector of a fan-beam scan.

At angle a the source stands at ``source_to_axis * (sin a, -cos a)`` and looks across the rotation
axis at a straight detector, ``source_to_detector`` away from it. Bins grow along
``(cos a, sin a)``, as those of a ``Parallel`` scan of the same angle do, and bin k has its centre
at ``u = (k - center) * pitch`` from the foot of the source on the detector; the line from the
source to ``center`` goes through the axis.

The ray of bin k leaves that line by the fan angle ``gamma = atan(u / source_to_detector)``. It is
the ray of a parallel scan at the angle ``a - gamma`` with ``t = source_to_axis * sin(gamma)``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number


@dataclass(frozen=True)
class FanBeam:
    """Source and detector of a fan-beam scan; all lengths are in one unit.

    Args:
        source_to_axis: distance of the source from the rotation axis.
        source_to_detector: distance of the source from the detector, beyond the axis.
        pitch: distance between bins on the detector.
        center: bin, possibly fractional, at which the rotation axis is seen.

    Raises:
        InputError: one of them is not a usable number, or the detector stands before the axis.
    """

    source_to_axis: float
    source_to_detector: float
    pitch: float
    center: float

    def __post_init__(self) -> None:
        """Check the arguments and bring them into their normal form."""
        for field in fields(self):
            given: Any = getattr(self, field.name)
            value = one_number(given)
            if np.isnan(value):
                raise InputError(f"FanBeam: {field.name} is {given!r}, wanted a finite number")
            if field.name != "center" and not value > 0:
                raise InputError(f"FanBeam: {field.name} is {given!r}, wanted a positive length")
            object.__setattr__(self, field.name, value)
        if not self.source_to_detector >= self.source_to_axis:
            raise InputError(
                f"FanBeam: source_to_detector is {self.source_to_detector:g}, source_to_axis is "
                f"{self.source_to_axis:g}; the detector stands behind the axis"
            )

    @property
    def magnification(self) -> float:
        """How much larger the detector shows what stands at the axis."""
        return self.source_to_detector / self.source_to_axis

    def fan_angles(self, bins: int) -> NDArray[np.float64]:
        """The fan angle of every bin's ray in radians.

        Args:
            bins: number of bins in a row of the detector.

        Raises:
            ShapeError: ``bins`` is not a positive whole number.
        """
        count = one_number(bins)
        if not (count >= 1 and count.is_integer()):
            raise ShapeError(f"FanBeam: bins is {bins!r}, wanted a positive whole number")
        u = (np.arange(int(count), dtype=np.float64) - self.center) * self.pitch
        gamma: NDArray[np.float64] = np.arctan2(u, self.source_to_detector)
        return gamma
