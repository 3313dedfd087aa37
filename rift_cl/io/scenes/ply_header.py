"""The header of a PLY file: parsed, and compared with the file before anything is allocated.

A header is a few lines of text that may claim any number of records of any size. Here it is read
once, by one parser, so that what was checked is also what is used to read the body.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
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


@dataclass
class _Element:
    """An element that a header announces; ``listed`` where a record's size is its own."""

    name: str
    count: int
    properties: dict[str, str]
    listed: bool = False

    @property
    def size(self) -> int:
        """Bytes of all binary records."""
        return self.count * sum(int(kind[1]) for kind in self.properties.values())


@dataclass(frozen=True)
class PlyHeader:
    """What a PLY file says of its element ``vertex``, of scalar properties, and of where it lies.

    Args:
        order: "<" or ">" for the byte order of a binary body, empty for text.
        count: number of records.
        properties: NumPy's types without byte order, by name, as they follow each other.
        offset: bytes before the records.
        comments: without the word that begins them.
        after: bytes of other elements behind the records of a binary body; None where that is not
            known, and in a text where there are some.
    """

    order: str
    count: int
    properties: dict[str, str]
    offset: int
    comments: tuple[str, ...] = ()
    after: int | None = 0

    @property
    def record(self) -> np.dtype[np.void]:
        """The type of a binary record."""
        return np.dtype([(name, self.order + kind) for name, kind in self.properties.items()])

    def floats(self, name: str) -> bool:
        """Whether float32 holds every number of a property, as the file gives it."""
        return bool(self.order) and np.can_cast(self.properties[name], np.float32)

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
        need += self.after or 0
        exact = self.order and self.after is not None
        if need > body or (exact and need < body):
            least = "" if exact else "at least "
            raise FileFormatError(
                f"{path}: claims {self.count} records, {least}{format_bytes(need)}, but "
                f"{format_bytes(max(body, 0))} ({max(body, 0)} bytes) follow its header; it was "
                "cut off or damaged"
            )


def read_header(path: Path, file: BufferedReader) -> PlyHeader:
    """Parse the header of a file that is open at its beginning.

    Elements behind ``vertex`` are left out, and so are those before it of scalar properties in a
    binary file.

    Raises:
        FileFormatError: it is damaged, or it describes no element ``vertex`` of scalar properties
            that can be found without reading others.
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
    order, elements = _parse(path, lines)
    comments = tuple(line[8:].strip() for line in lines if line.startswith("comment "))
    place = _vertex(path, order, elements)
    vertex, behind = elements[place], elements[place + 1 :]
    before = sum(element.size for element in elements[:place])
    after: int | None = sum(element.size for element in behind)
    if any(element.count and (element.listed or not order) for element in behind):
        after = None
    offset = end + len(last) + before
    return PlyHeader(order, vertex.count, vertex.properties, offset, comments, after)


def _parse(path: Path, lines: Iterable[str]) -> tuple[str, list[_Element]]:
    """The byte order, and the elements in theirs."""
    order: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(lines, 2):
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, "1.0"] if order is None and name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, amount] if order is not None:
                elements.append(_Element(name, _counted(path, amount), {}))
            case ["property", "list", count, kind, _] if (
                elements and count in _TYPES and kind in _TYPES
            ):
                elements[-1].listed = True
            case ["property", kind, name] if elements and kind in _TYPES:
                if name in elements[-1].properties:
                    raise FileFormatError(f"{path}: has two properties {name[:_SHOWN]!r}")
                elements[-1].properties[name] = _TYPES[kind]
            case _:
                raise FileFormatError(
                    f"{path}: line {number} of its header is {line[:_SHOWN]!r}, which has no "
                    "meaning there; the file is damaged or is no PLY 1.0"
                )
    if order is None or not elements:
        raise FileFormatError(f"{path}: its header has no format or no element")
    return order, elements


def _vertex(path: Path, order: str, elements: Sequence[_Element]) -> int:
    """The number of the element ``vertex``, whose records can be found."""
    names = [element.name for element in elements]
    if "chunk" in names:
        raise FileFormatError(
            f"{path}: is a compressed PLY, which is written here and not read: convert it by "
            "'npx @playcanvas/splat-transform IN.compressed.ply OUT.ply', or in SuperSplat"
        )
    if names.count("vertex") != 1:
        shown = ", ".join(f"element {name!r}" for name in names)[:_SHOWN]
        raise FileFormatError(f"{path}: has {shown}, wanted one element 'vertex'")
    place = names.index("vertex")
    for element in elements[: place + 1]:
        if element.listed and (element.count or element.name == "vertex"):
            raise FileFormatError(
                f"{path}: its element {element.name[:_SHOWN]!r} has a list property, as meshes "
                "have; wanted plain numbers alone"
            )
    if not order and any(element.count for element in elements[:place]):
        raise FileFormatError(
            f"{path}: has an element {names[0][:_SHOWN]!r} before 'vertex', which is read of "
            "binary files alone"
        )
    return place


def _counted(path: Path, amount: str) -> int:
    if not _COUNT.fullmatch(amount):
        raise FileFormatError(f"{path}: claims {amount[:_SHOWN]!r} records; the file is damaged")
    return int(amount)
