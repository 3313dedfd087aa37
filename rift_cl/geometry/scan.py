"""How a target was looked at: directions and detector of a parallel-beam scan.

A ray of a parallel scan is the line ``x cos(angle) + y sin(angle) = t``. The detector measures t:
bin k has its centre at ``t = (k - center) * pitch``, so that bins grow with t and the rotation
axis is seen at the (possibly fractional) bin ``center``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.geometry.scan_value import (
    ScanValue,
    checked_angles,
    checked_center,
    checked_count,
    checked_length,
)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Parallel(ScanValue):
    """A parallel-beam scan; on a volume every slice is looked at in the same way.

    Args:
        angles: directions in radians, any order, any range; kept as a read-only float64 array.
        bins: number of detector bins in a row.
        pitch: distance between bins, in the grid's unit of length.
        center: bin at which the rotation axis is seen; ``(bins - 1) / 2`` when not given.

    Raises:
        ShapeError: ``angles`` is empty or not one-dimensional, or ``bins`` is not positive.
        InputError: an angle, the pitch or the centre is not a usable number, or the angles look
            like degrees.
    """

    _lengths: ClassVar[tuple[str, ...]] = ("pitch",)

    angles: NDArray[np.float64]
    bins: int
    pitch: float
    center: float

    def __init__(
        self, angles: ArrayLike, bins: int, pitch: float = 1.0, center: float | None = None
    ) -> None:
        """Check the arguments and bring them into their normal form."""
        object.__setattr__(self, "angles", checked_angles("Parallel", angles))
        object.__setattr__(self, "bins", checked_count("Parallel", "bins", bins))
        object.__setattr__(self, "pitch", checked_length("Parallel", "pitch", pitch))
        middle = (self.bins - 1) / 2
        object.__setattr__(self, "center", checked_center("Parallel", center, middle))

    def coordinates(self) -> NDArray[np.float64]:
        """The coordinate t of every bin's centre, in the unit of ``pitch``."""
        t: NDArray[np.float64] = (np.arange(self.bins, dtype=np.float64) - self.center) * self.pitch
        return t
