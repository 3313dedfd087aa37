"""A camera: where it stands, how it maps the scene to pixels, how large its image is.

Axes are OpenCV's: x to the right, y down, z forward. ``view`` takes world to camera coordinates,
``K`` holds focal lengths and principal point in pixels, and pixel (i, j) has its centre at
(j + 0.5, i + 0.5). An orthographic camera is what a parallel beam of X-rays sees; its focal
lengths are pixels per unit of length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.numbers import real_numbers

CameraModel = Literal["pinhole", "ortho", "fisheye"]
# Poses that were written with a few digits still pass.
_RIGID = 1e-3
# Devices count in float32.
_LARGEST = float(np.finfo(np.float32).max)
# Pixels along an edge, so that the device can count them and their tiles.
_MOST = 1 << 24


@dataclass(frozen=True, init=False, eq=False)
class Camera:
    """One posed camera; equal cameras hash equally.

    Args:
        size: (height, width) of the image in pixels.
        K: (3, 3) intrinsics ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`` in pixels; for ``ortho``
            fx and fy are pixels per unit of length. Kept as a read-only float64 array.
        view: (4, 4) world-to-camera matrix, a rotation and a shift. Kept as ``K`` is.
        model: ``pinhole``; ``ortho`` (parallel rays, so that colours that depend on the direction
            are those along the camera's axis); ``fisheye`` (equidistant: the distance
            from the principal point is proportional to the angle from the axis, which may be more
            than 90 degrees; splats are culled and sorted by their distance from it, not by z).
        aperture: the opening of a thin lens, for a pinhole camera that is sharp at one depth;
            None for one that is sharp everywhere.

    Raises:
        ShapeError: the image is empty, or a matrix has the wrong shape.
        NonFiniteError: a matrix holds NaN or infinity.
        InputError: ``K`` is singular, skewed or mirrored, ``view`` is no rigid motion, the
            model is unknown, or has no aperture.
    """

    size: tuple[int, int]
    K: NDArray[np.float64]
    view: NDArray[np.float64]
    model: CameraModel
    aperture: Aperture | None

    def __init__(
        self,
        size: Sequence[int],
        K: ArrayLike,
        view: ArrayLike,
        model: CameraModel = "pinhole",
        aperture: Aperture | None = None,
    ) -> None:
        """Check the arguments and bring them into their normal form."""
        object.__setattr__(self, "size", image_size(size))
        object.__setattr__(self, "K", _intrinsics(K))
        object.__setattr__(self, "view", _pose(view))
        if model not in get_args(CameraModel):
            wanted = ", ".join(get_args(CameraModel))
            raise InputError(f"Camera: model is {model!r}, wanted one of {wanted}")
        object.__setattr__(self, "model", model)
        if aperture is not None and (not isinstance(aperture, Aperture) or model != "pinhole"):
            raise InputError(
                f"Camera: aperture is {aperture!r} with model {model!r}, wanted an Aperture, and "
                "the pinhole model"
            )
        object.__setattr__(self, "aperture", aperture)

    def __eq__(self, other: object) -> bool:
        """Cameras are equal when every pixel sees the same ray."""
        return isinstance(other, Camera) and self._key() == other._key()

    def __hash__(self) -> int:
        """Equal cameras hash equally."""
        return hash(self._key())

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies are made by the constructor, so that their matrices are read-only as well."""
        return Camera, (self.size, self.K, self.view, self.model, self.aperture)

    def _key(self) -> tuple[Any, ...]:
        return self.size, self.K.tobytes(), self.view.tobytes(), self.model, self.aperture

    @property
    def height(self) -> int:
        """Rows of the image."""
        return self.size[0]

    @property
    def width(self) -> int:
        """Columns of the image."""
        return self.size[1]

    def shrunk(self, factor: int) -> Camera:
        """The camera of the same image with blocks of ``factor`` x ``factor`` pixels made one.

        Rows and columns at the lower and right edge that fill no block are left out.

        Raises:
            ShapeError: a side has no whole block.
        """
        K = self.K / [[factor], [factor], [1]]
        size = (self.height // factor, self.width // factor)
        return Camera(size, K, self.view, self.model, self.aperture)

    @property
    def intrinsics(self) -> tuple[float, float, float, float]:
        """The numbers of ``K``: fx, fy, cx, cy in pixels."""
        K = self.K
        return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])

    @cached_property
    def center(self) -> NDArray[np.float64]:
        """Where the camera stands, (3,) in world coordinates; read-only."""
        center = np.asarray(-np.linalg.solve(self.view[:3, :3], self.view[:3, 3]), np.float64)
        center.flags.writeable = False
        return center

    @cached_property
    def axis(self) -> NDArray[np.float64]:
        """Where the camera looks, a unit vector (3,) in world coordinates; read-only."""
        forward = self.view[2, :3]
        axis = np.asarray(forward / np.linalg.norm(forward), np.float64)
        axis.flags.writeable = False
        return axis


def image_size(size: Sequence[int]) -> tuple[int, int]:
    """The size of an image as whole numbers (height, width).

    Raises:
        ShapeError: it is no such pair.
    """
    numbers = real_numbers(size)
    if numbers is None or numbers.shape != (2,) or not _countable(numbers):
        raise ShapeError(
            f"Camera: size is {size!r}, wanted (height, width), each from 1 to {_MOST}"
        )
    return int(numbers[0]), int(numbers[1])


def _countable(numbers: NDArray[np.float64]) -> bool:
    return all(number.is_integer() and 1 <= number <= _MOST for number in numbers.tolist())


def _matrix(name: str, values: ArrayLike, order: int) -> NDArray[np.float64]:
    matrix = real_numbers(values)
    if matrix is None:
        raise InputError(f"Camera: {name} is {values!r}, wanted a matrix of real numbers")
    if matrix.shape != (order, order):
        raise ShapeError(f"Camera: {name} has shape {matrix.shape}, wanted ({order}, {order})")
    if not np.isfinite(matrix).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(matrix))[0])
        raise NonFiniteError(
            f"Camera: {name}{list(place)} is {matrix[place]}, every entry must be finite"
        )
    if np.abs(matrix).max() > _LARGEST:
        raise InputError(f"Camera: {name} holds {np.abs(matrix).max():g}, too large for float32")
    matrix.flags.writeable = False
    return matrix


def _intrinsics(values: ArrayLike) -> NDArray[np.float64]:
    K = _matrix("K", values, 3)
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    if min(fx, fy) <= 0:
        raise InputError(
            f"Camera: K has focal lengths fx = {fx:g} and fy = {fy:g}, both must be positive "
            "(a singular K maps the scene to a line, a negative one mirrors it)"
        )
    if not np.array_equal(K, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]):
        raise InputError(
            f"Camera: K is {K.tolist()}, wanted [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] without "
            "skew: undistort the images to such a camera first"
        )
    return K


def _pose(values: ArrayLike) -> NDArray[np.float64]:
    view = _matrix("view", values, 4)
    rotation = view[:3, :3]
    if not np.array_equal(view[3], [0, 0, 0, 1]):
        raise InputError(f"Camera: the last row of view is {view[3].tolist()}, wanted [0, 0, 0, 1]")
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if error > _RIGID or np.linalg.det(rotation) < 0:
        raise InputError(
            f"Camera: view is no rigid motion (its rotation is off by {error:.2g}, determinant "
            f"{np.linalg.det(rotation):.4g}): wanted a world-to-camera rotation and shift, "
            "without scale or mirror"
        )
    return view
