"""What the text and the binary files of a COLMAP model have in common: their records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import FileFormatError

# Focal lengths and coefficients of each camera model.
CAMERA_MODELS = {
    "SIMPLE_PINHOLE": (1, 0),
    "PINHOLE": (2, 0),
    "SIMPLE_RADIAL": (1, 1),
    "RADIAL": (1, 2),
    "OPENCV": (2, 4),
    "OPENCV_FISHEYE": (2, 4),
    "FULL_OPENCV": (2, 8),
    "FOV": (2, 1),
    "SIMPLE_RADIAL_FISHEYE": (1, 1),
    "RADIAL_FISHEYE": (1, 2),
    "THIN_PRISM_FISHEYE": (2, 8),
    "SIMPLE_FISHEYE": (1, 0),
    "FISHEYE": (2, 0),
}
# All that COLMAP 4 has, those that are not known among them: a place in this order is a number.
MODEL_NAMES = (
    *("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE"),
    *("FULL_OPENCV", "FOV", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE"),
    *("RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "SIMPLE_FISHEYE", "FISHEYE"),
    *("EUCM", "EQUIRECTANGULAR"),
)


@dataclass(frozen=True)
class CameraRecord:
    """A camera: its number, model, size in pixels, and focal lengths, centre and coefficients."""

    number: int
    model: str
    width: int
    height: int
    parameters: tuple[float, ...]

    @property
    def K(self) -> list[list[float]]:
        """Intrinsics (3, 3) in pixels."""
        focals = CAMERA_MODELS[self.model][0]
        cx, cy = self.parameters[focals : focals + 2]
        return [[self.parameters[0], 0, cx], [0, self.parameters[focals - 1], cy], [0, 0, 1]]

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of the lens."""
        return self.parameters[CAMERA_MODELS[self.model][0] + 2 :]


@dataclass(frozen=True)
class ImageRecord:
    """A posed image: world-to-camera quaternion (w, x, y, z) and shift, camera, file name."""

    quaternion: tuple[float, ...]
    shift: tuple[float, ...]
    camera: int
    name: str


@dataclass(frozen=True, eq=False)
class PointRecords:
    """Sparse points (P, 3), their colours (P, 3) from 0 to 255, their errors (P,) in pixels."""

    positions: NDArray[np.float64]
    colors: ArrayLike
    errors: NDArray[np.float64]


def parameter_count(where: str, model: str) -> int:
    """How many parameters a camera model has.

    Raises:
        FileFormatError: the model is unknown; the error lists those that are known.
    """
    if model not in CAMERA_MODELS:
        raise FileFormatError(
            f"{where}: the camera model {model[:40]!r} is not known; known are "
            f"{', '.join(CAMERA_MODELS)}; COLMAP's image_undistorter makes photographs of a PINHOLE"
        )
    focals, coefficients = CAMERA_MODELS[model]
    return focals + 2 + coefficients
