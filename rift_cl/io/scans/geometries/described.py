"""Our own file of a scan's geometry: a few lines that a person can write.

    # Lengths are in one unit, angles in degrees or radians as angle_unit says.
    projections: frames          # a folder or a file beside this one
    unit: mm
    source_to_axis: 210.66
    source_to_detector: 553.74
    pitch: [0.4, 0.4]            # of rows and of bins on the detector; or one number for both
    center: [127.5, 128.0]       # row and bin; default: the middle
    angles: 0:360                # a turn in degrees, a list, or a file; default: those of the scan

YAML, or the same as JSON. ``heights``, ``curved``, ``lean`` (degrees) and ``white`` may follow;
``geometry`` names a file of another kind (RTK's, ASTRA's vectors) in place of the lengths. Names
that are not known are refused, so that none is passed over for a slip.
"""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rift_cl.errors import FileFormatError, InputError, RiftError
from rift_cl.geometry.numbers import real_numbers
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.captures.capture_paths import CaptureFolder
from rift_cl.io.number_list import SUFFIXES
from rift_cl.io.scans.angle_list import AngleList, even_turn, file_angles
from rift_cl.io.scans.beam import AnyBeam, Beam, Floats
from rift_cl.json_parsing import parse_json

_LARGEST = 64 << 20
# Extensions of such files.
DESCRIBED = (".json", ".yaml", ".yml")
_LENGTHS = ("source_to_axis", "source_to_detector")
_NAMES = (
    *_LENGTHS,
    *("projections", "unit", "pitch", "center", "angles", "angle_unit", "heights", "curved"),
    *("lean", "white", "geometry", "magnification"),
)
# Numbers of YAML 1.2's core schema that JSON knows not; names of folders such as 007 are none.
_YAML_NUMBER = re.compile(r"[-+]?(?:\.\d+|(?:0|[1-9]\d*)(?:\.\d*)?)(?:[eE][-+]?\d+)?", re.ASCII)


def read_described(path: Path) -> AnyBeam:
    """Source and detector as our own file tells.

    Raises:
        FileFormatError: a line is none of ours, or a value is not what its name says.
        InputError: a file that it names is not there.
        PathEscapeError: that file is outside the folder.
    """
    fields = _fields(path)
    unknown = sorted(set(fields) - set(_NAMES))
    if unknown:
        raise FileFormatError(
            f"{path}: {unknown[0]!r} is not known; known are {', '.join(sorted(_NAMES))}"
        )
    pitch = _pair(path, fields, "pitch")
    unit = str(fields.get("unit") or "")
    if "geometry" in fields:
        return _elsewhere(path, fields, pitch, unit)
    to_axis, to_detector = _distances(path, fields)
    if pitch is None:
        raise FileFormatError(f"{path}: pitch is missing; a cone needs it")
    curved = fields.get("curved") or False
    if not isinstance(curved, bool):
        raise FileFormatError(f"{path}: curved is {reprlib.repr(curved)}, wanted true or false")
    return Beam(
        source_to_axis=to_axis,
        source_to_detector=to_detector,
        pitch=pitch,
        unit=unit,
        center=_pair(path, fields, "center"),
        lean=math.radians(_number(path, fields, "lean") or 0.0),
        heights=_numbers(path, fields, "heights"),
        curved=curved,
        angles=_angles(path, fields),
        white=_number(path, fields, "white"),
        folder=str(fields.get("projections") or ""),
    )


def _distances(path: Path, fields: Mapping[str, Any]) -> tuple[float, float]:
    """Of the source from the axis and from the detector: both, or one and the magnification."""
    to_axis, to_detector = (_number(path, fields, name) for name in _LENGTHS)
    times = _number(path, fields, "magnification")
    if times is not None and not 1 <= times < math.inf:
        raise FileFormatError(f"{path}: magnification is {times:g}, wanted 1 or more")
    if times is not None:
        if to_axis is None and to_detector is not None:
            to_axis = to_detector / times
        if to_detector is None and to_axis is not None:
            to_detector = to_axis * times
        if to_axis and to_detector and not math.isclose(to_detector, to_axis * times, rel_tol=0.01):
            raise FileFormatError(
                f"{path}: magnification is {times:g}, and its distances make "
                f"{to_detector / to_axis:.4g}: leave one of the three out"
            )
    if to_axis is None or to_detector is None:
        missing = _LENGTHS[0] if to_axis is None else _LENGTHS[1]
        raise FileFormatError(
            f"{path}: {missing} is missing; a cone needs it, or magnification in its place"
        )
    return to_axis, to_detector


def is_described(path: Path) -> bool:
    """Whether a file holds a scan's geometry, and not what else is written as YAML or JSON.

    It need not be without faults: ``read_described`` tells of these.
    """
    try:
        return not {*_LENGTHS, "projections", "geometry"}.isdisjoint(_fields(path))
    except RiftError:
        return False


def _elsewhere(
    path: Path, fields: Mapping[str, Any], pitch: tuple[float, float] | None, unit: str
) -> AnyBeam:
    from rift_cl.io.scans.beam_file import read_beam  # our own file is one of its kinds

    other = CaptureFolder(path.parent).file(str(path), str(fields["geometry"]))
    if other == path or other.suffix.lower() in DESCRIBED:
        raise FileFormatError(f"{path}: geometry names {other.name!r}, a file of this same kind")
    beside = sorted(set(fields) - {"geometry", "projections", "pitch", "unit"})
    if beside:
        raise FileFormatError(
            f"{path}: {beside[0]} does not go with geometry, which names a file that says "
            "everything but projections, pitch and unit"
        )
    beam = read_beam(other, pitch, unit)
    changes: dict[str, Any] = {"folder": str(fields.get("projections") or "")}
    if unit:
        changes["unit"] = unit
    return replace(beam, **changes)


def _fields(path: Path) -> dict[str, Any]:
    with reading(path, "the geometry"):
        check_claim(path, "the geometry", path.stat().st_size, _LARGEST)
        text = path.read_text(encoding="utf-8-sig")
        values = _read(text)
    if not isinstance(values, dict):
        raise FileFormatError(f"{path}: holds {type(values).__name__}, wanted names and values")
    return {str(name): value for name, value in values.items() if value is not None}


def _read(text: str) -> Any:
    """The values of YAML or JSON, whose scalars mean what they mean in JSON, and else are text.

    YAML 1.1's own rules would make seconds of ``10:50``, and no number of ``1e3``. Numbers that
    YAML 1.2 has and JSON has not (``.15``, ``+2``, ``5.``) are read as well.

    Raises:
        ValueError: it is neither.
    """
    if text.lstrip().startswith("{"):
        return parse_json(text)
    import yaml

    class Plain(yaml.BaseLoader):  # type: ignore[misc]
        """Text alone, and no value that is written once and counts often."""

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise ValueError("a value refers to another (*), which is not read here")
            return super().compose_node(parent, index)

    try:
        return _meant(yaml.load(text, Plain))
    except yaml.YAMLError as failure:
        where = getattr(failure, "problem_mark", None)
        line = "" if where is None else f"line {where.line + 1}: "
        raise ValueError(line + str(getattr(failure, "problem", None) or failure)) from failure


def _meant(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _meant(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [_meant(entry) for entry in value]
    try:
        return parse_json(value) if value else None
    except ValueError:
        return float(value) if _YAML_NUMBER.fullmatch(value) else value


def _number(path: Path, fields: Mapping[str, Any], name: str) -> float | None:
    values = _numbers(path, fields, name)
    if values is not None and values.ndim:
        raise FileFormatError(f"{path}: {name} is a list, wanted a number")
    return None if values is None else float(values)


def _numbers(path: Path, fields: Mapping[str, Any], name: str) -> Floats | None:
    value = fields.get(name)
    if value is None:
        return None
    numbers = None if isinstance(value, str | bool) else real_numbers(value)
    if numbers is None or not np.isfinite(numbers).all():
        raise FileFormatError(f"{path}: {name} is {reprlib.repr(value)}, wanted finite numbers")
    return numbers


def _pair(path: Path, fields: Mapping[str, Any], name: str) -> tuple[float, float] | None:
    values = _numbers(path, fields, name)
    if values is None:
        return None
    if values.size == 1 and name == "pitch":
        values = np.repeat(values, 2)
    if values.shape != (2,):
        raise FileFormatError(f"{path}: {name} has {values.size} numbers, wanted [row, bin]")
    return float(values[0]), float(values[1])


def _angles(path: Path, fields: Mapping[str, Any]) -> AngleList | None:
    value, unit = fields.get("angles"), fields.get("angle_unit")
    if unit not in (None, "degrees", "radians"):
        raise FileFormatError(f"{path}: angle_unit is {unit!r}, wanted degrees or radians")
    if value is None:
        return None
    if isinstance(value, str) and value.lower().endswith(SUFFIXES):
        listed = file_angles(CaptureFolder(path.parent).file(str(path), value))
        return replace(listed, unit=unit or listed.unit)
    turn = even_turn(str(value)) if isinstance(value, str | int | float) else None
    if turn is not None:
        return turn
    if isinstance(value, str):
        raise InputError(f"{path}: angles is {value!r}, wanted a turn such as 0:360, or a list")
    numbers = _numbers(path, fields, "angles")
    assert numbers is not None
    return AngleList(f"{path.name}, angles", numbers.ravel(), unit=unit)
