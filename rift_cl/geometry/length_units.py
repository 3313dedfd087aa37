"""Units of length as files name them."""

from __future__ import annotations

import re
from typing import NamedTuple

# Units of length: the UDUNITS name and the length in metres.
_LENGTHS = {
    "m": ("meter", 1.0),
    "cm": ("centimeter", 1e-2),
    "mm": ("millimeter", 1e-3),
    "um": ("micrometer", 1e-6),
    "nm": ("nanometer", 1e-9),
    "pm": ("picometer", 1e-12),
    "angstrom": ("angstrom", 1e-10),
    "inch": ("inch", 0.0254),
}
# Other signs, in which capitals count: mm is none of Mm, and Um is neither.
_SIGNS = {
    "\u00b5m": "um",  # the micro sign
    "\u03bcm": "um",  # the Greek letter
    "\u00c5": "angstrom",  # the letter
    "\u212b": "angstrom",  # the sign
    "A": "angstrom",
    "in": "inch",
}
# Words, in small letters, for one and for several.
_SINGULAR = {
    **{name: unit for unit, (name, _) in _LENGTHS.items()},
    **{name.replace("meter", "metre"): unit for unit, (name, _) in _LENGTHS.items()},
    "micron": "um",
}
_WORDS = {**_SINGULAR, **{f"{name}s": unit for name, unit in _SINGULAR.items()}, "inches": "inch"}
_LENGTH = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII)


class LengthUnit(NamedTuple):
    """A unit of length: its name in UDUNITS, such as "millimeter", and its length in metres."""

    name: str
    metres: float


def length_unit(unit: str) -> LengthUnit | None:
    """The unit of length that a word or a sign stands for; None where it stands for none.

    Words may be in capitals and in the plural ("Microns"); of signs, capitals are other signs.
    """
    sign = unit.strip()
    found = _LENGTHS.get(_SIGNS.get(sign, sign)) or _LENGTHS.get(_WORDS.get(sign.lower(), ""))
    return None if found is None else LengthUnit(*found)


def length_of(text: str) -> tuple[float, str] | None:
    """The number and the unit of a text such as "50 um"; None where it begins with no number.

    The unit is empty where the text has none, and may be none of length.
    """
    found = _LENGTH.fullmatch(text)
    return None if found is None else (float(found[1]), found[2])


def known_units() -> str:
    """The units of length by their shortest names, as a phrase."""
    return ", ".join(_LENGTHS)
