"""Units of length as files name them."""

from __future__ import annotations

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
_ALIASES = {
    **{name: unit for unit, (name, _) in _LENGTHS.items()},
    **{name.replace("meter", "metre"): unit for unit, (name, _) in _LENGTHS.items()},
    "\u00b5m": "um",  # the micro sign
    "\u03bcm": "um",  # the Greek letter
    "micron": "um",
    "microns": "um",
    "\u00c5": "angstrom",  # the letter
    "\u212b": "angstrom",  # the sign
    "A": "angstrom",
    "in": "inch",
}


class LengthUnit(NamedTuple):
    """A unit of length: its name in UDUNITS, such as "millimeter", and its length in metres."""

    name: str
    metres: float


def length_unit(unit: str) -> LengthUnit | None:
    """The unit of length that a word or a sign stands for; None where it stands for none."""
    found = _LENGTHS.get(_ALIASES.get(unit.strip(), unit.strip()))
    return None if found is None else LengthUnit(*found)


def known_units() -> str:
    """The units of length by their shortest names, as a phrase."""
    return ", ".join(_LENGTHS)
