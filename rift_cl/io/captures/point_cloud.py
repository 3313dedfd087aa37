"""The sparse points of a capture, from the PLY file that its transforms.json names, and to one."""

from __future__ import annotations

from io import BufferedReader
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.captures.view import finite_points
from rift_cl.io.output import atomic_path
from rift_cl.io.scenes.ply_body import read_blocks
from rift_cl.io.scenes.ply_header import PlyHeader, read_header

_PLACE, _COLOR = ("x", "y", "z"), ("red", "green", "blue")
Floats = NDArray[np.float32]


def read_point_cloud(path: Path) -> tuple[Floats | None, Floats | None]:
    """Read positions and colours, each float32 (P, 3) or None; colours in [0, 1].

    Raises:
        InputError: there is no such file.
        FileFormatError: it is damaged, claims more than it holds, or holds no points.
        NonFiniteError: a point is not finite.
        ResourceLimitError: it does not fit into memory.
    """
    with reading(path, "the PLY file"), path.open("rb") as file:
        header = read_header(path, file)
        header.check_size(path, file.seek(0, 2))
        names = header.properties
        if not set(_PLACE) <= set(names):
            raise FileFormatError(f"{path}: its vertices have {list(names)}, wanted x, y and z")
        wanted = _PLACE + (_COLOR if set(_COLOR) <= set(names) else ())
        check_claim(path, "the PLY file", 4 * len(wanted) * header.count, None)
        columns = _read_columns(path, file, header, wanted)
        points = finite_points(str(path), columns[:, :3])
        if points is None or len(wanted) == len(_PLACE):
            return points, None
        return points, _scaled(columns[:, 3:], header)


def write_point_cloud(path: Path, points: Floats, colors: Floats | None) -> None:
    """Write a binary PLY file of positions as float32 and colours as 8-bit codes.

    Args:
        path: the file.
        points: (P, 3) in world coordinates.
        colors: (P, 3) in [0, 1], or None.

    Raises:
        OutputError: it cannot be written.
    """
    fields: list[tuple[str, str]] = [(name, "<f4") for name in _PLACE]
    columns = list(points.T)
    if colors is not None:
        fields += [(name, "u1") for name in _COLOR]
        columns += list(np.rint(colors.T * 255))
    body = np.empty(len(points), fields)
    for (name, _), column in zip(fields, columns, strict=True):
        body[name] = column
    words = {"<f4": "float", "u1": "uchar"}
    lines = [f"property {words[kind]} {name}" for name, kind in fields]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *lines]
    with atomic_path(path) as part:
        part.write_bytes("\n".join([*head, "end_header\n"]).encode() + body.tobytes())


def _read_columns(
    path: Path, file: BufferedReader, header: PlyHeader, wanted: tuple[str, ...]
) -> Floats:
    columns = np.empty((header.count, len(wanted)), np.float32)
    start = 0
    for block in read_blocks(path, file, header):
        with np.errstate(over="ignore"):
            for place, name in enumerate(wanted):
                columns[start : start + len(block), place] = block[name]
        start += len(block)
    return columns


def _scaled(colors: Floats, header: PlyHeader) -> Floats:
    """Colours from 0 to 1; whole numbers fill the range of their type."""
    kinds = [np.dtype(header.properties[name]) for name in _COLOR]
    most = np.array([np.iinfo(kind).max if kind.kind in "iu" else 1 for kind in kinds], np.float32)
    return np.asarray(np.clip(np.nan_to_num(colors) / most, 0, 1), np.float32)
