"""Angles for scans whose files hold none: from a text beside them, or as an even turn.

Folders of projections come with their angles in a text file, or with the knowledge in somebody's
head that they were taken evenly over half a turn. What is assumed here is always told.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io.boundary import check_claim, check_numeric, reading
from rift_cl.io.scan_file import check_angles

SUFFIXES = (".txt", ".csv", ".npy")
# Eight million angles: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST = 64 << 20
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_TURN = re.compile(rf"(?:({_NUMBER}):)?({_NUMBER})")

Angles = NDArray[np.float64]


def given_angles(text: str, count: int) -> Angles | None:
    """Angles that are said outside the scan: an even turn, or a file of them.

    Args:
        text: see ``even_angles``; or the name of a file, see ``file_angles``.
        count: number of angles.

    Returns:
        The angles in radians, read-only, or None where the text names neither.

    Raises:
        InputError: a file's; see ``file_angles`` for its kinds.
    """
    angles = even_angles(text, count)
    if angles is None and text.lower().endswith(SUFFIXES):
        angles = file_angles(Path(text).absolute(), count)
    return angles


def even_angles(text: str, count: int) -> Angles | None:
    """Angles evenly over a turn, in radians; the end of the turn is not one of them.

    Args:
        text: the turn in degrees as ``start:stop``, or ``stop`` alone where it starts at 0.
        count: number of angles.

    Returns:
        The angles, read-only, or None where the text says no such thing.
    """
    match = _TURN.fullmatch(text.strip())
    if match is None:
        return None
    start, stop = float(match[1] or 0), float(match[2])
    angles: Angles = np.deg2rad(start + (stop - start) * np.arange(count) / count)
    angles.flags.writeable = False
    return angles


def file_angles(path: Path, count: int) -> Angles:
    """Read one angle in degrees for each projection.

    Args:
        path: a NumPy array (.npy), or text (.txt, .csv) of numbers that stand one to a line or
            all in one line; what follows ``#`` is a comment.
        count: number of projections.

    Returns:
        The angles in radians, read-only.

    Raises:
        InputError: there is no such file, or it is named as neither.
        FileFormatError: it holds something else.
        ShapeError: it holds more angles or fewer.
        NonFiniteError: an angle is not finite.
        ResourceLimitError: it is far longer than any list of angles.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: angles are read from {', '.join(SUFFIXES)}")
    with reading(path, "the list of angles"):
        if not path.is_file() and path.exists():
            raise InputError(f"{path}: is not a file")
        degrees = _array(path) if path.suffix.lower() == ".npy" else _text(path)
    return check_angles(path, path.name, np.deg2rad(degrees), projections=count)


def unit_note(angles: Angles) -> tuple[str, ...]:
    """A doubt, where angles that were taken for degrees look like radians."""
    span = float(np.rad2deg(np.ptp(angles)))
    if angles.size < 16 or not 0 < span < 6.3:
        return ()
    return (f"The angles span {span:.3g} degrees in all; if they are radians, convert them.",)


def _text(path: Path) -> Angles:
    check_claim(path, "the list of angles", path.stat().st_size, _LONGEST)
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    rows = [re.split(r"[\s,;]+", line.split("#")[0].strip(" \t,;")) for line in lines]
    filled = [(index, row) for index, row in enumerate(rows, 1) if row != [""]]
    for index, row in filled:
        if len(row) > 1 and len(filled) > 1:
            raise FileFormatError(
                f"{path}: line {index} holds {len(row)} numbers, wanted one angle to a line"
            )
    return np.array([_number(path, index, word) for index, row in filled for word in row])


def _number(path: Path, line: int, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise FileFormatError(
            f"{path}: line {line} holds {word[:40]!r}, wanted an angle in degrees; put # before "
            "lines that hold none"
        ) from None


def _array(path: Path) -> Angles:
    with path.open("rb") as file:
        version = npy.read_magic(file)
        if version not in ((1, 0), (2, 0)):
            raise FileFormatError(f"{path}: NPY version {version} is not known")
        header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = header(file)
        check_numeric(path, path.name, dtype)
        size = math.prod(shape)
        check_claim(path, "the list of angles", 8 * size, _LONGEST)
        if size != max(shape, default=1):
            raise ShapeError(f"{path}: has shape {shape}, wanted one angle for each projection")
        file.seek(0)
        values = npy.read_array(file, allow_pickle=False)
    return np.asarray(values, np.float64).reshape(size)
