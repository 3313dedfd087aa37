"""A lens reduced to its principal planes and pupils. Figures 9 b and 9 c of the RiFT paper.

For rays close to the axis, any lens in air is two principal planes and a focal length, and its
stop is seen from outside as two pupils. Two rays through the prescription find all of them (the
y-nu method: W. J. Smith, "Modern Optical Engineering", chapter 2). What rays far from the axis do
otherwise is the error of this step; ``camera_reduction`` measures it.
"""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.errors import InputError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.geometry.numbers import one_number
from rift_cl.optics.lens_prescription import LensPrescription

_Row = tuple[float, float]


@dataclass(frozen=True)
class GaussianLens:
    """The first-order model of a lens that forms images; lengths in millimetres.

    Args:
        name: of the lens.
        wavelength: for which it holds.
        focal_length: f, positive.
        length: from the first vertex to the last.
        front_principal: position of P along the axis, from the first vertex.
        rear_principal: position of P', from the last vertex.
        entrance_pupil: its position, from the first vertex.
        exit_pupil: its position, from the last vertex.
        pupil_diameter: A, of the entrance pupil.
        pupil_magnification: diameter of the exit pupil over that of the entrance pupil.
        stop_radius: of the stop itself.
    """

    name: str
    wavelength: float
    focal_length: float
    length: float
    front_principal: float
    rear_principal: float
    entrance_pupil: float
    exit_pupil: float
    pupil_diameter: float
    pupil_magnification: float
    stop_radius: float

    @property
    def front_focus(self) -> float:
        """Position of F, from the first vertex."""
        return self.front_principal - self.focal_length

    @property
    def rear_focus(self) -> float:
        """Position of F', from the last vertex: the back focal distance."""
        return self.rear_principal + self.focal_length

    @property
    def hiatus(self) -> float:
        """From P to P': what a thin lens leaves out of the space between object and image."""
        return self.length + self.rear_principal - self.front_principal

    @property
    def f_number(self) -> float:
        """N = f / A."""
        return self.focal_length / self.pupil_diameter

    @property
    def exit_pupil_diameter(self) -> float:
        """Of the stop's image in the space behind the lens."""
        return self.pupil_diameter * self.pupil_magnification

    def image_position(self, distance: float) -> float:
        """Where the image of an axial point lies, from the last vertex.

        Args:
            distance: of the point from the entrance pupil; may be infinite.

        Raises:
            InputError: the point is not in front of the front focus: no real image.
        """
        lens = self.camera_type(1.0, (1, 1))
        shift = self.focal_length * lens.magnification(distance)
        return self.rear_focus + shift

    def camera_type(
        self,
        pixel: float,
        size: tuple[int, int],
        *,
        name: str | None = None,
        exposure: float = 1.0,
        unit: float = 1.0,
    ) -> CameraType:
        """This lens with a sensor behind it.

        Args:
            pixel: pitch of the sensor in millimetres.
            size: (height, width) of the sensor in pixels.
            name: of the camera; that of the lens when None.
            exposure: as ``CameraType`` has it.
            unit: how many units of the world one millimetre is.

        Raises:
            InputError: an argument is not positive.
        """
        if not one_number(unit) > 0:
            raise InputError(f"unit is {unit!r}, wanted how many units of the world 1 mm is")
        return CameraType(
            self.name if name is None else name,
            self.focal_length * unit,
            self.f_number,
            pixel * unit,
            size,
            wavelength=self.wavelength * unit,
            exposure=exposure,
            pupil_magnification=self.pupil_magnification,
        )


def gaussian_lens(prescription: LensPrescription, wavelength: float | None = None) -> GaussianLens:
    """Reduce a prescription to its first-order model.

    Args:
        prescription: the lens.
        wavelength: in millimetres; the primary one when None. The stop stays as wide as it is at
            the primary one.

    Raises:
        InputError: the lens does not converge, or sees its stop at infinity or upside down.
    """
    primary = prescription.wavelength
    at_primary = _Paraxial(prescription, primary)
    stop_radius = at_primary.stop_radius()
    if wavelength is None or wavelength == primary:
        return at_primary.lens(stop_radius)
    return _Paraxial(prescription, wavelength).lens(stop_radius)


class _Paraxial:
    """Ray matrices for (height, index x slope): of the whole lens, and before and behind the stop.

    A refraction adds -power x height to the second entry, with power = (n' - n) curvature; a space
    adds thickness / n x the second entry to the height. All of them have the determinant 1.
    """

    def __init__(self, lens: LensPrescription, wavelength: float) -> None:
        self.prescription, self.wavelength = lens, wavelength
        self.n = lens.indices(wavelength)
        self.where = f"lens {lens.name!r}"
        self.whole = self._matrix(0, len(lens.surfaces), ends=True)
        self.before = self._matrix(0, lens.stop, ends=False)
        self.behind = self._matrix(lens.stop, len(lens.surfaces), ends=True)
        power = -self.whole[1][0]
        # The scale of an afocal lens is its length: a focus a million times further is none.
        if not power * max(lens.length, 1.0) > 1e-6:
            kind = "diverges" if power < 0 else "has its focus at infinity"
            raise InputError(f"{self.where}: {kind}, wanted one that forms a real image")
        self.focal_length = 1 / power
        if min(abs(self.before[0][0]), abs(self.behind[1][1])) < 1e-9:
            raise InputError(
                f"{self.where}: is telecentric, a pupil lies at infinity; a camera that has a "
                "centre of perspective is wanted"
            )
        if self.before[0][0] * self.behind[1][1] < 0:
            raise InputError(f"{self.where}: shows its stop upside down, as a relay does")

    def _matrix(self, first: int, end: int, *, ends: bool) -> tuple[_Row, _Row]:
        """From surface ``first`` on; up to the vertex of ``end``, or ``end - 1`` for ``ends``."""
        rows = [[1.0, 0.0], [0.0, 1.0]]
        for index in range(first, end):
            surface, n, behind = self.prescription.surfaces[index], *self.n[index : index + 2]
            power = (behind - n) * surface.curvature
            rows[1] = [low - power * high for high, low in zip(*rows, strict=True)]
            if not (ends and index == end - 1):
                way = surface.thickness / behind
                rows[0] = [high + way * low for high, low in zip(*rows, strict=True)]
        return (rows[0][0], rows[0][1]), (rows[1][0], rows[1][1])

    def stop_radius(self) -> float:
        """How wide the stop is for the opening that is prescribed."""
        opening = self.prescription.opening
        if self.prescription.opening_is == "stop":
            return opening / 2
        pupil = (
            self.focal_length / opening if self.prescription.opening_is == "f_number" else opening
        )
        return abs(self.before[0][0]) * pupil / 2

    def lens(self, stop_radius: float) -> GaussianLens:
        """The first-order model with the stop that wide."""
        (a, _), (_, d) = self.whole
        f, seen, shown = self.focal_length, self.before[0][0], self.behind[1][1]
        return GaussianLens(
            name=self.prescription.name,
            wavelength=self.wavelength,
            focal_length=f,
            length=self.prescription.length,
            front_principal=f * (1 - d),
            rear_principal=f * (a - 1),
            entrance_pupil=self.before[0][1] / seen,
            exit_pupil=-self.behind[0][1] / shown,
            pupil_diameter=2 * stop_radius / abs(seen),
            pupil_magnification=seen / shown,
            stop_radius=stop_radius,
        )
