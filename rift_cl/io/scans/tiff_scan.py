"""Finds the scan in TIFF files: a folder of projections, one file with a page for each, sinograms.

TIFF says nothing of angles, flats, darks and axes: they come from names, from the number of angles,
or from the caller. What is assumed is written into the description's notes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io.number_list import SUFFIXES
from rift_cl.io.scans import angle_list
from rift_cl.io.scans.angle_list import AngleList
from rift_cl.io.scans.axes import axes_of, parsed
from rift_cl.io.scans.beam import AnyBeam
from rift_cl.io.scans.beam_file import description_in, given_beam, read_beam
from rift_cl.io.scans.contract import AIR, MEAN, Finding, scan_of
from rift_cl.io.scans.frame_words import FrameKind, words_of
from rift_cl.io.scans.scan_file import ScanFile, ScanRequest
from rift_cl.io.scans.tiff_folder import (
    folder_of,
    gap,
    grouped_names,
    inside,
    lone_series,
    projection_folder,
    sorted_kinds,
    tiff_names,
    times_of,
)
from rift_cl.io.scans.tiff_frames import TiffRows, TiffStack, tiff_stack

_SINOGRAMS = frozenset(("sino", "sinos", "sinogram", "sinograms"))
# Views that an image may be repeated for.
_MOST_REPEATED = 100_000
_ANGLE_NAMES = tuple(name + suffix for name in ("angles", "theta") for suffix in SUFFIXES)


@dataclass(frozen=True)
class _Place:
    """Where the parts of a scan lie.

    Args:
        path: the folder or file that was opened.
        files: the projections.
        folders: folders in which flats, darks and angles are looked for, the nearest first.
        beside: flats and darks among the projections' own files.
        notes: what was assumed of the files' names.
        beam: source and detector where a file tells of them; None for parallel rays.
    """

    path: Path
    files: tuple[Path, ...]
    folders: tuple[Path, ...]
    beside: dict[FrameKind, tuple[Path, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    beam: AnyBeam | None = None


def open_tiff_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan in a folder of TIFF files or in a TIFF file of many pages; see ``open_scan``.

    Raises:
        InputError: the files cannot be read, or do not make a scan.
    """
    for name in ("dataset", "image_key"):
        if getattr(request, name) is not None:
            raise InputError(
                f"{path}: {name} is {getattr(request, name)!r}, but TIFF holds no named arrays; "
                "name the folder of the projections itself, and flats and darks by --flats, --darks"
            )
    beam, told = _beam(path, request)
    place = _folder(path, beam) if path.is_dir() else _file(path)
    place = replace(place, beam=beam, notes=(*told, *place.notes))
    stack = tiff_stack(place.files)
    angles, notes = _angles(place, request.theta)
    if request.repeat is not None:
        stack, angles, notes = _repeated(place, stack, request.repeat)
    else:
        _check_complete(place, stack, request)
    stack = replace(stack, axes=_axes(place, stack, angles, request))
    flats, flats_from, of_flats = _calibration(place, "flats", request.flats, stack)
    darks, darks_from, of_darks = _calibration(place, "darks", request.darks, stack)
    if angles is None:
        angles, notes = _assumed(place, stack)
    notes = (*of_flats, *of_darks, *notes)
    frames = stack.stack
    try:
        radians, phrase, doubts = angles.settled(path, frames.frames, request.angle_unit)
    except ShapeError as error:
        raise ShapeError(f"{error}{_missing(place, stack)}") from error
    found = Finding(
        path=path,
        source=f"TIFF{flats_from}{darks_from if flats else ''}",
        name=repr(place.files[0].name),
        shape=(frames.frames, frames.rows, frames.bins),
        axes=stack.axes if frames.shape[0] > 1 else stack.axes[1:],
        dtype=np.dtype(stack.dtype),
        rows=TiffRows(path, stack, flats, darks, budget),
        angles=radians,
        angle_words=phrase,
        flats=flats.stack.frames if flats else 0,
        darks=darks.stack.frames if darks else 0,
        evidence=(place.files[0].stem,),
        flats_at=times_of(flats.files, frames.frames) if flats else None,
        notes=(*place.notes, *notes, *doubts),
        beam=beam,
    )
    return scan_of(found, request)


def _beam(path: Path, request: ScanRequest) -> tuple[AnyBeam | None, tuple[str, ...]]:
    """Source and detector as a person names them, or as a file among the frames tells."""
    found = given_beam(request, path)
    if found is not None or not path.is_dir():
        return found, ()
    described = description_in(path)
    if described is None:
        return None, ()
    return read_beam(described), (f"Source and detector are those of {described.name}.",)


def _repeated(
    place: _Place, stack: TiffStack, count: int
) -> tuple[TiffStack, AngleList | None, tuple[str, ...]]:
    """One image as so many views of a sample that looks the same from all sides."""
    images = len(stack.files) * stack.pages
    if images != 1 or not 2 <= count <= _MOST_REPEATED:
        raise InputError(
            f"{place.path}: repeat is {count} (--repeat), images found: {images}; wanted one "
            f"image, and from 2 to {_MOST_REPEATED} views"
        )
    return (
        replace(stack, files=stack.files * count),
        angle_list.even_turn("360"),
        (
            f"The one image was taken for {count} views over a full turn, as of a sample that is "
            "symmetric about the axis (--repeat).",
        ),
    )


def _check_complete(place: _Place, stack: TiffStack, request: ScanRequest) -> None:
    """Refuse a scan of which projections are missing, unless a person gives the angles."""
    named = None if place.beam is None else place.beam.views
    count = stack.stack.shape[0]
    if named is None or named == count or request.theta is not None or request.axes is not None:
        return
    remedy = "Add the missing ones" if count < named else "Take away those that are none"
    raise ShapeError(
        f"{place.path}: {named} projections are named, images found: {count}. {remedy}, or give "
        "the angles of those that are there with theta= (--theta)"
    )


def _axes(place: _Place, stack: TiffStack, angles: AngleList | None, request: ScanRequest) -> str:
    """What page, line and column are; a single page is a sinogram of one row."""
    path = place.path
    if place.beam is not None and request.axes is None and stack.stack.shape[0] > 1:
        # A scanner's images are projections, of as many rows as there happen to be.
        return "nrb"
    count = None if angles is None else angles.count
    shape = stack.stack.shape
    asked = request.axes
    single = shape[0] == 1 and (asked is None or len(parsed(asked)) < len(shape))
    name = stack.files[0].name
    if single:
        remark = "; if this one page is a single projection, it is no scan"
        return "r" + axes_of(path, name, shape[1:], count=count, asked=asked, remark=remark)
    if count is None and asked is None and words_of(stack.files[0].stem) & _SINOGRAMS:
        theta = "" if request.theta else "give the angles with theta= (--theta), and "
        raise InputError(
            f"{path}: {name!r} is named as a sinogram, and no number of angles tells its axes: "
            f"{theta}say which axis is which with axes= (--axes), such as --axes row,angle,bin for "
            "a sinogram on each page"
        )
    usual = "nrb" if count is None else None
    return axes_of(path, name, shape, count=count, asked=asked, usual=usual)


def _folder(path: Path, beam: AnyBeam | None) -> _Place:
    names = tiff_names(path)
    scan = path
    if not names:
        path = projection_folder(scan)
        names = tiff_names(path)
    names, passed_over = _of_series(names, "" if beam is None else beam.prefix)
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
    return _Place(scan, files, around, beside, (*passed_over, *_named_alike(names)))


def _of_series(names: list[str], prefix: str) -> tuple[list[str], tuple[str, ...]]:
    """The files whose names are a scanner's prefix and a number, if there are such; others."""
    numbered = re.compile(rf"{re.escape(prefix)}\D?\d+", re.IGNORECASE)
    found = [name for name in names if numbered.fullmatch(Path(name).stem)]
    if not prefix or not found or len(found) == len(names):
        return names, ()
    other = next(name for name in names if name not in found)
    return found, (
        f"{len(names) - len(found)} other images ({other!r}, ...) are no projections of "
        f"{prefix!r}.",
    )


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
) -> tuple[TiffStack | None, str, tuple[str, ...]]:
    """The flats or the darks, a phrase that says where they come from, and what is to be noted."""
    if kind == "flats" and named in (AIR, MEAN):
        return None, "", ()
    found, outside = _calibration_place(place, kind, named)
    if found is None and kind not in place.beside:
        return None, "", ()
    where = "the same folder" if found is None else str(found)
    try:
        files = place.beside[kind] if found is None else _frames_in(found)
        stack = _like(projections, tiff_stack(files), kind)
    except InputError as error:
        if not outside:
            raise
        return None, "", (f"{where}, outside the scan's folder, was passed over: {error}.",)
    notes = (f"The {kind} are those of {where}, outside the scan's folder.",) if outside else ()
    return stack, f", {kind} from {where}", notes


def _calibration_place(
    place: _Place, kind: FrameKind, named: str | None
) -> tuple[Path | None, bool]:
    """Where flats or darks lie, if not beside the projections, and whether outside and unnamed."""
    if named is not None:
        return _named(place, named), False
    if kind in place.beside:
        return None, False
    for folder in place.folders:
        outside = place.path.is_dir() and not folder.is_relative_to(place.path)
        if outside and place.beam is not None and place.beam.white is not None:
            # The scanner divided by its own flats, and tells the beam that is left.
            continue
        entry = folder_of(kind, folder)
        if entry is not None:
            return entry, outside
    return None, False


def _like(projections: TiffStack, read: TiffStack, kind: FrameKind) -> TiffStack:
    """Flats or darks with axes by which they have the projections' rows and bins."""
    wanted = projections.stack
    # Beside sinograms, flats often stand frame by frame.
    for axes in (projections.axes, "nrb"):
        stack = replace(read, axes=axes)
        if (stack.stack.rows, stack.stack.bins) == (wanted.rows, wanted.bins):
            return stack
    found = replace(read, axes=projections.axes).stack
    raise ShapeError(
        f"{read.files[0]}: the {kind} have {found.rows} x {found.bins} rows and bins, the "
        f"projections {wanted.rows} x {wanted.bins}: they must agree"
    )


def _frames_in(path: Path) -> tuple[Path, ...]:
    if not path.is_dir():
        return (path,)
    names = grouped_names(path)
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


def _angles(place: _Place, theta: str | None) -> tuple[AngleList | None, tuple[str, ...]]:
    """The angles that are named, or that lie beside the frames."""
    if theta is not None:
        turn = angle_list.even_turn(theta)
        file, column = angle_list.file_and_column(theta)
        return turn or angle_list.file_angles(_named(place, file), column), ()
    if place.beam is not None and place.beam.angles is not None:
        return place.beam.angles, ()
    for folder in place.folders:
        found = [folder / name for name in _ANGLE_NAMES if (folder / name).is_file()]
        if len(found) > 1:
            raise FileFormatError(
                f"{folder}: {found[0].name!r} and {found[1].name!r} may both hold the angles; "
                "name one with theta= (--theta)"
            )
        if found:
            (path,) = inside(folder, [found[0].name])
            return angle_list.file_angles(path), (f"The angles are those of {path}.",)
    return None, ()


def _missing(place: _Place, stack: TiffStack) -> str:
    """What the numbers of the files say of a view that is missing, as the end of a sentence."""
    after = gap([path.name for path in place.files]) if stack.axes[0] == "n" else None
    if after is None:
        return ""
    return (
        f"; the numbers of the files jump after {after!r}: if a view is missing there, take its "
        "angle out of the list"
    )


def _assumed(place: _Place, stack: TiffStack) -> tuple[AngleList, tuple[str, ...]]:
    after = gap([path.name for path in place.files]) if stack.axes[0] == "n" else None
    if after is not None:
        raise FileFormatError(
            f"{place.path}: the numbers of the files jump after {after!r}, so that no even angles "
            "can be assumed; give the angles with theta= (--theta)"
        )
    angles = angle_list.even_turn("180")
    assert angles is not None
    return angles, (
        f"No angles were found: {stack.stack.frames} projections are taken as evenly spread over "
        "180 degrees, the end left out; give others with theta= (--theta), such as "
        "0:180:endpoint where the last of them is at 180 degrees, or 0:360.",
    )
