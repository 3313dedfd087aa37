"""Which files of a folder are projections, flats and darks, by their names.

Cameras number their pictures, and people name what is not a projection: ``flat_0001.tif`` among
the others, or a folder ``flats`` inside the scan's folder or beside it. What a name does not
settle is not guessed.
"""

from __future__ import annotations

import operator
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, PathEscapeError
from rift_cl.io.boundary import reading
from rift_cl.io.captures.capture_paths import CaptureFolder
from rift_cl.io.scans.frame_words import CALIBRATION, FILLERS, WORDS, FrameKind, words_of

SUFFIXES = (".tif", ".tiff")
_BEFORE, _AFTER = frozenset(("before", "pre")), frozenset(("after", "post"))
_LISTED = 4


def tiff_names(folder: Path) -> list[str]:
    """Names of the TIFF files of a folder in the order of their numbers; hidden ones are not seen.

    Raises:
        InputError: there is no such folder, or it may not be read.
    """
    with reading(folder, "the folder"):
        names = [entry.name for entry in folder.iterdir() if entry.suffix.lower() in SUFFIXES]
    return sorted((name for name in names if not name.startswith(".")), key=_natural)


def grouped_names(folder: Path) -> list[str]:
    """Names of the TIFF files of a folder; where it holds none, of those one folder deeper.

    Flats that were taken at several times often lie so, in ``flats/before`` and ``flats/after``.

    Raises:
        InputError: a folder may not be read.
    """
    names = tiff_names(folder)
    if names:
        return names
    with reading(folder, "the folder"):
        groups = [entry.name for entry in folder.iterdir() if entry.is_dir()]
    groups = sorted((name for name in groups if not name.startswith(".")), key=_natural)
    return [f"{group}/{name}" for group in groups for name in tiff_names(folder / group)]


def times_of(files: Sequence[Path], views: int) -> NDArray[np.float64] | None:
    """For each flat the views that were taken before it, where folders say before and after.

    Args:
        files: the flats, one frame each.
        views: number of projections.
    """
    said = [words_of(path.parent.name) for path in files]
    before, after = ([bool(words & each) for words in said] for each in (_BEFORE, _AFTER))
    if len({path.parent for path in files}) < 2 or any(map(operator.eq, before, after)):
        return None
    return np.where(after, float(views), 0.0)


def sorted_kinds(folder: Path, names: Iterable[str]) -> dict[FrameKind, list[str]]:
    """Sort the files of one folder into projections, flats and darks.

    Raises:
        FileFormatError: a name says two things, or the projections are named in several ways.
    """
    kinds: dict[FrameKind, list[str]] = {"projections": [], "flats": [], "darks": []}
    names = list(names)
    if lone_series(names):
        return {**kinds, "projections": names}
    for name in names:
        said = [kind for kind, words in WORDS.items() if words & words_of(Path(name).stem)]
        if len(said) > 1:
            raise FileFormatError(
                f"{folder / name}: the name says flat and dark; name the frames with flats= and "
                "darks= (--flats, --darks)"
            )
        kinds[said[0] if said else "projections"].append(name)
    series = sorted({_series(name) for name in kinds["projections"]})
    if len(series) > 1:
        listed = ", ".join(repr(one) for one in series[:_LISTED])
        more = ", ..." if len(series) > _LISTED else ""
        raise FileFormatError(
            f"{folder}: holds several series of files ({listed}{more}), and none but one can be "
            "the projections; put each into a folder of its own"
        )
    return kinds


def lone_series(names: Iterable[str]) -> bool:
    """Whether all files are one series that is named after an object such as ``dark_rock``.

    A word for flats or darks in it says nothing of the frames; ``dark_0001`` alone does.
    """
    names = list(names)
    words = words_of(Path(names[0]).stem) if names else frozenset()
    more = not words <= CALIBRATION | FILLERS
    return bool(words & CALIBRATION) and more and len({_series(name) for name in names}) == 1


def folder_of(kind: FrameKind, place: Path) -> Path | None:
    """The folder or the file inside a folder whose name says nothing but this kind of frame.

    Raises:
        FileFormatError: there are several.
        PathEscapeError: it is a link that leads out of the folder.
    """
    if not os.access(place, os.R_OK):
        return None
    with reading(place, "the folder"):
        entries = sorted(place.iterdir())
        said = [entry for entry in entries if _says(kind, entry) and os.access(entry, os.R_OK)]
        found = [e for e in said if _holds_frames(e) or (e.is_dir() and grouped_names(e))]
    if len(found) > 1:
        names = " and ".join(repr(entry.name) for entry in found[:_LISTED])
        raise FileFormatError(
            f"{place}: {names} may both hold the {kind}; name one with {kind}= (--{kind})"
        )
    if found and not found[0].resolve().is_relative_to(place.resolve()):
        raise PathEscapeError(
            f"{found[0]}: leads out of the folder {place}; name it with {kind}= (--{kind})"
        )
    return found[0] if found else None


def projection_folder(scan: Path) -> Path:
    """The one folder inside a scan's folder that holds projections.

    Raises:
        FileFormatError: there is none, or there are several.
        PathEscapeError: it is a link that leads out of the folder.
    """
    with reading(scan, "the folder"):
        entries = [entry for entry in sorted(scan.iterdir()) if entry.is_dir()]
        found = [e for e in entries if not (words_of(e.name) & CALIBRATION) and _holds_frames(e)]
    if len(found) != 1:
        listed = ", ".join(repr(entry.name) for entry in found[:_LISTED])
        which = f"several folders with some ({listed})" if found else "no folder with some"
        raise FileFormatError(
            f"{scan}: holds no TIFF files (.tif, .tiff), and {which}; name the folder of the "
            "projections"
        )
    if not found[0].resolve().is_relative_to(scan.resolve()):
        raise PathEscapeError(f"{found[0]}: leads out of the folder {scan}; name it itself")
    return found[0]


def inside(folder: Path, names: Iterable[str]) -> tuple[Path, ...]:
    """The files of these names, none of which may be a link that leads out of the folder.

    Raises:
        PathEscapeError: one is.
        InputError: one is not there.
    """
    place = CaptureFolder(folder)
    return tuple(place.file(str(folder), name) for name in names)


def gap(names: Sequence[str]) -> str | None:
    """The first file after which the numbers of a series skip one, or None."""
    numbers = [_number(name) for name in names]
    steps = np.diff([number for number in numbers if number is not None])
    if len(steps) + 1 != len(names) or not len(steps):
        return None
    odd = np.flatnonzero(steps != np.median(steps))
    return names[int(odd[0])] if odd.size else None


def _says(kind: FrameKind, entry: Path) -> bool:
    words = words_of(entry.stem if entry.suffix.lower() in SUFFIXES else entry.name)
    return bool(words & WORDS[kind]) and words <= WORDS[kind] | FILLERS


def _holds_frames(entry: Path) -> bool:
    if entry.is_dir():
        # A folder that may not be looked into is none that a scan is looked for in.
        return os.access(entry, os.R_OK) and any(
            inner.suffix.lower() in SUFFIXES for inner in entry.iterdir()
        )
    return entry.suffix.lower() in SUFFIXES


def _natural(name: str) -> tuple[list[tuple[int, str]], str]:
    parts = re.findall(r"\d+|\D+", name)
    return [(int(part), "") if part.isdecimal() else (-1, part.lower()) for part in parts], name


def _number(name: str) -> int | None:
    digits = re.findall(r"\d+", Path(name).stem)
    return int(digits[-1]) if digits else None


def _series(name: str) -> str:
    """What the names of one series share: all but the last number."""
    stem = Path(name).stem
    match = re.match(r"(.*?)\d+(\D*)$", stem, re.DOTALL)
    return f"{match[1]}#{match[2]}" if match else stem
