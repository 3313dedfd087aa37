"""How a target was looked at: directions and detector of a parallel-beam scan.

A ray of a parallel scan is the line ``x cos(angle) + y sin(angle) = t``. The detector measures t:
bin k has its centre at ``t = (k - center) * pitch``, so that bins grow with t and the rotation
axis is seen at the (possibly fractional) bin ``center``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers


@dataclass(frozen=True, init=False, eq=False)
class Parallel:
    """A parallel-beam scan; on a volume every slice is looked at in the same way.

    Args:
        angles: directions in radians, any order, any range; kept as a read-only float64 array.
        bins: number of detector bins in a row.
        pitch: distance between bins, in the grid's unit of length.
        center: bin at which the rotation axis is seen; ``(bins - 1) / 2`` when not given.

    Raises:
        ShapeError: ``angles`` is empty or not one-dimensional, or ``bins`` is not positive.
        InputError: an angle, the pitch or the centre is not a usable number.
    """

    angles: NDArray[np.float64]
    bins: int
    pitch: float
    center: float

    def __init__(
        self, angles: ArrayLike, bins: int, pitch: float = 1.0, center: float | None = None
    ) -> None:
        """Check the arguments and bring them into their normal form."""
        object.__setattr__(self, "angles", _angles(angles))
        count, length = one_number(bins), one_number(pitch)
        if not (count >= 1 and count.is_integer()):
            raise ShapeError(f"Parallel: bins is {bins!r}, wanted a positive whole number")
        object.__setattr__(self, "bins", int(count))
        if not length > 0:
            raise InputError(f"Parallel: pitch is {pitch!r}, wanted a positive length")
        object.__setattr__(self, "pitch", length)
        middle = (self.bins - 1) / 2 if center is None else one_number(center)
        if math.isnan(middle):
            raise InputError(f"Parallel: center is {center!r}, wanted a bin number")
        object.__setattr__(self, "center", middle)

    def __eq__(self, other: object) -> bool:
        """Scans are equal when every ray is."""
        return isinstance(other, Parallel) and self._key() == other._key()

    def __hash__(self) -> int:
        """Equal scans hash equally."""
        return hash(self._key())

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies are made by the constructor, so that their angles are read-only as well."""
        return Parallel, (self.angles, self.bins, self.pitch, self.center)

    def _key(self) -> tuple[bytes, int, float, float]:
        return self.angles.tobytes(), self.bins, self.pitch, self.center

    def coordinates(self) -> NDArray[np.float64]:
        """The coordinate t of every bin's centre, in the unit of ``pitch``."""
        t: NDArray[np.float64] = (np.arange(self.bins, dtype=np.float64) - self.center) * self.pitch
        return t


def _angles(angles: ArrayLike) -> NDArray[np.float64]:
    values = real_numbers(angles)
    if values is None:
        raise InputError(f"Parallel: angles is {angles!r}, wanted real numbers, in radians")
    if values.ndim != 1:
        raise ShapeError(f"Parallel: angles has shape {values.shape}, wanted one dimension")
    if values.size == 0:
        raise ShapeError("Parallel: angles is empty; a scan needs at least one direction")
    if not np.isfinite(values).all():
        index = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InputError(f"Parallel: angles[{index}] is {values[index]}, wanted a finite number")
    values.flags.writeable = False
    return values
