"""A JSON file as fields that have the type they should, or an error that names the field.

Anyone may have written the file, so its size is limited and nothing is taken on trust: a text
where a number belongs is reported with its place, not found out by the arithmetic.
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import format_bytes
from rift_cl.errors import FileFormatError, InputError, NonFiniteError, ResourceLimitError
from rift_cl.io.boundary import reading
from rift_cl.json_parsing import parse_json

# Sixty thousand frames with all their digits.
_LARGEST_FILE = 64 << 20


@dataclass(frozen=True)
class Fields:
    """One object of a JSON file; null counts as absent.

    Args:
        where: the file and the place in it, for errors.
        values: the fields.
    """

    where: str
    values: Mapping[str, Any]

    def __contains__(self, name: str) -> bool:
        return self.values.get(name) is not None

    def number(self, name: str) -> float | None:
        """A finite number, or None where the field is absent.

        Raises:
            FileFormatError: the field holds something else.
            NonFiniteError: it is NaN or infinite.
        """
        if name not in self:
            return None
        value = self.values[name]
        if not _is_number(value):
            raise self._wrong(name, "a number")
        # As a float first: NumPy looks into no integer of more than 64 bits.
        number = float(value)
        if not np.isfinite(number):
            raise NonFiniteError(f"{self.where}: {name!r} is {value}, wanted a finite number")
        return number

    def numbers(self, name: str) -> list[float] | None:
        """A list of finite numbers, or None; errors are those of ``number``."""
        if name not in self:
            return None
        values = self.values[name]
        if not (isinstance(values, list) and all(_is_number(value) for value in values)):
            raise self._wrong(name, "a list of numbers")
        numbers = [float(value) for value in values]
        if not np.isfinite(numbers).all():
            raise NonFiniteError(f"{self.where}: {name!r} is {values}, wanted finite numbers")
        return numbers

    def whole(self, name: str) -> int | None:
        """A positive whole number, or None; errors are those of ``number``."""
        value = self.number(name)
        if value is None:
            return None
        if not (value.is_integer() and value >= 1):
            raise self._wrong(name, "a positive whole number")
        return int(value)

    def flag(self, name: str) -> bool:
        """A truth value, False where the field is absent; errors are those of ``number``."""
        if name not in self:
            return False
        value = self.values[name]
        if not isinstance(value, bool):
            raise self._wrong(name, "true or false")
        return value

    def text(self, name: str) -> str | None:
        """A text, or None where the field is absent; errors are those of ``number``."""
        if name not in self:
            return None
        value = self.values[name]
        if not isinstance(value, str):
            raise self._wrong(name, "a text")
        return value

    def texts(self, name: str) -> list[str]:
        """A list of texts; errors are those of ``pose``."""
        values = self.values.get(name)
        if not (isinstance(values, list) and all(isinstance(value, str) for value in values)):
            raise self._wrong(name, "a list of texts")
        return values

    def pose(self, name: str) -> NDArray[np.float64]:
        """A rigid motion that is written as a (4, 4) or (3, 4) matrix; float64 (3, 4).

        Raises:
            FileFormatError: the field is absent or holds something else.
        """
        rows: Any = self.values.get(name)
        if not (_is_list(rows, 3, 4) and all(_is_list(row, 4) for row in rows)):
            raise self._wrong(name, "a matrix of 4 x 4 numbers")
        if not all(_is_number(entry) for row in rows for entry in row):
            raise self._wrong(name, "a matrix of 4 x 4 numbers")
        if rows[3:] not in ([], [[0, 0, 0, 1]]):
            raise self._wrong(name, "a matrix whose last row is 0, 0, 0, 1")
        return np.array(rows[:3], np.float64)

    def objects(self, name: str) -> Iterator[Fields]:
        """The objects of a list; errors are those of ``pose``."""
        values = self.values.get(name)
        if not isinstance(values, list):
            raise self._wrong(name, "a list")
        for index, value in enumerate(values):
            where = f"{self.where}: {name}[{index}]"
            if not isinstance(value, dict):
                raise FileFormatError(f"{where} is {reprlib.repr(value)}, wanted an object")
            yield Fields(where, value)

    def within(self, outer: Fields) -> Fields:
        """These fields, and those of another object that are absent here."""
        own = {name: value for name, value in self.values.items() if value is not None}
        return Fields(self.where, {**outer.values, **own})

    def _wrong(self, name: str, wanted: str) -> FileFormatError:
        if name not in self:
            return FileFormatError(f"{self.where}: has no {name!r}, wanted {wanted}")
        found = reprlib.repr(self.values[name])
        return FileFormatError(f"{self.where}: {name!r} is {found}, wanted {wanted}")


def read_json_object(path: Path) -> Fields:
    """Read a JSON file that holds one object.

    Raises:
        InputError: there is no such file.
        FileFormatError: it is no JSON, or holds something else.
        ResourceLimitError: it is larger than any file of its kind.
    """
    with reading(path, "the JSON file"):
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is not a file")
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
        if len(content) > _LARGEST_FILE:
            raise ResourceLimitError(
                f"{path}: is larger than {format_bytes(_LARGEST_FILE)}, no list of views is"
            )
        value = parse_json(content.decode("utf-8-sig"))
    if not isinstance(value, dict):
        raise FileFormatError(f"{path}: holds {reprlib.repr(value)}, wanted a JSON object")
    return Fields(str(path), value)


def _is_list(value: object, *lengths: int) -> bool:
    return isinstance(value, list) and len(value) in lengths


def _is_number(value: object) -> bool:
    if isinstance(value, float):
        return True
    # Whole numbers beyond this have no place among real ones.
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 1000
