"""Frames in TIFF files: described by their headers, read later, a few rows at a time.

OpenImageIO decodes them, in the type they are stored in, since it scales integers that it turns
into real numbers. Release 3.2 leaves float64 pixels uninitialised wherever less than two whole
strips are read, and says nothing; those alone are read by ``tiff_float64``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import DTypeError, FileFormatError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.images.image_format import image_format
from rift_cl.io.images.pixels import first_line, opened_image
from rift_cl.io.scans.frame_stack import FrameStack
from rift_cl.io.scans.scan_file import Frames, Part, ScanRows
from rift_cl.io.scans.tiff_chain import TiffChain
from rift_cl.io.scans.tiff_float64 import Float64Pages

_DTYPES = {
    "uint8": "u1",
    "int8": "i1",
    "uint16": "u2",
    "int16": "i2",
    "uint": "u4",
    "int": "i4",
    "half": "f2",
    "float": "f4",
    "double": "f8",
}
# What libtiff says of a compression that it was built without, after its name.
_NOT_CONFIGURED = " compression support is not configured"


@dataclass(frozen=True)
class TiffStack:
    """Frames of one kind: a page of each of several files, or every page of one.

    Args:
        files: the files in order.
        pages: pages of the file if it is the only one, else 1.
        size: (line, column) of every page.
        dtype: type of a sample as it is stored.
        axes: what page, line and column are, a letter each: n frame, r row, b bin.
    """

    files: tuple[Path, ...]
    pages: int
    size: tuple[int, int]
    dtype: str
    axes: str = "nrb"

    @property
    def stack(self) -> FrameStack:
        """The pages as one array."""
        stack = FrameStack("", (len(self.files) * self.pages, *self.size), self.axes, ())
        return replace(stack, runs=((0, stack.size("n")),))


@dataclass(frozen=True)
class TiffRows:
    """Reads rows of a scan in TIFF files (a ``RowSource``).

    Args:
        path: the folder or file that was opened, for errors.
        projections: the projections.
        flats: the frames without the sample, if there are any.
        darks: the frames without the beam, if there are any.
        budget: bytes that one reading may take; 60 % of the free memory when None.
    """

    path: Path
    projections: TiffStack
    flats: TiffStack | None
    darks: TiffStack | None
    budget: int | None

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that is read: of the projections, then the flats, then the darks."""
        stacks = (self.projections, self.flats, self.darks)
        return tuple(path for stack in stacks if stack for path in stack.files)

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        stacks = [stack for stack in (self.projections, self.flats, self.darks) if stack]
        need = sum(_need(stack, start, stop) for stack in stacks)
        check_claim(self.path, f"rows {start} to {stop} of the scan", need, self.budget)
        left = None if self.budget is None else self.budget - need
        return ScanRows(
            _read(self.projections, start, stop, left),
            _read(self.flats, start, stop, left) if self.flats else None,
            _read(self.darks, start, stop, left) if self.darks else None,
        )

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames of one stack, line by line."""
        stack: TiffStack = getattr(self, part)
        sizes = dict(zip(stack.axes, stack.stack.shape, strict=True))
        chosen = {"n": list(frames), "r": list(rows), "b": list(range(sizes["b"]))}
        pages, lines, columns = (chosen[axis] for axis in stack.axes)
        spans = [(0, stack.size[0])] if stack.axes[1] == "b" else [(i, i + 1) for i in lines]
        need = 4 * len(pages) * len(lines) * stack.size[1]
        check_claim(self.path, "a part of the scan", need, self.budget)
        block = _block(stack, pages, spans, self.budget)
        return np.ascontiguousarray(stack.stack.arranged(block[..., columns]))


def tiff_stack(files: tuple[Path, ...]) -> TiffStack:
    """Describe files that hold one frame each, or one file that holds any number.

    Raises:
        InputError: a file is not there.
        FileFormatError: a file is damaged, or is one of several and holds more than one page.
        DTypeError: a file holds samples of a type that has no meaning here.
        ShapeError: the frames differ in size or type; the error names the first that does.
    """
    first: tuple[Any, ...] | None = None
    pages = 1
    for path in files:
        with _opened(path) as source:
            spec = _checked(path, 0, source.spec())
            first = first or spec
            _demand_same(path, 0, spec, first, files[0])
            pages = _pages(path, source, first)
        if pages > 1 and len(files) > 1:
            raise FileFormatError(
                f"{path}: holds {pages} pages and is one of {len(files)} files; wanted one frame "
                "in each of them, or all of them in one file"
            )
    assert first is not None
    return TiffStack(files, pages, first[0], first[1])


def _pages(path: Path, source: Any, first: tuple[Any, ...]) -> int:
    with path.open("rb") as file:
        count = len(TiffChain(file).pages())
    for page in range(1, count):
        if not source.seek_subimage(page, 0):
            raise _unreadable(path, page, first_line(source.geterror()))
        _demand_same(path, page, _checked(path, page, source.spec()), first, path)
    if count == 1:
        _demand_no_hyperstack(path, source.spec().get_string_attribute("ImageDescription"))
    return count


def _unreadable(path: Path, page: int, message: str) -> FileFormatError:
    """What is wrong with a page that the decoder refuses, in its own words."""
    codec, configured, _ = message.partition(_NOT_CONFIGURED)
    if configured:
        return FileFormatError(
            f"{path}: page {page} is compressed by {codec.split()[-1]}, which the decoder here "
            "does not read: save the images again without compression, or with LZW or Deflate"
        )
    reason = message or "OpenImageIO gives no reason"
    return FileFormatError(f"{path}: page {page} is damaged ({reason})")


def _demand_no_hyperstack(path: Path, description: str) -> None:
    words = dict(line.split("=", 1) for line in description.splitlines() if "=" in line)
    if "ImageJ" in words and words.get("images", "1") not in ("", "0", "1"):
        raise FileFormatError(
            f"{path}: ImageJ keeps {words['images']} images in this one page, where no other "
            "program looks for them; save them as an image sequence"
        )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    with reading(path, "the TIFF file"):
        if image_format(path) != "tiff":
            raise FileFormatError(f"{path}: is no TIFF file")
        with opened_image(path, "tiff") as source:
            yield source


def _checked(path: Path, page: int, spec: Any) -> tuple[tuple[int, int], str]:
    """The size and the type of a page."""
    where = path if page == 0 else f"{path}, page {page}"
    dtype = _DTYPES.get(str(spec.format))
    bits = spec.get_int_attribute("oiio:BitsPerSample", 0)
    if dtype is None or (bits and bits != 8 * np.dtype(dtype).itemsize):
        raise DTypeError(
            f"{where}: holds samples of {bits} bits ({spec.format}), wanted 8, 16 or 32 bit "
            "integers, or real numbers of 16, 32 or 64 bits"
        )
    if spec.deep or spec.depth > 1 or spec.nchannels != 1:
        raise ShapeError(
            f"{where}: has {spec.nchannels} channels and {spec.depth} layers, wanted one of each; "
            "a frame is grey"
        )
    return (int(spec.height), int(spec.width)), dtype


def _demand_same(
    path: Path, page: int, found: tuple[Any, ...], first: tuple[Any, ...], of: Path
) -> None:
    if found != first:
        what = [f"{size[0]} x {size[1]} {np.dtype(kind)}" for size, kind in (found, first)]
        where = path if page == 0 else f"{path}, page {page}"
        raise ShapeError(
            f"{where}: holds {what[0]}, {of.name} holds {what[1]} (rows x bins): all frames must "
            "be of one size and type"
        )


def _need(stack: TiffStack, start: int, stop: int) -> int:
    """Bytes of rows, and of the pages and lines that are read to get them."""
    sizes = dict(zip(stack.axes, stack.stack.shape, strict=True))
    rows = 4 * sizes["n"] * (stop - start) * sizes["b"]
    if stack.axes == "nrb":
        return rows
    return rows + (4 * math.prod(sizes.values()) if stack.axes[2] == "r" else rows)


def _read(stack: TiffStack, start: int, stop: int, left: int | None) -> Frames:
    pages, (high, _) = range(len(stack.files) * stack.pages), stack.size
    spans = [(start, stop)] if stack.axes[1] == "r" else [(0, high)]
    if stack.axes[0] == "r":
        pages = range(start, stop)
    block = _block(stack, pages, spans, left)
    if stack.axes[2] == "r":
        block = block[..., start:stop]
    return np.ascontiguousarray(stack.stack.arranged(block))


def _block(
    stack: TiffStack, pages: Sequence[int], spans: Sequence[tuple[int, int]], left: int | None
) -> Frames:
    """Whole lines of some pages, (page, line, column).

    Args:
        stack: the pages.
        pages: the numbers of those that are wanted, rising.
        spans: the lines of each that are wanted, (start, stop).
        left: bytes that decoding may take.
    """
    lines = sum(stop - start for start, stop in spans)
    block = np.empty((len(pages), lines, stack.size[1]), np.float32)
    wanted: dict[int, list[tuple[int, int]]] = {}
    for place, number in enumerate(pages):
        wanted.setdefault(number // stack.pages, []).append((place, number % stack.pages))
    granted = 0
    for index, places in wanted.items():
        path = stack.files[index]
        with _opened(path) as source, np.errstate(over="ignore"):
            doubles = Float64Pages(path)
            for place, page in places:
                if not source.seek_subimage(page, 0):
                    raise _unreadable(path, page, first_line(source.geterror()))
                spec = source.spec()
                found = _checked(path, page, spec)
                _demand_same(path, page, found, (stack.size, stack.dtype), path)
                done = 0
                for start, stop in spans:
                    scratch = _scratch(spec, start, stop)
                    if scratch > granted:
                        check_claim(path, "a part of a frame", scratch, left)
                        granted = scratch
                    into = block[place, done : done + stop - start]
                    if stack.dtype == "f8":
                        into[:] = doubles.rows(page, start, stop, stack.size)
                    else:
                        into[:] = _decoded(path, source, page, start, stop)
                    done += stop - start
    return block


def _scratch(spec: Any, start: int, stop: int) -> int:
    """Bytes that decoding rows takes at most; strips and tiles are decoded whole."""
    high, across = spec.height, spec.width
    if spec.tile_width:
        step, across = spec.tile_height, -(-across // spec.tile_width) * spec.tile_width
    else:
        step = min(max(spec.get_int_attribute("tiff:RowsPerStrip", high), 1), high)
    rows = -(-stop // step) * step - start // step * step
    return int(2 * rows * across * np.dtype(_DTYPES[str(spec.format)]).itemsize)


def _decoded(path: Path, source: Any, page: int, start: int, stop: int) -> NDArray[Any]:
    spec = source.spec()
    kind, high, wide = str(spec.format), spec.height, spec.width
    if spec.tile_width:
        step = spec.tile_height
        first, last = start // step * step, min(-(-stop // step) * step, high)
        area = (spec.x, spec.x + wide, spec.y + first, spec.y + last, 0, 1, 0, 1)
        pixels = source.read_tiles(page, 0, *area, kind)
    else:
        first, last = start, stop
        pixels = source.read_scanlines(page, 0, spec.y + first, spec.y + last, 0, 0, 1, kind)
    message = first_line(source.geterror())
    if pixels is None or message:
        raise _unreadable(path, page, message)
    values = np.asarray(pixels).reshape(last - first, wide)[start - first : stop - first]
    # OpenImageIO turns 8-bit codes over where 0 is shown as white; a count is what is stored.
    if kind == "uint8" and spec.get_int_attribute("tiff:PhotometricInterpretation", 1) == 0:
        values = 255 - values
    return values
