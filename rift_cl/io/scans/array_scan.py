"""A scan whose arrays are at hand: what a reader of one's own gives back."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.host_arrays import as_real_array
from rift_cl.errors import ShapeError
from rift_cl.geometry.scan_value import checked_angles
from rift_cl.io.scans.literals import Kind
from rift_cl.io.scans.scan_file import Frames, Part, Pitches, ScanFile, ScanRows, check_angles


@dataclass(frozen=True, eq=False)
class ArrayRows:
    """Reads rows of arrays (a ``RowSource``), which may be memory maps of files.

    Args:
        projections: (angle, row, bin).
        flats: (n, row, bin), or None.
        darks: (n, row, bin), or None.
    """

    projections: NDArray[np.generic]
    flats: NDArray[np.generic] | None
    darks: NDArray[np.generic] | None

    def read(self, start: int, stop: int) -> ScanRows:
        """Read rows ``start`` to ``stop``."""
        stacks = (self.projections, self.flats, self.darks)
        rows = [None if s is None else s[:, start:stop].astype(np.float32) for s in stacks]
        assert rows[0] is not None
        return ScanRows(rows[0], rows[1], rows[2])

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames."""
        found: Frames = getattr(self, part)[np.ix_(frames, rows)].astype(np.float32)
        return found


def scan_of_arrays(
    path: str | os.PathLike[str],
    projections: ArrayLike,
    angles: ArrayLike,
    *,
    flats: ArrayLike | None = None,
    darks: ArrayLike | None = None,
    kind: Kind | None = None,
    pitch: float | None = None,
    row_pitch: float | None = None,
    unit: str = "",
    notes: Sequence[str] = (),
) -> ScanFile:
    """Describe a scan whose arrays were read, or mapped, by somebody else.

    Args:
        path: the file that they come from, or any name, for sentences about them.
        projections: (angle, row, bin) real numbers; a memory map is read a few rows at a time.
        angles: (angle,) radians.
        flats: frames with the beam but without the sample, (n, row, bin).
        darks: frames without the beam, (n, row, bin).
        kind: what the values are; counts where there are flats, else attenuation, when not given.
        pitch: distance between bins in ``unit``, where it is known.
        row_pitch: that between rows, where it is another one.
        unit: unit of length; nothing without a pitch that is one.
        notes: what had to be assumed, a sentence each.

    Raises:
        ShapeError: an array has other axes, or the numbers of angles and projections differ.
        DTypeError: an array does not hold real numbers.
        NonFiniteError: an angle is NaN or infinite.
        InputError: the angles look like degrees.
    """
    path = Path(path)
    stack = _frames(path, "projections", projections, None)
    others = [
        None if given is None else _frames(path, name, given, stack.shape[1:])
        for name, given in (("flats", flats), ("darks", darks))
    ]
    directions = as_real_array(angles, name="angles").astype(np.float64).ravel()
    directions = check_angles(path, "angles", directions, projections=len(stack))
    lengths = Pitches(row_pitch, pitch, unit).usable
    return ScanFile(
        path=path,
        shape=(stack.shape[0], stack.shape[1], stack.shape[2]),
        angles=checked_angles(str(path), directions),
        pitch=lengths.bin,
        unit=lengths.unit,
        kind=kind or ("attenuation" if flats is None else "counts"),
        source=f"{path.suffix} by a registered reader",
        rows=ArrayRows(stack, *others),
        row_pitch=lengths.row,
        notes=tuple(notes),
    )


def _frames(
    path: Path, name: str, values: ArrayLike, frame: tuple[int, ...] | None
) -> NDArray[np.generic]:
    array = as_real_array(values, name=name)
    if array.ndim != 3 or 0 in array.shape or frame not in (None, array.shape[1:]):
        wanted = "(angle, row, bin)" if frame is None else f"(n, {frame[0]}, {frame[1]})"
        raise ShapeError(f"{path}: {name} has shape {array.shape}, wanted {wanted}")
    return array
