"""The opening of a thin lens: what a pinhole leaves out.

A pinhole is sharp at every depth and passes every frequency. A lens with an opening is sharp in one
plane alone, draws a point elsewhere as a disc, and passes no detail finer than diffraction lets it
(the step from Figure 9 c to 9 d of the RiFT paper, taken back).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number, positive_or_infinite


@dataclass(frozen=True)
class Aperture:
    """The entrance pupil of a thin lens; lengths are in the unit of the world.

    Args:
        radius: of the round pupil.
        focus: how far in front of the camera, along its axis, the plane lies that is in focus;
            may be infinite.
        wavelength: of the light, vacuum; 0 leaves diffraction out.

    Raises:
        InputError: the radius or the focus is not positive, or the wavelength is negative.
    """

    radius: float
    focus: float
    wavelength: float = 0.0

    def __post_init__(self) -> None:
        """Check the lengths, and keep them as plain numbers."""
        radius, wavelength = one_number(self.radius), one_number(self.wavelength)
        if not 0 < radius < math.inf:
            raise InputError(
                f"Aperture: radius is {self.radius!r}, wanted a positive length; leave the "
                "aperture out for a pinhole"
            )
        focus = positive_or_infinite(self.focus)
        if not focus > 0:
            raise InputError(f"Aperture: focus is {self.focus!r}, wanted a positive distance")
        if not 0 <= wavelength < math.inf:
            raise InputError(f"Aperture: wavelength is {self.wavelength!r}, wanted 0 or a length")
        for name, value in (("radius", radius), ("focus", focus), ("wavelength", wavelength)):
            object.__setattr__(self, name, value)

    def blur(self, depth: ArrayLike) -> NDArray[Any]:
        """Diameter of the blur disc of a point at a depth, measured in the plane of that depth.

        Similar triangles: 2 radius |1 - depth / focus|.
        """
        return np.asarray(2 * self.radius * np.abs(1 - np.asarray(depth) / self.focus))

    def cutoff(self, depth: ArrayLike) -> NDArray[Any]:
        """Incoherent cut-off of diffraction in cycles per unit of length at a depth.

        2 NA / wavelength = 2 radius / (wavelength depth): twice the paper's equation 2, which is
        the coherent one. Infinite without a wavelength, and at the lens itself.
        """
        depth = np.asarray(depth, np.float64)
        if self.wavelength == 0:
            return np.full(depth.shape, np.inf)
        with np.errstate(divide="ignore"):
            return np.asarray(2 * self.radius / (self.wavelength * depth))
