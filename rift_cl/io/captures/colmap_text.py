"""The text files of a COLMAP model: a record on a line, an image on two.

The second line of an image holds the features found in it, and is empty where there are none. Many
scripts leave it out altogether, so that the two are told apart by what they hold: an image ends in
its name, and features are numbers throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO, TypeVar

import numpy as np

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.captures.colmap_records import (
    CameraRecord,
    ImageRecord,
    PointRecords,
    parameter_count,
)
from rift_cl.io.number_list import is_number

_Number = TypeVar("_Number", int, float)
# What an image's line holds before its name, and a point's before its track.
_BEFORE_NAME = 9
_BEFORE_TRACK = 8
# Numbers of a feature, and words in the name of a file, which has 255 bytes at most.
_FEATURE, _MOST_WORDS = 3, 128
# Words in the line of a camera; no model has more.
_LONGEST_CAMERA = 32


def read_cameras(path: Path) -> list[CameraRecord]:
    """Read cameras.txt.

    Raises:
        InputError: there is no such file.
        FileFormatError: it is damaged, or a camera model is unknown.
    """
    cameras = []
    with _opened(path) as file:
        for where, line in _records(path, file):
            words = _words(where, line, 5, _LONGEST_CAMERA)
            parameters = tuple(_numbers(where, float, words[4:]))
            wanted = parameter_count(where, words[1])
            if len(parameters) != wanted:
                raise FileFormatError(
                    f"{where}: {words[1]} has {len(parameters)} parameters, wanted {wanted}"
                )
            number, width, height = _numbers(where, int, [words[0], *words[2:4]])
            cameras.append(CameraRecord(number, words[1], width, height, parameters))
    return cameras


def read_images(path: Path) -> list[ImageRecord]:
    """Read images.txt; the features found in the images are passed over.

    Raises:
        InputError: there is no such file.
        FileFormatError: it is damaged.
    """
    images = []
    with _opened(path) as file:
        after_image = False
        for where, line in _records(path, file):
            if after_image and _holds_features(where, line):
                after_image = False
                continue
            after_image = True
            words = _words(where, line, _BEFORE_NAME + 1, _BEFORE_NAME + 1)
            values = tuple(_numbers(where, float, words[1:8]))
            (camera,) = _numbers(where, int, words[8:9])
            images.append(ImageRecord(values[:4], values[4:], camera, words[9]))
    return images


def read_points(path: Path) -> PointRecords:
    """Read points3D.txt; the tracks are passed over.

    Raises:
        InputError: there is no such file.
        FileFormatError: it is damaged.
        ResourceLimitError: it does not fit into memory.
    """
    positions, colors, errors = [], [], []
    with _opened(path) as file:
        for where, line in _records(path, file):
            words = _words(where, line, _BEFORE_TRACK, _BEFORE_TRACK + 1)
            positions.append(_numbers(where, float, words[1:4]))
            colors.append(_numbers(where, int, words[4:7]))
            errors += _numbers(where, float, words[7:8])
            if not all(0 <= code <= 255 for code in colors[-1]):
                raise FileFormatError(f"{where}: the colour is {colors[-1]}, wanted 0 to 255")
    places = np.array(positions, np.float64).reshape(-1, 3)
    return PointRecords(places, colors, np.array(errors, np.float64))


@contextmanager
def _opened(path: Path) -> Iterator[TextIO]:
    with reading(path, "the COLMAP file"), path.open(encoding="utf-8") as file:
        check_claim(path, "the file", path.stat().st_size, None)
        yield file


def _records(path: Path, file: TextIO) -> Iterator[tuple[str, str]]:
    """The lines that hold something, and their places."""
    for number, line in enumerate(file, 1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield f"{path}: line {number}", line


def _holds_features(where: str, line: str) -> bool:
    """Whether the line after an image holds its features: x, y and the point's number of each.

    Raises:
        FileFormatError: it is neither that nor the line of another image.
    """
    words = line.split()
    # A name may have several words and end in a number, or be one as well. A line of features may
    # be long: what no name would reach is not looked at.
    if_name = [*words[_BEFORE_NAME:][:_MOST_WORDS], words[-1]]
    if len(words) == _BEFORE_NAME + 1 or not all(map(is_number, if_name)):
        return False
    if len(words) % _FEATURE:
        raise FileFormatError(
            f"{where}: has {len(words)} entries, wanted the features of the image above, x, y and "
            "the number of the point of each, or another image, which ends in its name"
        )
    return True


def _words(where: str, line: str, least: int, most: int) -> list[str]:
    words = line.strip().split(maxsplit=most - 1)
    if len(words) < least:
        raise FileFormatError(f"{where}: has {len(words)} entries, wanted {least} at least")
    return words


def _numbers(where: str, kind: Callable[[str], _Number], words: list[str]) -> list[_Number]:
    try:
        return [kind(word) for word in words]
    except ValueError as error:
        raise FileFormatError(f"{where}: {' '.join(words)[:80]!r} are no numbers") from error
