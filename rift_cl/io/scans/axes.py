"""Which axis of an array is which: as a person says, as the layout says, or by the angles' number.

Projections are stored as (angle, row, bin), sinograms as (row, angle, bin), single ones as (angle,
bin) or, by MATLAB and scikit-image, as (bin, angle). An array's shape tells these apart where one
axis alone is as long as there are angles.
"""

from __future__ import annotations

import re
from pathlib import Path

from rift_cl.errors import InputError, ShapeError

# The conventional order for arrays of two and three axes.
USUAL = {2: "nb", 3: "nrb"}
_WORDS = {"n": "angle", "r": "row", "b": "bin"}
_LETTERS = {
    **dict.fromkeys(("angle", "angles", "theta", "view", "views", "projection", "n"), "n"),
    **dict.fromkeys(("row", "rows", "y", "z", "slice", "slices", "r"), "r"),
    **dict.fromkeys(("bin", "bins", "x", "column", "columns", "detector", "b"), "b"),
}
# Sets of letters that make a scan, each sorted.
_COMPLETE = ("bn", "bnr")


def words(axes: str) -> str:
    """The axes as a person reads them."""
    return f"({', '.join(_WORDS[axis] for axis in axes)})"


def parsed(text: str) -> str:
    """The letters of axes that a person names.

    Args:
        text: names with commas, colons or blanks between them: angle, row and bin in any order, or
            angle and bin.

    Raises:
        InputError: it is anything else.
    """
    axes = spelled(text)
    if axes is None:
        raise InputError(
            f"axes is {text!r}, wanted angle, row and bin, or angle and bin, in the file's order: "
            "such as row,angle,bin or bin,angle (--axes)"
        )
    return axes


def spelled(text: str) -> str | None:
    """The letters of axes that a text names, or None where it names no such axes."""
    letters = [_LETTERS.get(word) for word in re.split(r"[\s,:;]+", text.strip().lower())]
    known = "".join(letter for letter in letters if letter)
    return known if len(known) == len(letters) and "".join(sorted(known)) in _COMPLETE else None


def axes_of(
    path: Path,
    name: str,
    shape: tuple[int, ...],
    *,
    count: int | None,
    asked: str | None,
    usual: str | None = None,
    remark: str = "",
) -> str:
    """The letters of an array's axes.

    Args:
        path: the file.
        name: the array.
        shape: its shape.
        count: number of angles, or of frames; None where it is not known.
        asked: the axes that a person named.
        usual: the letters by the definition of the file's layout.
        remark: what else the array may be, for an error.

    Raises:
        InputError: the axes that were named are none.
        ShapeError: the array has other axes, or fits its angles in more than one way, or in none.
    """
    if len(shape) not in USUAL:
        raise ShapeError(
            f"{path}: {name!r} has shape {shape}, wanted (angle, row, bin) or (angle, bin)"
        )
    if asked is not None:
        axes = parsed(asked)
        if len(axes) != len(shape):
            raise ShapeError(
                f"{path}: {name!r} has shape {shape}, and the axes {words(axes)} were named for "
                f"it: name {len(shape)} (--axes)"
            )
        return axes
    if usual and (count is None or shape[usual.index("n")] == count):
        return usual
    places = [place for place, size in enumerate(shape) if count in (None, size) and size > 1]
    if len(shape) > len(USUAL[2]) and (usual or count is None):
        # Angles come last where MATLAB wrote the file, and then their number is in it, too.
        places = [place for place in places if place < len(shape) - 1]
    readings = [reading for place in places for reading in _readings(len(shape), place)]
    if not readings:
        # The number of angles is found to be wrong for these.
        return usual or USUAL[len(shape)]
    if len(readings) > 1:
        listed = " or as ".join(words(reading) for reading in readings[:3])
        number = "" if count is None else f" with {count} angles"
        raise ShapeError(
            f"{path}: {name!r} of shape {shape}{number} can be read as {listed}: say which axis is "
            f"which with axes= (--axes), such as --axes {spoken(readings[0])}{remark}"
        )
    return readings[0]


def spoken(axes: str) -> str:
    """The axes as they are given to ``--axes``."""
    return ",".join(_WORDS[axis] for axis in axes)


def _readings(axes: int, place: int) -> tuple[str, ...]:
    """What an array may be whose angles are along the axis at this place."""
    if axes == 2:
        return ("nb", "bn")[place : place + 1]
    return (("nrb",), ("rnb",), ("rbn", "brn"))[place]
