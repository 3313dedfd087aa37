"""Cameras that can be bought, from a JSON file: one, or several to choose among.

The file holds one object, or ``{"cameras": [...]}`` with several. Lengths are in millimetres, but
for the pixel and the wavelength, which nobody counts in those::

    {"name": "full frame, 50 mm", "focal_length": 50, "f_number": 8, "pixel_um": 5.9,
     "size": [6048, 4024], "wavelength_nm": 550, "exposure": 1, "pupil_magnification": 1,
     "cost": 1, "ranges": {"f_number": [4, 22]}}

``size`` is width and height in pixels, as data sheets have it. ``lens`` may name a prescription
(see ``lens_file``) in the same folder instead of ``focal_length``, ``f_number`` and
``pupil_magnification``. ``cost`` is that of one view under a budget. ``ranges`` says what can be
set from view to view: ``focal_length``, ``f_number``, ``exposure``, and ``focus``, relative to the
target's middle.
"""

from __future__ import annotations

import dataclasses
import reprlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rift_cl.errors import FileFormatError, InputError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.io.captures.capture_paths import CaptureFolder
from rift_cl.io.captures.view import located
from rift_cl.io.json_fields import Fields, read_json_object
from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.optics.gaussian_lens import gaussian_lens
from rift_cl.optics.lens_prescription import LensPrescription

_MICRON, _NANO = 1e-3, 1e-6
_RANGES = ("focal_length", "f_number", "focus", "exposure")
_OF_LENS = ("focal_length", "f_number", "pupil_magnification")
_KNOWN = {
    "name", "focal_length", "f_number", "pixel_um", "size", "wavelength_nm", "exposure",
    "pupil_magnification", "cost", "ranges", "lens",
}  # fmt: skip


@dataclass(frozen=True)
class CameraChoice:
    """A camera that a plan may use.

    Args:
        kind: the camera, in millimetres.
        cost: of one view under a budget.
        ranges: lowest and highest of what can be set, by its name; lengths in millimetres.
    """

    kind: CameraType
    cost: float = 1.0
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)


def read_cameras(path: Path) -> tuple[CameraChoice, ...]:
    """Read the cameras of a file.

    Raises:
        InputError: there is no such file, or a number makes no camera.
        FileFormatError: it is damaged, or a field is missing or unknown.
        PathEscapeError: a lens lies outside the file's folder.
    """
    top = read_json_object(path)
    if "cameras" in top and len(top.values) > 1:
        other = sorted(set(top.values) - {"cameras"})[0]
        raise FileFormatError(f"{path}: {other!r} stands beside 'cameras', which has all of them")
    entries = list(top.objects("cameras")) if "cameras" in top else [top]
    if not entries:
        raise FileFormatError(f"{path}: 'cameras' is empty, wanted one or more")
    return tuple(_choice(entry, path) for entry in entries)


def with_lens(camera: CameraType, lens: LensPrescription) -> CameraType:
    """The same sensor behind another lens, as wide open as its prescription has it.

    Raises:
        InputError: the lens forms no real image.
    """
    found = gaussian_lens(lens)
    made = found.camera_type(camera.pixel, camera.size, exposure=camera.exposure)
    return dataclasses.replace(made, wavelength=camera.wavelength)


def _choice(entry: Fields, path: Path) -> CameraChoice:
    unknown = sorted(set(entry.values) - _KNOWN)
    if unknown:
        known = ", ".join(sorted(_KNOWN))
        raise FileFormatError(f"{entry.where}: {unknown[0]!r} is no field of a camera; {known} are")
    name = entry.text("name") or path.stem
    lens = _lens_file(entry, path)
    values: dict[str, Any] = {} if lens is not None else {
        "focal_length": _wanted(entry, "focal_length"),
        "f_number": _wanted(entry, "f_number"),
        "pupil_magnification": entry.number("pupil_magnification"),
    }  # fmt: skip
    values["exposure"] = entry.number("exposure")
    wavelength = entry.number("wavelength_nm")
    values["wavelength"] = None if wavelength is None else wavelength * _NANO
    given = {key: value for key, value in values.items() if value is not None}
    cost = entry.number("cost")
    pixel, size = _wanted(entry, "pixel_um") * _MICRON, _size(entry)
    with located(entry.where):
        if lens is None:
            kind = CameraType(name=name, pixel=pixel, size=size, **given)
        else:
            kind = _behind(lens, name, pixel, size, given)
        if cost is not None and cost < 0:
            raise InputError(f"'cost' is {cost:g}, wanted 0 or more")
    return CameraChoice(kind, 1.0 if cost is None else cost, _ranges(entry))


def _lens_file(entry: Fields, path: Path) -> Path | None:
    """The file of the lens that an entry names, in the same folder."""
    lens = entry.text("lens")
    if lens is None:
        return None
    both = [word for word in _OF_LENS if word in entry]
    if both:
        raise FileFormatError(
            f"{entry.where}: {both[0]!r} comes with a 'lens', which has its own: leave one out"
        )
    return CaptureFolder(path.parent.resolve()).file(entry.where, lens)


def _behind(
    lens: Path, name: str, pixel: float, size: tuple[int, int], given: dict[str, Any]
) -> CameraType:
    """A sensor behind the lens of a file."""
    found = gaussian_lens(open_lens(lens))
    made = found.camera_type(pixel, size, name=name, exposure=given.get("exposure", 1.0))
    return dataclasses.replace(made, wavelength=given.get("wavelength", made.wavelength))


def _size(entry: Fields) -> tuple[int, int]:
    """(height, width) of what the file says as width and height."""
    given = entry.values.get("size")
    if not (isinstance(given, list) and len(given) == 2 and all(type(n) is int for n in given)):
        raise FileFormatError(
            f"{entry.where}: 'size' is {reprlib.repr(given)}, wanted width and height in pixels"
        )
    return given[1], given[0]


def _wanted(entry: Fields, name: str) -> float:
    value = entry.number(name)
    if value is None:
        raise FileFormatError(f"{entry.where}: has no {name!r}, which a camera wants")
    return value


def _ranges(entry: Fields) -> dict[str, tuple[float, float]]:
    given = entry.values.get("ranges")
    if given is None:
        return {}
    where = f"{entry.where}: 'ranges'"
    if not isinstance(given, dict) or set(given) - set(_RANGES):
        raise FileFormatError(f"{where} is {given!r}, wanted an object with {', '.join(_RANGES)}")
    found = {}
    for name, pair in given.items():
        numbers = [
            Fields(where, {name: number}).number(name)
            for number in (pair if isinstance(pair, list) else [])
        ]
        if len(numbers) != 2 or numbers[0] is None or numbers[1] is None:
            raise FileFormatError(f"{where}: {name!r} is {pair!r}, wanted two numbers")
        found[name] = (numbers[0], numbers[1])
    return found
