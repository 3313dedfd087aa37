"""How deep a picture is sharp, and what aperture a deep target wants.

A wide pupil resolves finer detail in a thinner slab. So for a target of some depth there is a best
aperture, and a best resolution that no pixel, lens or distance can better: close to
1.83 / sqrt(wavelength x depth) for the worst depth. Lengths are in one unit, that of the world.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import positive_or_infinite
from rift_cl.optics.optical_transfer import check_positive

# Best aperture over z sqrt(2 wavelength / depth), and the cut-off there over
# 1 / sqrt(wavelength depth); found with the exact OTF, which has no other scale.
BEST_APERTURE, BEST_CUTOFF = 1.8, 1.83
# A little narrower costs 5 % and stays clear of a null of defocus: at 2 a third is lost.
SAFE_APERTURE, SAFE_CUTOFF = 1.6, 1.74


class SharpRange(NamedTuple):
    """Distances between which a picture is sharp enough.

    Args:
        near: the closer limit.
        far: the farther one; may be infinite.
    """

    near: float
    far: float

    @property
    def depth(self) -> float:
        """From one limit to the other."""
        return self.far - self.near


class FiniteDepth(NamedTuple):
    """The best single exposure of a deep target.

    Args:
        diameter: of the entrance pupil.
        cutoff: frequency in the object at which the MTF at the worst depth first falls to 0.1.
    """

    diameter: float
    cutoff: float


def sharp_range(diameter: float, focus: float, blur: float, focal_pixels: float) -> SharpRange:
    """Where the blur disc is not wider than so many pixels: the photographer's depth of field.

    A point at z is a disc of A focal_pixels |1/z - 1/focus| pixels, so that the limits lie evenly
    about the focus in 1/z.

    Args:
        diameter: A, of the entrance pupil.
        focus: distance of the plane in focus; may be infinite.
        blur: widest disc that is taken as sharp, in pixels.
        focal_pixels: focal length of the camera in pixels, ``K[0, 0]``.

    Raises:
        InputError: an argument is not positive.
    """
    check_positive(diameter=diameter, blur=blur, focal_pixels=focal_pixels)
    distance = positive_or_infinite(focus)
    if not distance > 0:
        raise InputError(f"focus is {focus!r}, wanted a positive distance")
    step = blur / (diameter * focal_pixels)
    far = 1 / distance - step
    return SharpRange(1 / (1 / distance + step), 1 / far if far > 0 else math.inf)


def diffraction_depth(diameter: float, distance: float, wavelength: float) -> float:
    """Depth of field that diffraction grants: wavelength / (1 - cos theta).

    About 2 wavelength / NA^2. The inverse of the axial half-extent of the 3D OTF: the narrower the
    pupil, the smaller that extent and the deeper the field (the paper after equation 5).

    Args:
        diameter: of the entrance pupil.
        distance: from it to the plane in focus.
        wavelength: of the light.

    Raises:
        InputError: an argument is not positive.
    """
    check_positive(diameter=diameter, distance=distance, wavelength=wavelength)
    tangent = diameter / (2 * distance)
    # 1 - cos without the loss of digits that a narrow cone brings.
    return wavelength / (tangent**2 / (1 + tangent**2 + math.sqrt(1 + tangent**2)))


def finite_depth_optimum(
    depth: float, distance: float, wavelength: float, *, planes: int = 1, safe: bool = False
) -> FiniteDepth:
    """The aperture that resolves most at the worst depth of a target, and what it resolves.

    Defocus blur A (depth / 2) / z against diffraction wavelength z / A balance at
    A* = z sqrt(2 wavelength / depth); with the exact OTF the best is 1.8 A*. The cut-off
    1.83 / sqrt(wavelength depth) depends neither on distance nor on focal length or pixel; several
    exposures with focus in so many planes divide the depth, and gain their square root.

    Both are to first order in depth / distance, with focus on the target's middle. Of a target a
    tenth as deep as it is far the worse end is resolved 2 % less (``safe``: 4 %), of one a fifth as
    deep 5 % (8 %), of two fifths 24 % (15 %).

    Args:
        depth: of the target along the axis.
        distance: of its middle from the entrance pupil.
        wavelength: of the light.
        planes: exposures, each focused in the middle of its share of the depth.
        safe: narrower by a tenth, well before the null of defocus that lies just beyond the best.

    Raises:
        InputError: an argument is not positive, or the target reaches to the lens.
    """
    check_positive(depth=depth, distance=distance, wavelength=wavelength, planes=planes)
    if depth >= 2 * distance:
        raise InputError(
            f"depth is {depth:g} and distance {distance:g}: the target reaches to the lens"
        )
    share = depth / planes
    width, cutoff = (SAFE_APERTURE, SAFE_CUTOFF) if safe else (BEST_APERTURE, BEST_CUTOFF)
    return FiniteDepth(
        width * distance * math.sqrt(2 * wavelength / share), cutoff / math.sqrt(wavelength * share)
    )
