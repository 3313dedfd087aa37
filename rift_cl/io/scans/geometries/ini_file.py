"""Scanners' text files of names and values, one ``name = value`` to a line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim, reading

# A scanner's log of a scan is some kilobytes long.
_LARGEST = 8 << 20


@dataclass(frozen=True)
class IniFile:
    """Values by name, small letters, whatever section they stand in.

    Args:
        path: the file.
        values: texts by name; the first counts where a name comes twice.
    """

    path: Path
    values: dict[str, str]

    @classmethod
    def read(cls, path: Path) -> IniFile:
        """Read a file.

        Raises:
            InputError: there is no such file.
            ResourceLimitError: it is far longer than any such file.
        """
        with reading(path, "the text"):
            check_claim(path, "the text", path.stat().st_size, _LARGEST)
            text = path.read_text(encoding="utf-8-sig", errors="replace")
        values: dict[str, str] = {}
        for line in text.splitlines():
            name, equals, value = line.partition("=")
            if equals and not line.lstrip().startswith(("#", ";", "[")):
                values.setdefault(" ".join(name.lower().split()), value.strip())
        return cls(path, values)

    def text(self, name: str) -> str:
        """A text, empty where there is none."""
        return self.values.get(name.lower(), "")

    def number(self, name: str, default: float | None = None) -> float:
        """A finite number.

        Args:
            name: its name.
            default: what it is where the file does not name it; None for one that is needed.

        Raises:
            FileFormatError: it is not there, or no number.
        """
        text = self.text(name)
        if not text and default is not None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            said = f"is {text[:40]!r}" if text else "is missing"
            raise FileFormatError(
                f"{self.path}: {name} {said}, wanted a number; mend the file, or give the geometry "
                "with geometry= (--geometry)"
            )
        return value

    def whole(self, name: str) -> int:
        """A whole number from 1; errors are those of ``number``."""
        value = self.number(name)
        if not (value.is_integer() and value >= 1):
            raise FileFormatError(f"{self.path}: {name} is {value:g}, wanted a whole number from 1")
        return int(value)
