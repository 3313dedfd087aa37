"""A camera that can be bought: focal length, f-number, pixel. Placed and focused, it is a Camera.

The planner chooses among such cameras, where to stand and what to focus on; everything behind it
(coverage, merits, the renderer) sees the ``Camera`` that comes out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.numbers import one_number, positive_or_infinite


@dataclass(frozen=True)
class CameraType:
    """A lens and a sensor; lengths are in the unit of the world, say millimetres.

    Distances are from the entrance pupil, where a lens has its centre of perspective: |m| is the
    magnification f / (z - f / P) at a focus z, with P the pupil magnification. A thin lens with
    its stop at the glass has P = 1, and z' = f z / (z - f) is its image distance.

    Args:
        name: by which a plan names it.
        focal_length: f of the lens.
        f_number: N = f / A of the lens focused at infinity, A the diameter of the entrance pupil.
        pixel: pitch of the sensor.
        size: (height, width) of the sensor in pixels.
        wavelength: of the light, vacuum; 0 leaves diffraction out. 550 nm in millimetres.
        exposure: how long the shutter is open, relative to the other cameras.
        pupil_magnification: P, diameter of the exit pupil over that of the entrance pupil.

    Raises:
        InputError: a length, the f-number, the exposure or P is not positive, or the wavelength
            is negative.
        ShapeError: the sensor has no pixels.
    """

    name: str
    focal_length: float
    f_number: float
    pixel: float
    size: tuple[int, int]
    wavelength: float = 550e-6
    exposure: float = 1.0
    pupil_magnification: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers, and that a camera can be made of them."""
        if not isinstance(self.name, str):
            raise InputError(f"CameraType: name is {self.name!r}, wanted a text")
        for field in ("focal_length", "f_number", "pixel", "exposure", "pupil_magnification"):
            value = getattr(self, field)
            if not one_number(value) > 0:
                raise InputError(
                    f"CameraType {self.name!r}: {field} is {value!r}, wanted a positive number"
                )
        if not one_number(self.wavelength) >= 0:
            raise InputError(
                f"CameraType {self.name!r}: wavelength is {self.wavelength!r}, wanted 0 or a length"
            )
        # A wrong size is refused by Camera, in its words.
        object.__setattr__(self, "size", Camera(self.size, np.eye(3), np.eye(4)).size)
        self.camera(np.eye(4), math.inf)

    @property
    def pupil_radius(self) -> float:
        """Radius f / (2 N) of the entrance pupil."""
        return self.focal_length / (2 * self.f_number)

    @property
    def nearest_focus(self) -> float:
        """The distance f / P at which the image would move to infinity; a focus lies beyond it."""
        return self.focal_length / self.pupil_magnification

    def image_distance(self, focus: float) -> float:
        """Distance z' = |m| z: what one unit of tangent of the field angle covers on the sensor.

        Args:
            focus: distance from the entrance pupil to the plane in focus; may be infinite.

        Raises:
            InputError: no image is formed of a plane that close.
        """
        distance = positive_or_infinite(focus)
        if not distance > self.nearest_focus:
            raise InputError(
                f"CameraType {self.name!r}: focus is {focus!r}, wanted a distance beyond "
                f"{self.nearest_focus:g}, where the image of this lens moves to infinity"
            )
        return self.focal_length / (1 - self.nearest_focus / distance)

    def magnification(self, focus: float) -> float:
        """|m| in the plane in focus, 0 at infinity; errors are those of ``image_distance``."""
        return self.image_distance(focus) / focus

    def camera(self, view: ArrayLike, focus: float) -> Camera:
        """This camera at a place, focused at a distance.

        The principal point is the middle of the sensor, and the camera's centre is that of the
        entrance pupil.

        Args:
            view: (4, 4) world-to-camera matrix.
            focus: as for ``image_distance``.

        Raises:
            InputError: the focus is too close, or the view is no pose.
        """
        focal = self.image_distance(focus) / self.pixel
        height, width = self.size
        K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
        aperture = Aperture(self.pupil_radius, focus, self.wavelength)
        return Camera(self.size, K, view, aperture=aperture)

    def photons(self, focus: float) -> float:
        """Relative number of photons per area of the sensor, from a surface of one brightness.

        exposure A^2 / z'^2 = exposure / N_w^2, with N_w = N (1 + |m| / P) the working f-number.
        """
        return self.exposure * (2 * self.pupil_radius / self.image_distance(focus)) ** 2

    def object_photons(self, focus: float) -> float:
        """Relative number of photons per area of the plane in focus: exposure A^2 / z^2.

        What the noise density in object space depends on, whatever the pixels; 0 at infinity.
        """
        return self.photons(focus) * self.magnification(focus) ** 2
