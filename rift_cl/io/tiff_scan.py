"""Finds the scan in TIFF files: a folder of projections, or one file with a page for each.

TIFF says nothing of angles, flats and darks: they come from names, or from the caller. What is
assumed is written into the description's notes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io import angle_list
from rift_cl.io.scan_file import ArrayNames, Kind, ScanFile
from rift_cl.io.tiff_folder import (
    FrameKind,
    folder_of,
    gap,
    inside,
    lone_series,
    projection_folder,
    sorted_kinds,
    tiff_names,
)
from rift_cl.io.tiff_frames import TiffRows, TiffStack, tiff_stack

_ANGLE_NAMES = tuple(
    name + suffix for name in ("angles", "theta") for suffix in angle_list.SUFFIXES
)


@dataclass(frozen=True)
class _Place:
    """Where the parts of a scan lie.

    Args:
        path: the folder or file that was opened.
        files: the projections.
        folders: folders in which flats, darks and angles are looked for, the nearest first.
        beside: flats and darks among the projections' own files.
        notes: what was assumed of the files' names.
    """

    path: Path
    files: tuple[Path, ...]
    folders: tuple[Path, ...]
    beside: dict[FrameKind, tuple[Path, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def open_tiff_scan(path: Path, names: ArrayNames, *, budget: int | None) -> ScanFile:
    """Find the scan in a folder of TIFF files or in a TIFF file of many pages; see ``open_scan``.

    Raises:
        InputError: the files cannot be read, or do not make a scan.
    """
    if names.dataset is not None:
        raise InputError(
            f"{path}: dataset is {names.dataset!r}, but TIFF holds no named arrays; name the "
            "folder of the projections itself"
        )
    place = _folder(path) if path.is_dir() else _file(path)
    projections = tiff_stack(place.files)
    flats, flats_from = _calibration(place, "flats", names.flats, projections)
    darks, darks_from = _calibration(place, "darks", names.darks, projections)
    angles, notes = _angles(place, names.theta, projections)
    notes = place.notes + notes
    kind: Kind = "transmission" if flats else "attenuation"
    if flats is None:
        notes += (_unused(projections, darks_from),)
    shape = (projections.frames, *projections.size)
    rows = TiffRows(path, projections, flats, darks if flats else None, budget)
    source = f"TIFF{flats_from}{darks_from if flats else ''}"
    return ScanFile(path, shape, angles, None, "", kind, source, rows, notes=notes)


def _unused(projections: TiffStack, darks_from: str) -> str:
    what = "counts" if projections.dtype[0] in "iu" else "numbers"
    note = f"No flats were found: the {what} are taken for line integrals as they are"
    darks = ", and the darks are not used" if darks_from else ""
    return f"{note}{darks}; name the flats with flats= (--flats)."


def _folder(path: Path) -> _Place:
    names = tiff_names(path)
    scan = path
    if not names:
        path = projection_folder(scan)
        names = tiff_names(path)
    kinds = sorted_kinds(path, names)
    if not kinds["projections"]:
        raise FileFormatError(
            f"{path}: holds flats or darks alone, by their names; name the folder of the "
            "projections"
        )
    around = (path, path.parent) if scan == path else (path, scan)
    beside: dict[FrameKind, tuple[Path, ...]] = {
        kind: inside(path, kinds[kind]) for kind in ("flats", "darks") if kinds[kind]
    }
    files = inside(path, kinds["projections"])
    return _Place(scan, files, around, beside, _named_alike(names))


def _named_alike(names: list[str]) -> tuple[str, ...]:
    if not lone_series(names):
        return ()
    return (
        f"All files are one series ({names[0]!r}, ...): they are taken for the projections, though "
        "their names hold a word for flats or darks.",
    )


def _file(path: Path) -> _Place:
    return _Place(path, (path,), (path.parent,))


def _calibration(
    place: _Place, kind: FrameKind, named: str | None, projections: TiffStack
) -> tuple[TiffStack | None, str]:
    """The flats or the darks, and a phrase that says where they come from."""
    files, where = _calibration_files(place, kind, named)
    if not files:
        return None, ""
    stack = tiff_stack(files)
    if stack.size != projections.size:
        raise ShapeError(
            f"{files[0]}: the {kind} have {stack.size[0]} x {stack.size[1]} rows and bins, the "
            f"projections {projections.size[0]} x {projections.size[1]}: they must agree"
        )
    return stack, f", {kind} from {where}"


def _calibration_files(
    place: _Place, kind: FrameKind, named: str | None
) -> tuple[tuple[Path, ...], str]:
    if named is not None:
        found = _named(place, named)
        return _frames_in(found), str(found)
    if kind in place.beside:
        return place.beside[kind], "the same folder"
    for folder in place.folders:
        entry = folder_of(kind, folder)
        if entry is not None:
            return _frames_in(entry), str(entry)
    return (), ""


def _frames_in(path: Path) -> tuple[Path, ...]:
    if not path.is_dir():
        return (path,)
    names = tiff_names(path)
    if not names:
        raise FileFormatError(f"{path}: holds no TIFF files (.tif, .tiff)")
    return inside(path, names)


def _named(place: _Place, named: str) -> Path:
    """What a person names: a path from here or from the scan."""
    paths = [Path(named).absolute(), *(folder / named for folder in place.folders)]
    for path in paths:
        if path.exists():
            return path
    looked = " or ".join(str(path) for path in paths)
    raise InputError(f"{place.path}: {named!r} is not there; it was looked for as {looked}")


def _angles(
    place: _Place, theta: str | None, projections: TiffStack
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    count = projections.frames
    if theta is not None:
        even = angle_list.even_angles(theta, count)
        if even is not None:
            return even, ()
        angles = angle_list.file_angles(_named(place, theta), count)
        return angles, angle_list.unit_note(angles)
    for folder in place.folders:
        found = [folder / name for name in _ANGLE_NAMES if (folder / name).is_file()]
        if len(found) > 1:
            raise FileFormatError(
                f"{folder}: {found[0].name!r} and {found[1].name!r} may both hold the angles; "
                "name one with theta= (--theta)"
            )
        if found:
            (path,) = inside(folder, [found[0].name])
            angles = angle_list.file_angles(path, count)
            note = f"The angles are those of {path}, in degrees."
            return angles, (note, *angle_list.unit_note(angles))
    return _assumed(place, count)


def _assumed(place: _Place, count: int) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    after = gap([path.name for path in place.files])
    if after is not None:
        raise FileFormatError(
            f"{place.path}: the numbers of the files jump after {after!r}, so that no even angles "
            "can be assumed; give the angles with theta= (--theta)"
        )
    angles = angle_list.even_angles("180", count)
    assert angles is not None
    return angles, (
        f"No angles were found: {count} projections are taken as evenly spread over 180 degrees, "
        "the end left out; give others with theta= (--theta).",
    )
