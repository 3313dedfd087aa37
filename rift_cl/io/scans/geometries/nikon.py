"""Nikon's ``.xtekct``: the text beside the radiographs of an XT H scanner.

The signs are those that CIL reads (its ``NikonDataReader``, release 24): radiographs are stored as
they are seen from behind the detector, the first row on top, so that slices are numbered from the
top; the centre of rotation is an offset on the detector at the top and at the bottom row, in
millimetres; and the object turns so that our angles fall. A stage that stands aside
(``ObjectOffsetX``) is read as a detector shifted to the other side, which is not quite the same: it
is told where that matters. Angles in ``.ang`` or ``_ctdata.txt``
beside it are taken where there is one to each projection, else they are even.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.scans.angle_list import AngleList
from rift_cl.io.scans.beam import Beam, Floats
from rift_cl.io.scans.geometries.ini_file import IniFile

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
# A list of angles has as many lines as a scan has views.
_LARGEST = 64 << 20
# Angles that are off even steps by less than this, in steps, are worth no word.
_EVEN = 0.5
# Rays off by less than this at the ends of the rows, in bins, are worth no word.
_BEND = 0.25


def read_nikon(path: Path) -> Beam:
    """Source, detector and angles of a Nikon scan.

    Raises:
        FileFormatError: a number that is needed is missing.
    """
    file = IniFile.read(path)
    rows, bins = file.whole("DetectorPixelsY"), file.whole("DetectorPixelsX")
    pitch = (file.number("DetectorPixelSizeY"), file.number("DetectorPixelSizeX"))
    if not min(pitch) > 0:
        raise FileFormatError(f"{path}: a pixel of {min(pitch):g} is no size")
    to_axis, to_detector = file.number("SrcToObject"), file.number("SrcToDetector")
    offset, lean = _axis(file, rows * pitch[0], to_detector / max(to_axis, 1e-30))
    shift = file.number("DetectorOffsetX", 0.0)
    views = file.whole("Projections")
    angles, notes = _angles(file, views)
    tilt = file.number("ObjectTilt", 0.0)
    if tilt:
        notes.append(
            f"The tilt of the axis along the beam, {tilt:g} degrees, is not used: give vectors "
            "with geometry= (--geometry) to include it."
        )
    if file.text("ObjectOffsetX"):
        notes += _aside(
            offset,
            (-bins * pitch[1] / 2 - shift, bins * pitch[1] / 2 - shift),
            to_detector,
            pitch[1],
        )
    notes += _hardening(file)
    return Beam(
        source_to_axis=to_axis,
        source_to_detector=to_detector,
        pitch=pitch,
        unit="mm",
        offset=(file.number("DetectorOffsetY", 0.0) / pitch[0], (offset + shift) / pitch[1]),
        lean=lean,
        shape=(rows, bins),
        angles=angles,
        white=file.number("WhiteLevel", 0.0) or None,
        views=views,
        folder=file.text("InputFolderName"),
        prefix=file.text("Name"),
        notes=tuple(notes),
    )


def _aside(axis: float, ends: tuple[float, float], to_detector: float, bin_: float) -> list[str]:
    """A word where a stage that stands aside bends the rows by more than may be left out.

    Args:
        axis: where the axis is seen in a row, in millimetres from the source's foot.
        ends: of the row, likewise.
        to_detector: distance of the source from the detector, in millimetres.
        bin_: width of a bin, in millimetres.
    """
    # The foot stays where it was, so that the detector leans against the line from the source to
    # the axis. A ray to s makes an angle with that line whose tangent is
    # (s - axis) to_detector / (to_detector^2 + s axis), not (s - axis) / to_detector.
    square = to_detector * to_detector
    bend = max(abs((s - axis) * s * axis) / max(square + s * axis, 1e-30) for s in ends) / bin_
    if bend < _BEND:
        return []
    return [
        f"The axis stands aside of the beam's middle (ObjectOffsetX), which is read as a shift of "
        f"the detector: rays are up to {bend:.2g} bins off at the ends of the rows, and an axis or "
        "a tilt that is looked for goes wrong with them; give vectors with geometry= (--geometry) "
        "for exact places."
    ]


def _hardening(file: IniFile) -> list[str]:
    """A word where the scanner names a polynomial against beam hardening that does something."""
    powers = [file.number(f"CoefX{k}", 1.0 if k == 1 else 0.0) for k in range(5)]
    if powers == [0, 1, 0, 0, 0]:
        return []
    terms = " ".join(f"{power:g}" for power in powers[1:])
    return [
        f"The scanner names a polynomial against beam hardening, which is not applied: --hardening "
        f"{terms} does."
    ]


def _axis(file: IniFile, height: float, magnification: float) -> tuple[float, float]:
    """Where the axis is seen, in millimetres on the detector, and by what angle it leans there."""
    if file.text("ObjectOffsetX"):
        offset = file.number("ObjectOffsetX") * magnification
        return offset, math.radians(-file.number("ObjectRoll", 0.0))
    top, bottom = (file.number(f"CentreOfRotation{end}", 0.0) for end in ("Top", "Bottom"))
    return (top + bottom) / 2, math.atan2(bottom - top, height)


def _angles(file: IniFile, views: int) -> tuple[AngleList, list[str]]:
    """The views' angles, in our sense, and what is told of them."""
    step = file.number("AngularStep")
    even = -(file.number("InitialAngle", 0.0) + step * np.arange(views, dtype=np.float64))
    name = f"{file.path.name}, InitialAngle and AngularStep"
    beside = _listed(file.path)
    if beside is None:
        return AngleList(name, even, unit="degrees"), []
    place, listed = beside
    if len(listed) != views:
        return AngleList(name, even, unit="degrees"), [
            f"{place.name} lists {len(listed)} angles and {file.path.name} names {views} "
            "projections: its even steps are used."
        ]
    values: Floats = -listed
    off = float(np.abs((values - values[0]) - (even - even[0])).max())
    if off > _EVEN * abs(step):
        note = f"The angles are those of {place.name}, off even steps by {off:.3g} degrees at most"
        return AngleList(place.name, values, unit="degrees"), [f"{note}."]
    return AngleList(place.name, values, unit="degrees"), [f"The angles are those of {place.name}."]


def _listed(path: Path) -> tuple[Path, Floats] | None:
    """Angles in degrees in the one list beside the file, if there is one."""
    for pattern in (f"{path.stem}.ang", "*.ang", "*_ctdata.txt"):
        found = sorted(path.parent.glob(pattern))
        inside = [one for one in found if one.resolve().parent == path.parent.resolve()]
        if len(inside) == 1:
            return inside[0], _second_column(inside[0])
    return None


def _second_column(path: Path) -> Floats:
    """The second number of every line that begins with the number of a projection."""
    with reading(path, "the list of angles"):
        check_claim(path, "the list of angles", path.stat().st_size, _LARGEST)
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    found: dict[int, float] = {}
    for line in lines:
        words = [word for word in re.split(r"[\s:,;]+", line.strip()) if word]
        if len(words) > 1 and words[0].isdecimal() and _NUMBER.fullmatch(words[1]):
            found.setdefault(int(words[0]), float(words[1]))
    values = [found[number] for number in sorted(found)]
    unwrapped: Floats = np.rad2deg(np.unwrap(np.deg2rad(np.array(values, np.float64))))
    return unwrapped
