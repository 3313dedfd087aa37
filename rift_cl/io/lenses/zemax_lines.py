"""The lines of a Zemax file as words and numbers, each with its place for errors."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rift_cl.errors import FileFormatError


@dataclass
class Line:
    """The words of one line, and where it stands."""

    where: str
    words: list[str]

    def number(self, index: int) -> float:
        """The number at a place; infinity is written as INFINITY.

        Raises:
            FileFormatError: the line is too short, or there is no finite number.
        """
        if len(self.words) <= index:
            raise FileFormatError(f"{self.where}: {' '.join(self.words)!r} ends too early")
        text = self.words[index]
        if text.upper() == "INFINITY":
            return math.inf
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise FileFormatError(
                f"{self.where}: {self.words[0]} has {reprlib.repr(text)}, wanted a finite number"
            )
        return value


def zemax_lines(path: Path, content: bytes) -> Iterator[Line]:
    """The lines of a file that are not empty; its text is UTF-8, UTF-16 or a page of letters."""
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    # Some programs leave the mark out; plain letters then have a zero after each.
    unmarked = not wide and content[1:2] == b"\0"
    try:
        text = content.decode("utf-16" if wide else "utf-16-le" if unmarked else "utf-8-sig")
    except UnicodeDecodeError:
        # Comments of older files hold letters of the writer's own code page.
        text = content.decode("latin-1")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if words:
            yield Line(f"{path}: line {number}", words)
