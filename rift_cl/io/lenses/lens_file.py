"""Lens prescriptions from files: a small JSON of our own, and Zemax's ``.zmx``.

The JSON holds one object::

    {"name": "singlet", "source": "where it was published", "unit": "mm",
     "wavelengths_um": [0.486, 0.588, 0.656], "weights": [1, 2, 1], "primary": 1,
     "entrance_pupil_diameter": 12.7,
     "surfaces": [
       {"radius": 19.93, "thickness": 7, "glass": "N-SF11", "stop": true},
       {"radius": null, "thickness": 21.48}]}

``unit`` is mm (also when absent), cm, m or in. Exactly one of ``entrance_pupil_diameter``,
``f_number`` and ``stop_diameter`` says how far the lens is open. Surfaces go from the object to
the image; an absent or null ``radius`` is a plane, an absent ``glass`` is air, the last
``thickness`` leads to the image. A glass is a name of the built-in catalogue, or an object:
``{"nd": 1.5168, "vd": 64.17}``, ``{"index": 1.5}`` or ``{"sellmeier": [B1, B2, B3, C1, C2, C3]}``.
A surface may also have ``semi_diameter``, ``conic`` and ``comment``.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rift_cl.errors import FileFormatError, InputError, ResourceLimitError
from rift_cl.io.captures.view import located
from rift_cl.io.json_fields import Fields, read_json_object
from rift_cl.io.lenses.zemax_lens import read_zemax_lens
from rift_cl.optics.glass import Glass, glass
from rift_cl.optics.lens_prescription import MOST_SURFACES, LensPrescription, Surface

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
_OPENINGS = {"entrance_pupil_diameter": "pupil", "f_number": "f_number", "stop_diameter": "stop"}
_LENS = {"name", "source", "unit", "wavelengths_um", "weights", "primary", "surfaces", *_OPENINGS}
_SURFACE = {"radius", "thickness", "glass", "conic", "semi_diameter", "stop", "comment"}
_DEFAULT_UM = 0.5875618


def open_lens(path: str | Path) -> LensPrescription:
    """Read a prescription; its name says of which kind the file is.

    Args:
        path: a ``.json`` or ``.zmx`` file.

    Returns:
        The prescription in millimetres.

    Raises:
        InputError: there is no such file, it is of another kind, or its lens cannot be one; the
            error names the surface.
        FileFormatError: the file is damaged or incomplete.
        ResourceLimitError: it has more surfaces than any lens.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind == ".zmx":
        return read_zemax_lens(path)
    if kind != ".json":
        raise InputError(
            f"{path}: a lens is read from a .json or .zmx file, this is none by its name"
        )
    return _lens(read_json_object(path), path)


def _lens(fields: Fields, path: Path) -> LensPrescription:
    _check_names(fields, _LENS)
    scale = _scale(fields)
    surfaces, stop = _surfaces(fields, scale, path)
    opening, opening_is = _opening(fields, scale)
    wavelengths = _numbers(fields, "wavelengths_um") or (_DEFAULT_UM,)
    primary = fields.number("primary") or 0.0
    if not (primary.is_integer() and 0 <= primary < len(wavelengths)):
        raise FileFormatError(
            f"{path}: 'primary' is {primary:g}, wanted which of {len(wavelengths)} wavelengths, "
            "from 0"
        )
    weights, name = _numbers(fields, "weights"), fields.text("name") or path.stem
    source = fields.text("source") or ""
    with located(str(path)):
        return LensPrescription(
            name=name,
            surfaces=surfaces,
            stop=stop,
            opening=opening,
            opening_is=opening_is,
            wavelengths=tuple(w * 1e-3 for w in wavelengths),
            weights=weights,
            primary=int(primary),
            source=source,
        )


def _surfaces(fields: Fields, scale: float, path: Path) -> tuple[tuple[Surface, ...], int]:
    """The surfaces, and which of them carries the stop."""
    surfaces, stops = [], []
    listed = fields.values.get("surfaces")
    if isinstance(listed, list) and len(listed) > MOST_SURFACES:
        raise ResourceLimitError(
            f"{path}: lists {len(listed)} surfaces, at most {MOST_SURFACES} are read"
        )
    for index, entry in enumerate(fields.objects("surfaces")):
        _check_names(entry, _SURFACE)
        surfaces.append(_surface(entry, scale))
        if entry.flag("stop"):
            stops.append(index)
    if len(stops) != 1:
        raise FileFormatError(
            f'{path}: {len(stops)} surfaces have "stop": true, wanted exactly one'
        )
    return tuple(surfaces), stops[0]


def _scale(fields: Fields) -> float:
    unit = fields.text("unit") or "mm"
    if unit not in MILLIMETRES:
        known = ", ".join(MILLIMETRES)
        raise FileFormatError(f"{fields.where}: 'unit' is {unit!r}, wanted one of {known}")
    return MILLIMETRES[unit]


def _surface(fields: Fields, scale: float) -> Surface:
    thickness = fields.number("thickness")
    if thickness is None:
        raise FileFormatError(f"{fields.where}: has no 'thickness', wanted a length")
    radius, semi = fields.number("radius"), fields.number("semi_diameter")
    medium, conic = _glass(fields), fields.number("conic") or 0.0
    with located(fields.where):
        return Surface(
            radius=math.inf if radius is None else radius * scale,
            thickness=thickness * scale,
            glass=medium,
            conic=conic,
            semi_diameter=None if semi is None else semi * scale,
        )


def _glass(fields: Fields) -> Glass | None:
    value = fields.values.get("glass")
    if value is None:
        return None
    with located(fields.where):
        if isinstance(value, str):
            return glass(value)
        if isinstance(value, Mapping):
            return _made_glass(Fields("glass", value))
    raise FileFormatError(
        f"{fields.where}: 'glass' is {reprlib.repr(value)}, wanted a name or an object"
    )


def _made_glass(fields: Fields) -> Glass:
    names = frozenset(fields.values)
    if names == {"nd", "vd"}:
        numbers = (fields.number("nd") or 0.0, fields.number("vd") or 0.0)
        return Glass("{:g}/{:g}".format(*numbers), "model", numbers)
    if names == {"index"}:
        return Glass("given", "constant", (fields.number("index") or 0.0,))
    if names == {"sellmeier"}:
        return Glass("given", "sellmeier", _numbers(fields, "sellmeier"))
    raise FileFormatError(
        f"{fields.where} has {sorted(names)}, wanted nd and vd, or index, or sellmeier"
    )


def _opening(fields: Fields, scale: float) -> tuple[float, str]:
    given = [name for name in _OPENINGS if name in fields]
    if len(given) != 1:
        raise FileFormatError(
            f"{fields.where}: has {given or 'no opening'}, wanted exactly one of "
            f"{', '.join(_OPENINGS)}"
        )
    value = fields.number(given[0]) or 0.0
    return value * (1 if given[0] == "f_number" else scale), _OPENINGS[given[0]]


def _numbers(fields: Fields, name: str) -> tuple[float, ...]:
    if name not in fields:
        return ()
    values: Any = fields.values[name]
    if not isinstance(values, list) or len(values) > MOST_SURFACES:
        raise FileFormatError(
            f"{fields.where}: {name!r} is {reprlib.repr(values)}, wanted a list of numbers"
        )
    each = Fields(fields.where, {f"{name}[{i}]": value for i, value in enumerate(values)})
    numbers = [each.number(place) for place in each.values]
    if None in numbers:
        raise FileFormatError(f"{fields.where}: {name}[{numbers.index(None)}] is null")
    return tuple(number for number in numbers if number is not None)


def _check_names(fields: Fields, known: set[str]) -> None:
    """A misspelt name must not turn a curved surface into a plane."""
    unknown = sorted(set(fields.values) - known)
    if unknown:
        raise FileFormatError(
            f"{fields.where}: has {reprlib.repr(unknown[0])}, which is not known; known are "
            f"{', '.join(sorted(known))}"
        )
