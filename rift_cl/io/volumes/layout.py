"""What is known of a volume before its first slice: shape, lengths, and how samples are stored."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry.length_units import length_unit
from rift_cl.geometry.numbers import real_numbers
from rift_cl.io.volumes.sample_window import SampleWindow

Floats = NDArray[np.float32]
# Slices that a file of parts holds together: a slab that is cut at multiples of it is written once.
PART = 16
# Takes the number of a first slice, and slices in the file's type.
WriteSlab = Callable[[int, NDArray[Any]], None]


class VolumePlace(NamedTuple):
    """Where the samples of a volume stand.

    Args:
        spacing: distance between samples along z, y and x.
        origin: position of the first sample, in the same unit.
        unit: of both; empty where it is not known.
    """

    spacing: tuple[float, float, float] = (1.0, 1.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    unit: str = ""

    @classmethod
    def of(cls, noted: Mapping[str, Any]) -> VolumePlace:
        """Read ``VolumeLayout.attributes``; what is not there or no place is left as it is here."""
        unit = noted.get("unit", "")
        place = cls(unit=unit if isinstance(unit, str) else "")
        spacing, origin = (real_numbers(noted.get(name)) for name in ("spacing", "origin"))
        if spacing is not None and spacing.shape == (3,) and _all_positive(spacing):
            place = place._replace(spacing=tuple(spacing.tolist()))
        if origin is not None and origin.shape == (3,) and np.isfinite(origin).all():
            place = place._replace(origin=tuple(origin.tolist()))
        return place


def _all_positive(numbers: NDArray[np.float64]) -> bool:
    return bool(np.isfinite(numbers).all() and (numbers > 0).all())


@dataclass(frozen=True)
class VolumeLayout:
    """What is known of a volume before its first slice.

    Args:
        shape: (z, y, x).
        spacing: distance between samples along each axis.
        unit: unit of the spacing, empty where it is not known.
        origin: position of the first sample along each axis, in the same unit.
        window: what the samples stand for where they are integers; None for float32.
        attenuation: whether the values are attenuation; others have no unit.
    """

    shape: tuple[int, int, int]
    spacing: tuple[float, float, float]
    unit: str
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    window: SampleWindow | None = None
    attenuation: bool = True

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples in the file, little-endian."""
        return np.dtype("float32" if self.window is None else self.window.dtype).newbyteorder("<")

    @property
    def size(self) -> int:
        """Bytes of the samples."""
        return self.dtype.itemsize * math.prod(self.shape)

    @property
    def attributes(self) -> dict[str, Any]:
        """The description that goes into the file."""
        return {
            "axes": ["z", "y", "x"],
            "spacing": list(self.spacing),
            "origin": list(self.origin),
            "unit": self.unit,
            "value_unit": self.value_unit,
            **({} if self.window is None else self.window.attributes),
        }

    @property
    def value_unit(self) -> str:
        """Unit of attenuation, one over the unit of length; "1" of values that have none."""
        if not self.attenuation:
            return "1"
        return f"1/{self.unit}" if self.unit else ""

    @property
    def unit_name(self) -> str | None:
        """The unit's name in UDUNITS, such as "millimeter"; None where it is no length."""
        length = length_unit(self.unit)
        return None if length is None else length[0]

    def lengths(self, metres: float) -> tuple[float, float, float] | None:
        """The spacing in a unit of so many metres; None where the unit is no length."""
        length = length_unit(self.unit)
        if length is None:
            return None
        z, y, x = (length[1] * step / metres for step in self.spacing)
        return z, y, x
