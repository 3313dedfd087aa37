"""The binary files of a COLMAP model: little-endian records behind a count.

A count is compared with the bytes that are left before anything is made of it, and every record
has to end where the file does.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.captures.colmap_records import (
    MODEL_NAMES,
    CameraRecord,
    ImageRecord,
    PointRecords,
    parameter_count,
)

_COUNT = struct.Struct("<Q")
_CAMERA = struct.Struct("<IiQQ")
_IMAGE = struct.Struct("<I7dI")
# Number, position, colour, error, length of the track.
_POINT = struct.Struct("<Q3d3BdQ")
_FEATURE_BYTES = 24
_TRACK_BYTES = 8
_LONGEST_NAME = 4096


def read_cameras(path: Path) -> list[CameraRecord]:
    """Read cameras.bin.

    Raises:
        InputError: there is no such file.
        FileFormatError: it is damaged, or a camera model is unknown.
    """
    names = dict(enumerate(MODEL_NAMES))
    cameras = []
    with _opened(path) as file:
        for _ in range(file.count("cameras", _CAMERA.size)):
            number, model, width, height = file.take(_CAMERA)
            name = names.get(model, f"number {model}")
            count = parameter_count(f"{path}: camera {number}", name)
            parameters = file.take(struct.Struct(f"<{count}d"))
            cameras.append(CameraRecord(number, name, width, height, parameters))
    return cameras


def read_images(path: Path) -> list[ImageRecord]:
    """Read images.bin; the features found in the images are passed over.

    Raises:
        InputError: there is no such file.
        FileFormatError: it is damaged.
    """
    images = []
    with _opened(path) as file:
        for _ in range(file.count("images", _IMAGE.size)):
            values = file.take(_IMAGE)
            name = file.text()
            file.skip(_FEATURE_BYTES * file.count("features", _FEATURE_BYTES))
            images.append(ImageRecord(values[1:5], values[5:8], values[8], name))
    return images


def read_points(path: Path) -> PointRecords:
    """Read points3D.bin; the tracks are passed over.

    Raises:
        InputError: there is no such file.
        FileFormatError: it is damaged.
        ResourceLimitError: the points do not fit into memory.
    """
    with _opened(path) as file:
        count = file.count("points", _POINT.size)
        check_claim(path, "the points", count * _POINT.size, None)
        positions = np.empty((count, 3))
        colors = np.empty((count, 3), np.uint8)
        errors = np.empty(count)
        for index in range(count):
            _, x, y, z, red, green, blue, error, track = file.take(_POINT)
            positions[index] = x, y, z
            colors[index] = red, green, blue
            errors[index] = error
            file.skip(_TRACK_BYTES * track)
    return PointRecords(positions, colors, errors)


class _Records:
    """A file that is read from one end to the other, never beyond it."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path = path
        self._file = file
        self._left = os.fstat(file.fileno()).st_size

    def count(self, what: str, least: int) -> int:
        """A count of records of so many bytes at least, for which there is room in the file."""
        (count,) = self.take(_COUNT)
        if count * least > self._left:
            raise FileFormatError(
                f"{self._path}: claims {count} {what}, of which {self._left // least} have room "
                "in the rest of the file; it is damaged or cut short"
            )
        return int(count)

    def take(self, record: struct.Struct) -> tuple[Any, ...]:
        self._demand(record.size)
        return record.unpack(self._file.read(record.size))

    def skip(self, size: int) -> None:
        self._demand(size)
        self._file.seek(size, os.SEEK_CUR)

    def text(self) -> str:
        """A text that a zero ends."""
        start = self._file.tell()
        text, end, _ = self._file.read(min(_LONGEST_NAME, self._left)).partition(b"\0")
        if not end:
            raise FileFormatError(f"{self._path}: the name of an image has no end; it is damaged")
        self._left -= len(text) + 1
        self._file.seek(start + len(text) + 1)
        return text.decode("utf-8")

    def finish(self) -> None:
        if self._left:
            raise FileFormatError(
                f"{self._path}: {self._left} bytes follow the last record; it is damaged"
            )

    def _demand(self, size: int) -> None:
        if size > self._left:
            raise FileFormatError(f"{self._path}: ends within a record; it was cut short")
        self._left -= size


@contextmanager
def _opened(path: Path) -> Iterator[_Records]:
    with reading(path, "the COLMAP file"), path.open("rb") as file:
        records = _Records(path, file)
        yield records
        records.finish()
