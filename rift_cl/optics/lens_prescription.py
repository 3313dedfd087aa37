"""A lens as its designer writes it: surfaces, glasses, a stop. Figure 9 a of the RiFT paper.

Everything simpler (principal planes, pupils, a pinhole) is derived from this, and whatever is lost
on the way is measured by tracing real rays through it. Lengths are in millimetres; light comes
from the left, along which distances grow; a radius is positive where the centre lies to the right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.geometry.numbers import one_number
from rift_cl.optics.glass import Glass

# The largest zoom lenses have some fifty.
MOST_SURFACES = 1000
MOST_WAVELENGTHS = 100
# A kilometre: an air space or a radius beyond it is a plane or a mistake.
_LONGEST = 1e6


@dataclass(frozen=True)
class Surface:
    """One surface of revolution, and the space behind it.

    Args:
        radius: of curvature at the vertex; infinite for a plane.
        thickness: along the axis to the next surface; of the last one to the image plane, 0 where
            that is not prescribed.
        glass: behind the surface; None for air.
        conic: constant k of the conic section: 0 a sphere, -1 a paraboloid.
        semi_diameter: how far from the axis the surface reaches, None where it is not said; it is
            for drawing, rays are not clipped.

    Raises:
        InputError: a number cannot be one of a lens.
    """

    radius: float
    thickness: float
    glass: Glass | None = None
    conic: float = 0.0
    semi_diameter: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        radius = self.radius
        if not (radius in (math.inf, -math.inf) or 0 < abs(one_number(radius)) < math.inf):
            raise InputError(
                f"radius is {radius!r}, wanted a length other than zero, or infinity for a plane"
            )
        least = "a positive length" if self.glass else "0 or a positive length"
        thickness = one_number(self.thickness)
        if not 0 <= thickness <= _LONGEST or (self.glass and thickness == 0):
            raise InputError(
                f"thickness is {self.thickness!r} mm, wanted {least} up to a kilometre"
            )
        if not math.isfinite(one_number(self.conic)):
            raise InputError(f"conic is {self.conic!r}, wanted a finite number")
        if self.semi_diameter is not None and not one_number(self.semi_diameter) > 0:
            raise InputError(f"semi_diameter is {self.semi_diameter!r}, wanted a positive length")
        if self.glass is not None and not isinstance(self.glass, Glass):
            raise InputError(f"glass is {self.glass!r}, wanted a Glass, or None for air")

    @property
    def curvature(self) -> float:
        """1 / radius, 0 for a plane."""
        return 1 / self.radius


@dataclass(frozen=True)
class LensPrescription:
    """A lens in air.

    Args:
        name: of the lens.
        surfaces: from the side of the object; a stop between elements is a plane surface in air.
        stop: which of them, from 0, carries the aperture stop in its vertex plane.
        opening: how wide the stop is open, in the words of ``opening_is``.
        opening_is: ``pupil`` (diameter of the entrance pupil), ``f_number`` (for an object at
            infinity) or ``stop`` (diameter of the stop itself).
        wavelengths: of the light, millimetres.
        weights: how much each of them counts; all the same when empty.
        primary: which of the wavelengths the lens is reduced for.
        source: where the prescription was published.

    Raises:
        InputError: there is no surface or no such stop, the last surface leads into glass, the
            opening is not positive, or a wavelength is none.
        ResourceLimitError: there are more surfaces than any lens has.
    """

    name: str
    surfaces: tuple[Surface, ...]
    stop: int
    opening: float
    opening_is: str = "pupil"
    wavelengths: tuple[float, ...] = (587.5618e-6,)
    weights: tuple[float, ...] = ()
    primary: int = 0
    source: str = ""

    def __post_init__(self) -> None:
        """Check that light can pass."""
        where, count = f"lens {self.name!r}", len(self.surfaces)
        if count > MOST_SURFACES:
            raise ResourceLimitError(
                f"{where}: has {count} surfaces, at most {MOST_SURFACES} are read"
            )
        if count == 0 or self.surfaces[-1].glass is not None:
            problem = "the last surface leads into glass" if count else "there is no surface"
            raise InputError(f"{where}: {problem}, wanted surfaces from air to air")
        if not _counts(self.stop, count):
            raise InputError(
                f"{where}: stop is {self.stop!r}, wanted a surface from 0 to {count - 1}"
            )
        if self.opening_is not in ("pupil", "f_number", "stop"):
            raise InputError(
                f"{where}: opening_is is {self.opening_is!r}, wanted pupil, f_number or stop"
            )
        if not one_number(self.opening) > 0:
            raise InputError(
                f"{where}: the opening ({self.opening_is}) is {self.opening!r}, wanted a positive "
                "number"
            )
        self._check_light(where)

    def _check_light(self, where: str) -> None:
        count = len(self.wavelengths)
        if not 1 <= count <= MOST_WAVELENGTHS or not _counts(self.primary, count):
            raise InputError(
                f"{where}: has {count} wavelengths, of which number {self.primary!r} is the "
                f"primary one; wanted 1 to {MOST_WAVELENGTHS}, counted from 0"
            )
        if self.weights == ():
            object.__setattr__(self, "weights", (1.0,) * count)
        weights = [one_number(weight) for weight in self.weights]
        if len(weights) != count or not min(weights) >= 0 or not sum(weights) > 0:
            raise InputError(
                f"{where}: weights are {self.weights!r}, wanted one for each wavelength, not "
                "negative, not all zero"
            )
        for wavelength in self.wavelengths:
            if not 0 < one_number(wavelength) < 1:
                raise InputError(
                    f"{where}: a wavelength is {wavelength!r} mm, wanted one of light, as 550e-6"
                )
            self.indices(wavelength)

    @property
    def wavelength(self) -> float:
        """The primary wavelength in millimetres."""
        return self.wavelengths[self.primary]

    @property
    def length(self) -> float:
        """From the first vertex to the last."""
        return sum(surface.thickness for surface in self.surfaces[:-1])

    @property
    def image_distance(self) -> float:
        """From the last vertex to the image plane as prescribed; 0 where it is not."""
        return self.surfaces[-1].thickness

    def indices(self, wavelength: float) -> list[float]:
        """Index of each medium from the left: surfaces + 1 numbers, the first that of air.

        Raises:
            InputError: a glass has no index at that wavelength.
        """
        behind = [s.glass.index(wavelength) if s.glass else 1.0 for s in self.surfaces]
        return [1.0, *behind]


def _counts(number: object, count: int) -> bool:
    """Whether it is a whole number from 0 to below the count."""
    return isinstance(number, int) and 0 <= number < count
