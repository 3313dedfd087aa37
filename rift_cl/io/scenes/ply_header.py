"""The header of a PLY file: parsed, and compared with the file before anything is allocated.

A header is a few lines of text that may claim any number of records of any size. Here it is read
once, by one parser, so that what was checked is also what is used to read the body.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

import numpy as np

from rift_cl.cl.budget import format_bytes
from rift_cl.errors import FileFormatError

_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_COUNT = re.compile(r"[0-9]{1,18}")
_LONGEST = 1 << 20
_SHOWN = 60


@dataclass(frozen=True)
class PlyHeader:
    """What a PLY file with one element, of scalar properties, says of itself.

    Args:
        order: "<" or ">" for the byte order of a binary body, empty for text.
        count: number of records.
        properties: NumPy's types without byte order, by name, as they follow each other.
        offset: bytes before the body.
        comments: without the word that begins them.
    """

    order: str
    count: int
    properties: dict[str, str]
    offset: int
    comments: tuple[str, ...] = ()

    @property
    def record(self) -> np.dtype[np.void]:
        """The type of a binary record."""
        return np.dtype([(name, self.order + kind) for name, kind in self.properties.items()])

    def check_size(self, path: Path, size: int) -> None:
        """Compare the claim with the size of the file.

        Raises:
            FileFormatError: a binary body is shorter or longer than claimed, or a text too short
                for so many numbers.
        """
        body = size - self.offset
        each = sum(int(kind[1]) for kind in self.properties.values())
        # In a text every number takes a digit and, but for the last, a space or a new line.
        need = self.count * each if self.order else self.count * 2 * len(self.properties) - 1
        if need > body or (self.order and need < body):
            least = "" if self.order else "at least "
            raise FileFormatError(
                f"{path}: claims {self.count} records, {least}{format_bytes(need)}, but "
                f"{format_bytes(body)} ({body} bytes) follow its header; it was cut off or damaged"
            )


def read_header(path: Path, file: BufferedReader) -> PlyHeader:
    """Parse the header of a file that is open at its beginning.

    Raises:
        FileFormatError: it is damaged, or it describes anything but one element ``vertex`` of
            scalar properties.
    """
    start = file.read(_LONGEST)
    # The first line shows how lines end in this header.
    first = re.match(rb"ply(\r\n|\n|\r)", start)
    newline = first[1] if first else b"\n"
    last = newline + b"end_header" + newline
    end = start.find(last)
    if first is None or end < 0:
        raise FileFormatError(f"{path}: has no PLY header; the file is damaged or something else")
    lines = start[first.end() : end].decode("latin-1").split(newline.decode())
    order, count, properties = _parse(path, lines)
    comments = tuple(line[8:].strip() for line in lines if line.startswith("comment "))
    return PlyHeader(order, count, properties, end + len(last), comments)


def _parse(path: Path, lines: Iterable[str]) -> tuple[str, int, dict[str, str]]:
    order: str | None = None
    count: int | None = None
    properties: dict[str, str] = {}
    empty = False
    for number, line in enumerate(lines, 2):
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, "1.0"] if order is None and name in _ORDERS:
                order = _ORDERS[name]
            case ["element", _, "0"] if count is not None:
                # An element without records, such as the faces of a cloud: nothing to read.
                empty = True
            case ["property", *_] if empty:
                pass
            case ["element", name, amount] if order is not None:
                _demand_vertex(path, name, first=count is None)
                count = _counted(path, amount)
            case ["property", "list", *_]:
                raise FileFormatError(
                    f"{path}: has a list property, as meshes have; wanted plain numbers alone"
                )
            case ["property", kind, name] if count is not None and kind in _TYPES:
                if name in properties:
                    raise FileFormatError(f"{path}: has two properties {name[:_SHOWN]!r}")
                properties[name] = _TYPES[kind]
            case _:
                raise FileFormatError(
                    f"{path}: line {number} of its header is {line[:_SHOWN]!r}, which has no "
                    "meaning there; the file is damaged or is no PLY 1.0"
                )
    if order is None or count is None:
        raise FileFormatError(f"{path}: its header has no format or no element")
    return order, count, properties


def _demand_vertex(path: Path, name: str, *, first: bool) -> None:
    if first and name == "vertex":
        return
    hint = "; unpack a compressed PLY first" if name == "chunk" else ""
    raise FileFormatError(
        f"{path}: has an element {name[:_SHOWN]!r}, wanted one element 'vertex' alone{hint}"
    )


def _counted(path: Path, amount: str) -> int:
    if not _COUNT.fullmatch(amount):
        raise FileFormatError(f"{path}: claims {amount[:_SHOWN]!r} records; the file is damaged")
    return int(amount)
