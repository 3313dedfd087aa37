"""TIFF pages of plain samples, without compression and one behind the other, described and read.

``tifffile`` reads the directory of the first page. It repairs what it can and only logs the rest,
such as a page whose samples are nowhere, which it takes for zeros; so the samples themselves are
read here, from where the directory says, if the file has as many.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
        place: of the first sample, in bytes from the file's beginning.
        slices: pages that ImageJ's notes name; 1 where they name none.
        step: of the values, for a step of one in the samples.
        offset: the value of a sample 0.
    """

    path: Path
    shape: tuple[int, int]
    dtype: np.dtype[Any]
    place: int
    slices: int
    step: float
    offset: float

    def samples(self, count: int) -> NDArray[Any]:
        """The samples of so many pages, (page, y, x).

        Raises:
            FileFormatError: the file is too short.
        """
        size = count * math.prod(self.shape)
        if self.place + size * self.dtype.itemsize > self.path.stat().st_size:
            raise FileFormatError(f"{self.path}: is shorter than its {count} pages")
        return np.fromfile(self.path, self.dtype, size, offset=self.place).reshape(
            count, *self.shape
        )


def plain_pages(path: Path) -> PlainPages:
    """Describe the pages of a file.

    Raises:
        FileFormatError: the first page is not plain.
        ShapeError: it has several channels.
        DTypeError: it does not hold real numbers.
    """
    with tifffile.TiffFile(path) as file:
        page: Any = file.pages.first
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
        notes = file.imagej_metadata or {}
        return PlainPages(
            path,
            (int(page.shape[0]), int(page.shape[1])),
            np.dtype(page.dtype).newbyteorder(file.byteorder),
            int(page.dataoffsets[0]),
            int(notes.get("images", 1)),
            *calibration(notes),
        )
