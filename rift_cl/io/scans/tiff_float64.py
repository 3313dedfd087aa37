"""Rows of float64 TIFF pages, which OpenImageIO 3.2 does not read reliably.

As small as it can be: strips or tiles of one sample per pixel, plain or packed by deflate. Source
of the layout: TIFF 6.0 (Adobe, 1992) and Adobe Photoshop TIFF Technical Note 3 (2005).
"""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import reading
from rift_cl.io.scans.tiff_chain import Tags, TiffChain

_WIDTH, _HEIGHT, _COMPRESSION, _ROWS_PER_STRIP, _PREDICTOR = 256, 257, 259, 278, 317
_STRIPS, _STRIP_SIZES = 273, 279
_TILE_WIDTH, _TILE_HEIGHT, _TILES, _TILE_SIZES = 322, 323, 324, 325
_PLAIN, _DEFLATE = 1, (8, 32946)
_WHOLE, _PLANES = 1, 3


class Float64Pages:
    """The pages of a TIFF file with float64 samples, whose headers were found to say so.

    Args:
        path: the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._pages: list[int] = []

    def rows(self, page: int, start: int, stop: int, size: tuple[int, int]) -> NDArray[np.float64]:
        """Read rows ``start`` to ``stop`` of a page that is known to have ``size`` (row, bin).

        Raises:
            FileFormatError: the page is damaged, or packed in another way than by deflate.
        """
        with reading(self.path, "the TIFF file"), self.path.open("rb") as file:
            chain = TiffChain(file)
            self._pages = self._pages or chain.pages()
            tags = chain.tags(self._pages[page])
            packing = tags.get(_COMPRESSION, (_PLAIN,))[0]
            predictor = tags.get(_PREDICTOR, (_WHOLE,))[0]
            if packing not in (_PLAIN, *_DEFLATE) or predictor not in (_WHOLE, _PLANES):
                raise FileFormatError(
                    f"{self.path}: float64 samples are packed by method {packing} with predictor "
                    f"{predictor}; save them plain, packed by deflate, or as float32"
                )
            if (tags[_HEIGHT][0], tags[_WIDTH][0]) != size:
                raise FileFormatError(f"{self.path}: page {page} says two things of its size")
            return _assembled(chain, tags, start, stop)


def _assembled(chain: TiffChain, tags: Tags, start: int, stop: int) -> NDArray[np.float64]:
    wide, high = tags[_WIDTH][0], tags[_HEIGHT][0]
    tiled = _TILES in tags
    step = tags[_TILE_HEIGHT][0] if tiled else min(tags.get(_ROWS_PER_STRIP, (high,))[0], high)
    across = tags[_TILE_WIDTH][0] if tiled else wide
    places = tags[_TILES if tiled else _STRIPS]
    sizes = tags[_TILE_SIZES if tiled else _STRIP_SIZES]
    rows = np.empty((stop - start, wide))
    columns = -(-wide // across)
    for band in range(start // step, -(-stop // step)):
        top, bottom = band * step, (band + 1) * step if tiled else min((band + 1) * step, high)
        for column in range(columns):
            index, left = band * columns + column, column * across
            chunk = _chunk(chain, tags, places[index], sizes[index], (bottom - top, across))
            upper, lower = max(top, start), min(bottom, stop)
            part = chunk[upper - top : lower - top, : min(across, wide - left)]
            rows[upper - start : lower - start, left : left + part.shape[1]] = part
    return rows


def _chunk(
    chain: TiffChain, tags: Tags, place: int, stored: int, shape: tuple[int, int]
) -> NDArray[np.float64]:
    """The samples of a strip or a tile."""
    high, wide = shape
    data = chain.bytes_at(place, stored)
    if tags.get(_COMPRESSION, (_PLAIN,))[0] in _DEFLATE:
        # A limit of 0 would be none.
        data = zlib.decompressobj().decompress(data, max(8 * high * wide, 1))
    order, predictor = chain.order, tags.get(_PREDICTOR, (_WHOLE,))[0]
    samples: NDArray[np.float64] = np.frombuffer(data[: 8 * high * wide], order + "f8")
    samples = samples.reshape(shape)
    if predictor == _PLANES:
        # The highest bytes of a row come first, then the second highest, and so on.
        planes = samples.view("u1").cumsum(axis=1, dtype="u1").reshape(high, 8, wide)
        samples = np.ascontiguousarray(planes.transpose(0, 2, 1)).view(">f8")[..., 0]
    return samples
