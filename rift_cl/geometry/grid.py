"""A regular grid of samples: an image (y, x) or a volume (z, y, x).

Coordinates grow with the index. Sample i of n along an axis stands at
``center + (i - (n - 1) / 2) * spacing``, so that a grid lies symmetrically about its centre, and
the rotation axis of a scan, which is the line x = y = 0, passes through the middle by default.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import real_numbers


@dataclass(frozen=True, init=False)
class Grid:
    """Samples on a regular grid.

    Args:
        shape: (ny, nx) of an image or (nz, ny, nx) of a volume.
        spacing: distance between samples, one for all axes or one per axis in the order of
            ``shape``, in any unit of length; every other length of a scan is in the same unit.
            Kept as one number per axis.
        center: coordinates of the grid's middle, given and kept as ``spacing`` is.

    Raises:
        ShapeError: the shape is not two or three positive integers, or the others do not fit it.
        InputError: a spacing is not positive or a coordinate not finite.
    """

    shape: tuple[int, ...]
    spacing: tuple[float, ...]
    center: tuple[float, ...]

    def __init__(
        self,
        shape: Sequence[int],
        spacing: float | Sequence[float] = 1.0,
        center: float | Sequence[float] = 0.0,
    ) -> None:
        """Check the arguments and bring them into their normal form."""
        object.__setattr__(self, "shape", _counts(shape))
        object.__setattr__(self, "spacing", _per_axis("spacing", spacing, len(self.shape)))
        object.__setattr__(self, "center", _per_axis("center", center, len(self.shape)))
        if min(self.spacing) <= 0:
            raise InputError(f"Grid: spacing is {spacing!r}, it must be positive")

    @property
    def slices(self) -> int:
        """Number of slices: nz of a volume, 1 of an image."""
        return self.shape[0] if len(self.shape) == 3 else 1

    def coordinates(self, axis: int) -> NDArray[np.float64]:
        """Coordinates of the samples along one axis (an index into ``shape``)."""
        n = self.shape[axis]
        steps = np.arange(n, dtype=np.float64) - (n - 1) / 2
        return self.center[axis] + steps * self.spacing[axis]

    def slice(self) -> Grid:
        """The grid of one slice: a volume without its z axis, an image as it is."""
        return Grid(self.shape[-2:], self.spacing[-2:], self.center[-2:])


def _counts(shape: Sequence[int]) -> tuple[int, ...]:
    numbers = real_numbers(shape)
    if numbers is None or numbers.shape not in ((2,), (3,)) or not _whole(numbers):
        raise ShapeError(f"Grid: shape is {shape!r}, wanted (ny, nx) or (nz, ny, nx), each >= 1")
    return tuple(int(n) for n in numbers)


def _whole(numbers: NDArray[np.float64]) -> bool:
    return all(number.is_integer() and number >= 1 for number in numbers.tolist())


def _per_axis(name: str, value: float | Sequence[float], axes: int) -> tuple[float, ...]:
    numbers = real_numbers(value)
    if numbers is None:
        raise InputError(f"Grid: {name} is {value!r}, wanted numbers")
    if numbers.ndim > 1 or numbers.size not in (1, axes):
        raise ShapeError(f"Grid: {name} is {value!r}, wanted one number or one for each axis")
    if not np.isfinite(numbers).all():
        raise InputError(f"Grid: {name} is {value!r}, every entry must be finite")
    return tuple(float(v) for v in np.broadcast_to(numbers, (axes,)))
