"""TIFF pages of plain samples, without compression, described and read.

``tifffile`` reads the directories of the pages. It repairs what it can and only logs the rest,
such as a page whose samples are nowhere, which it takes for zeros; so the samples themselves are
read here, from where the directory says, if the file has as many.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import tifffile
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, ShapeError
from rift_cl.io.boundary import check_numeric
from rift_cl.io.volumes.imagej import calibration

# Otherwise what it logs lands on the terminal where the program has set up no logging.
logging.getLogger("tifffile").addHandler(logging.NullHandler())

_UNCOMPRESSED = 1


@dataclass(frozen=True)
class PlainPages:
    """Where the samples of a file are, and what they stand for.

    Args:
        path: the file.
        shape: (y, x) of a page.
        dtype: of a sample, with its byte order.
        places: of the pages' first samples, in bytes from the file's beginning. Those that
            ImageJ's notes name lie one behind the other, with a directory or without.
        step: of the values, for a step of one in the samples.
        offset: the value of a sample 0.
    """

    path: Path
    shape: tuple[int, int]
    dtype: np.dtype[Any]
    places: Sequence[int]
    step: float
    offset: float

    def samples(self) -> NDArray[Any]:
        """The samples of all pages, (page, y, x).

        Raises:
            FileFormatError: the file is too short.
        """
        count, size = len(self.places), math.prod(self.shape) * self.dtype.itemsize
        if max(self.places) + size > self.path.stat().st_size:
            raise FileFormatError(f"{self.path}: is shorter than its {count} pages")
        samples = np.empty((count, *self.shape), self.dtype)
        with self.path.open("rb") as file:
            for place, page in zip(self.places, samples, strict=True):
                file.seek(place)
                file.readinto(page)
        return samples


def plain_pages(path: Path) -> PlainPages:
    """Describe the pages of a file.

    Raises:
        FileFormatError: a page is not plain, or the file names other pages than it has.
        ShapeError: a page has several channels, or another shape than the first.
        DTypeError: it does not hold real numbers.
    """
    with tifffile.TiffFile(path) as file:
        first: Any = file.pages.first
        _check_plain(path, first)
        notes = file.imagej_metadata or {}
        return PlainPages(
            path,
            (int(first.shape[0]), int(first.shape[1])),
            np.dtype(first.dtype).newbyteorder(file.byteorder),
            _noted_places(path, first, notes) if "images" in notes else _places(path, file),
            *calibration(notes),
        )


def _noted_places(path: Path, first: Any, notes: Mapping[str, Any]) -> Sequence[int]:
    count, size = int(notes["images"]), first.size * first.dtype.itemsize
    if count < 1:
        raise FileFormatError(f"{path}: names {count} slices, wanted 1 or more")
    begin = int(first.dataoffsets[0])
    return range(begin, begin + count * size, size)


def _places(path: Path, file: tifffile.TiffFile) -> Sequence[int]:
    """Where the pages begin that have a directory each."""
    first: Any = file.pages.first
    places = []
    for number, page in enumerate(cast(Iterable[Any], file.pages)):
        _check_plain(path, page)
        if page.shape != first.shape or page.dtype != first.dtype:
            raise ShapeError(
                f"{path}: page {number} has {page.shape} samples of {page.dtype}, the first "
                f"{first.shape} of {first.dtype}"
            )
        places.append(int(page.dataoffsets[0]))
    # Notes of tifffile may name pages that have no directory.
    named = sum(series.size for series in file.series) if file.is_shaped else 0
    if named > len(places) * first.size:
        raise FileFormatError(
            f"{path}: names {named // first.size} pages and has directories of {len(places)}; "
            "save it with one for each page"
        )
    return places


def _check_plain(path: Path, page: Any) -> None:
    if len(page.shape) != 2 or 0 in page.shape:
        raise ShapeError(f"{path}: has shape {page.shape}, wanted one channel")
    check_numeric(path, "the page", page.dtype)
    needed = page.size * page.dtype.itemsize
    if (
        page.compression != _UNCOMPRESSED
        or page.bitspersample != 8 * page.dtype.itemsize
        or not page.dataoffsets
        or not page.is_contiguous
        or sum(page.databytecounts) != needed
    ):
        raise FileFormatError(
            f"{path}: its samples are not plain ones, without compression and without gaps; "
            "save it so in ImageJ"
        )
