"""The angles of a scan: where they come from, and whether they are degrees or radians.

Angles are arrays inside the scan's file, text beside it, or the knowledge in somebody's head that
views were taken evenly over half a turn. Their unit is what a person says, else what the file says
of them, else what their layout prescribes; and since files are wrong about it, it is held against
their span: 3.1 degrees in hundreds of steps are radians in disguise. What is assumed is told.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.boundary import reading
from rift_cl.io.number_list import SUFFIXES, read_numbers, table_numbers
from rift_cl.io.scans.frame_words import says_angles
from rift_cl.io.scans.literals import AngleUnit
from rift_cl.io.scans.scan_file import check_angles

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_TURN = re.compile(rf"(?:({_NUMBER}):)?({_NUMBER})(:endpoint)?")
# Text, which may be a table, and a column of it.
_TABLES = (".txt", ".csv")
_COLUMN = re.compile(r"(.+\.(?:txt|csv)):([^/\\:]+)", re.IGNORECASE)
# Spans up to this are radians of one turn or, in degrees, too little to reconstruct from.
_RADIANS_UP_TO = 7.0
# Two turns; what spans more counts something else, frames or steps of a motor, or many turns.
_DEGREES_UP_TO = 725.0
# Two angles tell nothing about their unit.
_TELLING = 3
# Radians between neighbouring views of a scan of several turns, at most.
_COARSE = 0.3
# How closely whole and half turns must be met, as a share.
_CLOSE = 0.01

Angles = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AngleList:
    """Angles as they are given, before their unit and their number are settled.

    Args:
        name: what they are called in a sentence.
        values: the numbers; or, of a turn that is evenly divided, its two ends in degrees.
        even: whether they are such a turn.
        endpoint: whether the end of such a turn is one of them.
        unit: their unit where a file states it, or None.
        usual: their unit by the layout of their file.
        computed: whether they follow from other numbers, so that ``unit`` is beyond doubt.
    """

    name: str
    values: Angles
    even: bool = False
    endpoint: bool = False
    unit: AngleUnit | None = None
    usual: AngleUnit = "degrees"
    computed: bool = False

    @property
    def count(self) -> int | None:
        """How many there are; None for an even turn, which has as many as there are views."""
        return None if self.even else self.values.size

    def settled(
        self, path: Path, projections: int, asked: AngleUnit | None
    ) -> tuple[Angles, str, tuple[str, ...]]:
        """The angles in radians, a phrase for the line about the file, and what was assumed.

        Args:
            path: the file of the scan.
            projections: number of views.
            asked: the unit that a person says.

        Raises:
            ShapeError: there are more angles or fewer than views.
            NonFiniteError: an angle is not finite.
            InputError: their unit is doubtful, or they are all the same.
        """
        if self.even:
            return self._turn(path, projections)
        values = check_angles(path, self.name, self.values, projections=projections)
        unit, notes = self._unit(path, asked)
        radians: Angles = np.deg2rad(values) if unit == "degrees" else values.copy()
        radians.flags.writeable = False
        check_directions(path, self.name, radians)
        span = float(np.rad2deg(np.ptp(radians)))
        over = f"{span:.4g}" if unit == "degrees" else f"{span:.4g} degrees"
        return radians, f"angles in {unit} over {over}", notes

    def _turn(self, path: Path, projections: int) -> tuple[Angles, str, tuple[str, ...]]:
        start, stop = (float(value) for value in self.values)
        degrees = np.linspace(start, stop, projections, endpoint=self.endpoint)
        radians: Angles = np.deg2rad(degrees)
        radians.flags.writeable = False
        check_directions(path, self.name, radians)
        end = "included" if self.endpoint else "left out"
        phrase = f"angles even from {start:g} to {stop:g} degrees, the end {end}"
        return radians, phrase, ()

    def _unit(self, path: Path, asked: AngleUnit | None) -> tuple[AngleUnit, tuple[str, ...]]:
        stated = self.unit or self.usual
        if self.computed:
            return stated, ()
        if asked is not None:
            return asked, ()
        other: AngleUnit = "radians" if stated == "degrees" else "degrees"
        span = float(np.ptp(self.values))
        if not _doubtful(self.values, stated):
            return stated, ()
        if self.unit is None and _half_turns(self.values, other):
            return other, (
                f"The angles {self.name!r} span {span:.4g}, which is a half or a full turn in "
                f"{other}: they are taken as {other}, not {stated} (--angle-unit).",
            )
        raise InputError(
            f"{path}: the angles {self.name!r} span {span:.4g} in {self.values.size} views, which "
            f"is doubtful for {stated}: say which unit it is with angle_unit= (--angle-unit "
            f"{other} or {stated}), or give other angles with theta= (--theta)"
        )


def _doubtful(values: Angles, unit: AngleUnit) -> bool:
    """Whether the span of angles speaks against their unit."""
    span = float(np.ptp(values))
    if values.size < _TELLING or span == 0:
        return False
    if unit == "degrees":
        return not _RADIANS_UP_TO < span < _DEGREES_UP_TO
    coarse = span / (values.size - 1) > _COARSE
    return span > _RADIANS_UP_TO and (coarse or _half_turns(values, "degrees"))


def _half_turns(values: Angles, unit: AngleUnit) -> bool:
    """Whether angles in a unit span half a turn or a whole one, their end included or left out."""
    half = 180.0 if unit == "degrees" else np.pi
    span = float(np.ptp(values))
    ends = (span, span + span / (values.size - 1))
    return any(abs(end / (turns * half) - 1) < _CLOSE for end in ends for turns in (1, 2))


def check_directions(path: Path, name: str, angles: Angles) -> None:
    """Refuse views that tell nothing of a slice.

    Args:
        path: the file of the scan.
        name: what the angles are called.
        angles: in radians.

    Raises:
        InputError: there is one view alone, or all of them have one direction.
    """
    if angles.size == 1:
        raise InputError(
            f"{path}: holds one view, and a slice wants several directions; if it is a sinogram, "
            "say which axis is which with axes= (--axes), such as --axes angle,bin"
        )
    if np.ptp(angles) == 0:
        raise InputError(
            f"{path}: all {angles.size} angles of {name!r} are {np.rad2deg(angles[0]):.4g} "
            "degrees, wanted several directions; give the angles with theta= (--theta)"
        )


def given_angles(text: str) -> AngleList | None:
    """Angles that are said outside the scan: an even turn, or a file of them.

    Args:
        text: see ``even_turn``; or the name of a file, see ``file_angles``.

    Returns:
        The angles, or None where the text names neither.

    Raises:
        InputError: a file's; see ``file_angles`` for its kinds.
    """
    turn = even_turn(text)
    place, column = file_and_column(text)
    if turn is None and place.lower().endswith(SUFFIXES):
        return file_angles(Path(place).absolute(), column)
    return turn


def file_and_column(text: str) -> tuple[str, str | None]:
    """The name of a file, and that of the column behind it: ``log.csv:angle``."""
    match = _COLUMN.fullmatch(text)
    return (text, None) if match is None else (match[1], match[2])


def even_turn(text: str) -> AngleList | None:
    """Angles evenly over a turn; its end is one of them only where the text says so.

    Args:
        text: the turn in degrees as ``start:stop``, or ``stop`` alone where it starts at 0; with
            ``:endpoint`` behind it, the end is the last angle.

    Returns:
        The angles, or None where the text says no such thing.
    """
    match = _TURN.fullmatch(text.strip())
    if match is None:
        return None
    ends = np.array([float(match[1] or 0), float(match[2])])
    return AngleList(text.strip(), ends, even=True, endpoint=match[3] is not None)


def file_angles(path: Path, column: str | None = None) -> AngleList:
    """Read angles from a file.

    Args:
        path: a NumPy array (.npy), or text (.txt, .csv) of numbers that stand one to a line, all in
            one line, or in a column of a table; what follows ``#`` is a comment.
        column: of such a table, by its name or its number from 1; the one called angle or theta if
            None.

    Raises:
        InputError: there is no such file, or it is named as neither.
        FileFormatError: it holds something else.
        ResourceLimitError: it is far longer than any list of angles.
    """
    if path.suffix.lower() not in _TABLES:
        return AngleList(str(path), read_numbers(path, "angles"), unit=named_unit(path.stem))
    with reading(path, "the list of angles"):
        if not path.is_file() and path.exists():
            raise InputError(f"{path}: is not a file")
        values, name = table_numbers(path, "angles", column, says_angles)
    return AngleList(str(path), values, unit=named_unit(name) or named_unit(path.stem))


def named_unit(name: str) -> AngleUnit | None:
    """The unit that a name such as ``anglesRad`` or ``theta_deg`` states, or None."""
    words = re.findall("[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())
    for word in words:
        if word in ("rad", "rads", "radian", "radians"):
            return "radians"
        if word in ("deg", "degs", "degree", "degrees"):
            return "degrees"
    return None


def stated_unit(path: Path, name: str, stated: str) -> AngleUnit | None:
    """The unit that a file states for an array of angles, else the one in its name.

    Args:
        path: the file.
        name: of the array.
        stated: its attribute ``units``, or nothing.

    Raises:
        FileFormatError: what is stated is no unit of angles.
    """
    stated = stated.strip().lower()
    if stated.startswith("rad"):
        return "radians"
    if stated == "°" or stated.startswith("deg"):
        return "degrees"
    if stated:
        raise FileFormatError(
            f"{path}: the units of {name!r} are {stated!r}, wanted degrees or radians; mend the "
            "attribute, or name other angles with theta= (--theta)"
        )
    return named_unit(name.rsplit("/", maxsplit=1)[-1])
