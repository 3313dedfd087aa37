"""What was found in a file that holds a scan, and the rows that are read from it.

A scan is often larger than memory, and slices of a parallel-beam scan are independent, so that a
file is described once and then read a few detector rows at a time. A description holds no open
file: it can be sent to another process.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry import Cone, Fan, FanBeam, Parallel, Scan, Vectors
from rift_cl.geometry.leaning import leaning
from rift_cl.geometry.seen_grid import scan_lengths
from rift_cl.io.scans.literals import AngleUnit, Kind

Frames = NDArray[np.float32]
Part = Literal["projections", "flats", "darks"]
# Rows and bins whose distances differ by less than this share are as far apart.
_ALIKE = 1e-6


class Pitches(NamedTuple):
    """Sizes of a detector pixel.

    Args:
        row: distance between rows; None where it is not told.
        bin: distance between bins; None where it is not told.
        unit: of both, empty where it is not told.
    """

    row: float | None = None
    bin: float | None = None
    unit: str = ""

    @property
    def usable(self) -> Pitches:
        """The same without numbers that are no sizes; without one of bins, nothing at all."""
        bin = None if self.bin is None else usable_pitch(self.bin)
        if bin is None:
            return Pitches()
        return Pitches(None if self.row is None else usable_pitch(self.row), bin, self.unit)


@dataclass(frozen=True, eq=False)
class ScanRows:
    """Some detector rows of a scan.

    Args:
        projections: float32 (angle, row, bin).
        flats: frames with the beam but no sample, float32 (n, row, bin), or None.
        darks: frames without the beam, float32 (n, row, bin), or None.
    """

    projections: Frames
    flats: Frames | None
    darks: Frames | None


@dataclass(frozen=True, kw_only=True)
class ScanRequest:
    """What a person says about a file; None leaves it to the file's layout and values.

    Args:
        dataset: name of the projections.
        theta: name of the angles, a file of them, or a turn.
        flats: name of the frames without the sample; or "air", "mean": see ``open_scan``.
        darks: name of the frames without the beam.
        image_key: name of the array that says what each frame is.
        kind: what the values are.
        axes: names of the axes of the projections, such as "angle,row,bin".
        angle_unit: unit of the angles.
        values: whether what the values are is to be settled; ``kind`` means nothing otherwise.
        geometry: a file that says where source and detector stand: see ``open_scan``.
        reversed: the object turned the other way than the file is taken to say.
        repeat: number of views over a full turn that one image stands for; see ``open_scan``.
    """

    dataset: str | None = None
    theta: str | None = None
    flats: str | None = None
    darks: str | None = None
    image_key: str | None = None
    kind: Kind | None = None
    axes: str | None = None
    angle_unit: AngleUnit | None = None
    values: bool = True
    geometry: str | None = None
    reversed: bool = False
    repeat: int | None = None


class RowSource(Protocol):
    """Whatever reads rows from one kind of file; a value that can be pickled."""

    def read(self, start: int, stop: int) -> ScanRows:
        """Read rows ``start`` to ``stop``, which are known to exist."""

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames, (frame, row, bin), all of which are known to exist."""


@dataclass(frozen=True, eq=False, repr=False)
class ScanFile:
    """A scan in a file, known by its headers, its angles and a sample of its values.

    Args:
        path: the file, or the folder of files.
        shape: (angle, row, bin) of the projections of the sample.
        angles: direction of each projection in radians, float64, read-only.
        pitch: distance between detector bins in ``unit``; None where the file gives no positive
            number.
        unit: unit of ``pitch`` as the file names it, empty where it does not.
        kind: "counts" that want flats, darks and -log; "transmission", counts divided by those of
            the beam, which wants -log; or "attenuation", line integrals.
        source: the layout that was recognised, for people.
        rows: reads the rows.
        row_pitch: distance between detector rows in ``unit``; None where the file tells none, or no
            ``pitch``, and pixels are taken to be square.
        fan: source and detector where the rays are those of a fan beam; its lengths are in
            ``unit``, and ``pitch`` is its pitch, on the detector. None for other rays.
        cone: source and detector where the rays are those of a cone beam, of which no row is
            independent of the others; as for ``fan``. None for other rays.
        lean: of a cone's axis in the detector's plane, in radians, positive where its bin grows
            with the row; 0 where it is too little to matter. ``geometry`` includes it.
        background: bins at each end of the detector that see nothing but air: the mean line
            integral over these bins of both ends is 0 in truth, and is to be subtracted from the
            view. 0 where no such bins are known.
        notes: what the file was taken to hold, in one line, and then what had to be assumed, a
            sentence each, to be shown to the person.
        flats_at: for each flat the number of projections taken before it, float64 (n,), where the
            file tells; None where it does not.
        incident: intensity of the beam at each view, float64 (angle,), where it takes the place
            of flats; None otherwise.
    """

    path: Path
    shape: tuple[int, int, int]
    angles: NDArray[np.float64]
    pitch: float | None
    unit: str
    kind: Kind
    source: str
    rows: RowSource
    row_pitch: float | None = None
    fan: FanBeam | None = None
    cone: Cone | Vectors | None = None
    lean: float = 0.0
    background: int = 0
    notes: tuple[str, ...] = ()
    flats_at: NDArray[np.float64] | None = None
    incident: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        views, rows, bins = self.shape
        low, high = np.rad2deg([self.angles.min(), self.angles.max()])
        beam = "parallel" if self.fan is None else "fan-beam"
        beam = beam if self.cone is None else "cone-beam"
        pitch = pitch_words(self.row_pitch, self.pitch, self.unit)
        return (
            f"<ScanFile {self.path}: {views} {beam} views from {low:.4g} to {high:.4g} degrees, "
            f"{rows} rows of {bins} bins{pitch and f', {pitch}'}, {self.kind}>"
        )

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file from which rows are read, the one or the folder itself if no more is known."""
        return tuple(getattr(self.rows, "files", (self.path,)))

    @property
    def aspect(self) -> float:
        """Distance between rows over that between bins; 1 where the file does not tell."""
        if self.cone is not None:
            rows, bins = scan_lengths(self.cone).pitch
            return rows / bins
        return self.row_pitch / self.pitch if self.row_pitch and self.pitch else 1.0

    @property
    def geometry(self) -> Scan:
        """The scan as a projector takes it; a pitch that is not known counts as 1.

        The axis of parallel rays, which no file tells, is taken to be at the middle.
        """
        if isinstance(self.cone, Cone) and self.lean:
            return leaning(self.cone, self.lean)
        if self.cone is not None:
            return self.cone
        bins = self.shape[2]
        if self.fan is None:
            return Parallel(self.angles, bins, self.pitch or 1.0)
        fan = self.fan
        lengths = fan.pitch, fan.source_to_axis, fan.source_to_detector
        return Fan(self.angles, bins, *lengths, fan.center)

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop``; the file is opened for that and closed again.

        Raises:
            InputError: there are no such rows, or the file is gone.
            FileFormatError: the file is damaged, or changed since it was opened.
            ResourceLimitError: the rows are larger than the budget; nothing was allocated.
        """
        if not 0 <= start < stop <= self.shape[1]:
            raise InputError(
                f"{self.path}: rows {start} to {stop} were asked for, the scan has rows 0 to "
                f"{self.shape[1]}"
            )
        return self.rows.read(start, stop)


def check_angles(
    path: Path, name: str, angles: NDArray[np.float64], *, projections: int
) -> NDArray[np.float64]:
    """Make sure that there is one finite angle for each projection; returned read-only.

    Raises:
        ShapeError: the numbers of angles and projections differ.
        NonFiniteError: an angle is NaN or infinite.
    """
    if angles.size != projections:
        raise ShapeError(
            f"{path}: {name!r} holds {angles.size} angles for {projections} projections; name "
            "the array that belongs to them with theta= (--theta), or say which axis is which "
            "with axes= (--axes)"
        )
    bad = np.flatnonzero(~np.isfinite(angles))
    if bad.size:
        raise NonFiniteError(f"{path}: angle {bad[0]} of {name!r} is {angles[bad[0]]}")
    angles.flags.writeable = False
    return angles


def pitch_words(row: float | None, bin: float | None, unit: str) -> str:
    """A phrase about the distances between rows and between bins; empty where none is known."""
    if bin is None:
        return ""
    if row is None or math.isclose(row, bin, rel_tol=_ALIKE):
        return f"pitch {bin:.4g} {unit}".rstrip()
    return f"pitch {row:.4g} x {bin:.4g} {unit}".rstrip() + " (rows x bins)"


def usable_pitch(value: float) -> float | None:
    """A pixel size, or None where the number in the file cannot be one."""
    return value if np.isfinite(value) and value > 0 else None
