"""Where source and detector stood in every view: the form that any flat-panel scan can take.

Calibrated scanners, tilted axes, robots and laminography all end here. Pixel (i, j) of view n has
its centre at

    middle[n] + (j - (bins - 1) / 2) across[n] + (i - (rows - 1) / 2) down[n],

and the ray goes there from ``source[n]``. All vectors are (x, y, z) in the grid's coordinates.
ASTRA's ``cone_vec`` has the same twelve numbers to a view.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import real_numbers
from rift_cl.geometry.scan_value import ScanValue, checked_count

# Sines of angles below this are no angles.
_FLAT = 1e-6


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Vectors(ScanValue):
    """Source and flat detector of every view of a scan.

    Args:
        source: where the source stands, (views, 3), in the grid's unit of length.
        middle: the detector's centre, (views, 3).
        across: from a bin to the next of its row, (views, 3).
        down: from a row to the next, (views, 3).
        rows: number of detector rows.
        bins: number of bins in a row.

    Raises:
        ShapeError: an array is not (views, 3), or a count is not positive.
        InputError: a number is not finite, ``across`` and ``down`` are parallel, or the source
            lies in the plane of the detector; the sentence names the first such view.
    """

    _lengths: ClassVar[tuple[str, ...]] = ("source", "middle", "across", "down")

    source: NDArray[np.float64]
    middle: NDArray[np.float64]
    across: NDArray[np.float64]
    down: NDArray[np.float64]
    rows: int
    bins: int

    def __init__(
        self,
        source: ArrayLike,
        middle: ArrayLike,
        across: ArrayLike,
        down: ArrayLike,
        rows: int,
        bins: int,
    ) -> None:
        """Check the arguments and bring them into their normal form."""
        given = {"source": source, "middle": middle, "across": across, "down": down}
        for name, values in given.items():
            object.__setattr__(self, name, _places(name, values))
        counts = {name: len(getattr(self, name)) for name in given}
        if len(set(counts.values())) > 1:
            raise ShapeError(f"Vectors: the arrays are of different lengths: {counts}")
        object.__setattr__(self, "rows", checked_count("Vectors", "rows", rows))
        object.__setattr__(self, "bins", checked_count("Vectors", "bins", bins))
        self._check_planes()

    def corners(self) -> tuple[NDArray[np.float64], ...]:
        """Centres of the four outermost pixels, first row first, (views, 3) each."""
        across = (self.bins - 1) / 2 * self.across
        down = (self.rows - 1) / 2 * self.down
        return tuple(
            self.middle + row * down + column * across for row in (-1, 1) for column in (-1, 1)
        )

    def _check_planes(self) -> None:
        lengths = np.linalg.norm(self.across, axis=1), np.linalg.norm(self.down, axis=1)
        normal = np.cross(self.across, self.down)
        area = np.linalg.norm(normal, axis=1)
        flat = np.asarray(~(area > _FLAT * lengths[0] * lengths[1]))
        if flat.any():
            raise InputError(
                f"Vectors: across and down are parallel in view {_first(flat)}; they span the "
                "detector, from bin to bin and from row to row"
            )
        reach = self.middle - self.source
        depth = np.abs((reach * normal).sum(axis=1)) / area
        within = np.asarray(~(depth > _FLAT * np.linalg.norm(reach, axis=1)))
        if within.any():
            raise InputError(
                f"Vectors: the source lies in the plane of the detector in view {_first(within)}"
            )


def _places(name: str, values: Any) -> NDArray[np.float64]:
    numbers = real_numbers(values)
    if numbers is None:
        raise InputError(f"Vectors: {name} are no real numbers, wanted (views, 3) of them")
    if numbers.ndim != 2 or numbers.shape[1] != 3 or len(numbers) == 0:
        raise ShapeError(f"Vectors: {name} has shape {numbers.shape}, wanted (views, 3)")
    bad = ~np.isfinite(numbers).all(axis=1)
    if bad.any():
        view = _first(bad)
        raise InputError(
            f"Vectors: {name}[{view}] is {numbers[view].tolist()}, wanted finite numbers"
        )
    numbers.flags.writeable = False
    return numbers


def _first(wrong: Any) -> int:
    return int(np.flatnonzero(wrong)[0])
