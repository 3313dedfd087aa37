"""What SerialEM and IMOD leave beside a tilt series: tilt angles, and transforms of its sections.

Tilt angles are text, refined (.tlt) or as recorded (.rawtlt), or stand in SerialEM's metadata
(.mdoc), where a section begins with ``[ZValue = 3]`` and says ``TiltAngle = -51.0``. The transforms
that align a stack (.xf) are six numbers for each section, ``A11 A12 A21 A22 DX DY``, which IMOD's
newstack applies; rays of a view that was not shifted pass elsewhere.

Source: IMOD's documents "Image metadata files" (mdoc) and of the program newstack.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.captures.capture_paths import CaptureFolder
from rift_cl.io.number_list import is_number, text_numbers
from rift_cl.io.scans.angle_list import AngleList

_LISTS = (".tlt", ".rawtlt")
_METADATA = ".mdoc"
_TRANSFORMS = ".xf"
# Bytes of such a text at most: SerialEM writes about a kilobyte for each section.
_LONGEST = 64 << 20
_SECTION = re.compile(r"\s*\[\s*(\w+)\s*=\s*(.*?)\s*\]\s*")
_TILT = re.compile(r"\s*TiltAngle\s*=\s*(\S+)\s*")
# Numbers of a transform, and those that leave a section where it is.
_UNMOVED = np.array([1.0, 0, 0, 1, 0, 0])
# A shift of fewer pixels in all sections is none.
_LEAST = 0.05


def tilts_beside(path: Path) -> AngleList | None:
    """The tilt angles in degrees of a text beside a tilt series, the most refined; None if none.

    Raises:
        FileFormatError: the text is damaged.
        PathEscapeError: it is a link to another folder.
    """
    folder = CaptureFolder(path.parent)
    for suffix in _LISTS:
        if path.with_suffix(suffix).exists():
            sidecar = folder.file(str(path), path.with_suffix(suffix).name)
            with reading(sidecar, "the list of angles"):
                values = text_numbers(sidecar, "angles")
            return AngleList(str(sidecar), values, unit="degrees")
    found = folder.optional(str(path), path.name + _METADATA)
    tilts = None if found is None else _recorded(found)
    return None if tilts is None else AngleList(str(found), tilts, unit="degrees")


def names_of_tilts(path: Path) -> str:
    """The files that tilt angles are looked for in, for a sentence."""
    lists = ", ".join(path.stem + suffix for suffix in _LISTS)
    return f"{lists} or {path.name}{_METADATA}"


def _recorded(path: Path) -> NDArray[np.float64] | None:
    """The angles of SerialEM's metadata, by the numbers of the sections; None if it has none."""
    tilts: dict[int, float] = {}
    sections: list[int] = []
    section: int | None = None
    for line in _text(path).splitlines():
        begun, told = _SECTION.fullmatch(line), _TILT.fullmatch(line)
        if begun:
            whole = begun[1] == "ZValue" and begun[2].isdecimal()
            section = int(begun[2]) if whole else None
            sections += [] if section is None else [section]
        elif told and section is not None:
            if not is_number(told[1]):
                raise FileFormatError(
                    f"{path}: TiltAngle of section {section} is {told[1][:40]!r}, wanted degrees"
                )
            tilts[section] = float(told[1])
    if not tilts:
        return None
    if len(tilts) != len(sections):
        raise FileFormatError(
            f"{path}: has {len(sections)} sections (ZValue) and tilt angles of {len(tilts)} of "
            "them: give the angles with theta= (--theta)"
        )
    return np.array([tilts[number] for number in sorted(tilts)])


def unused_transforms(path: Path) -> tuple[str, ...]:
    """A doubt about transforms beside a stack, which are not applied; none where nothing moves."""
    found = CaptureFolder(path.parent).optional(str(path), path.stem + _TRANSFORMS)
    if found is None:
        return ()
    shifts = _shifts(_text(found))
    told = "transforms"
    if shifts is not None:
        if not np.any(shifts):
            return ()
        told = f"shifts of {np.sqrt(np.mean(shifts**2)):.2g} pixels (root mean square)"
    return (
        f"Doubt: {found.name} holds {told} that align the sections of {path.name}, and they were "
        "not applied: if the sections are as recorded, give the aligned stack (newstack -xform "
        f"{found.name}); densities are wrong where sections are apart.",
    )


def _shifts(text: str) -> NDArray[np.float64] | None:
    """Lengths of shifts in pixels about their mean, which moves the axis; 0 where sections stay.

    Returns:
        None where the text is no list of transforms, or they turn or stretch the sections.
    """
    rows = [line.split() for line in text.splitlines() if line.strip()]
    if not rows or any(len(row) != len(_UNMOVED) or not all(map(is_number, row)) for row in rows):
        return None
    moved = np.array(rows, np.float64) - _UNMOVED
    if np.abs(moved[:, :4]).max() > 1e-6:
        return None
    away = moved[:, 4:] - moved[:, 4:].mean(axis=0)
    lengths: NDArray[np.float64] = np.hypot(*away.T)
    return np.where(lengths.max() < _LEAST, 0.0, lengths)


def _text(path: Path) -> str:
    with reading(path, "the text beside the tilt series"):
        check_claim(path, "the text beside the tilt series", path.stat().st_size, _LONGEST)
        return path.read_text(encoding="utf-8-sig", errors="replace")
