"""The body of a PLY file, block by block: as much of it in memory as a cache holds.

Nothing is mapped into memory: a mapped file that somebody shortens ends the process.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader, TextIOWrapper
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.scenes.ply_header import PlyHeader

_BLOCK = 1 << 20
# Characters that a number in a text may take, with the space after it.
_WIDEST = 64


def read_blocks(path: Path, file: BufferedReader, header: PlyHeader) -> Iterator[NDArray[np.void]]:
    """The records of a file, some at a time; those of a text are float64.

    A block is the next one's memory: take what is wanted before going on.

    Raises:
        FileFormatError: the body is not what the header claims.
    """
    file.seek(header.offset)
    yield from (_binary_blocks if header.order else _text_blocks)(path, file, header)


def record_runs(count: int, record: np.dtype[np.void]) -> list[slice]:
    """Cut records into blocks."""
    rows = max(1, _BLOCK // record.itemsize)
    return [slice(start, min(start + rows, count)) for start in range(0, count, rows)]


def _binary_blocks(
    path: Path, file: BufferedReader, header: PlyHeader
) -> Iterator[NDArray[np.void]]:
    runs = record_runs(header.count, header.record)
    block = np.empty(runs[0].stop if runs else 0, header.record)
    for run in runs:
        part = block[: run.stop - run.start]
        if file.readinto(part.view(np.uint8).data) < part.nbytes:
            raise FileFormatError(f"{path}: was cut off while it was read")
        yield part


def _text_blocks(path: Path, file: BufferedReader, header: PlyHeader) -> Iterator[NDArray[np.void]]:
    width = len(header.properties)
    record = np.dtype([(name, "f8") for name in header.properties])
    with TextIOWrapper(file, "ascii") as text:
        # A longer line comes in pieces, which have too few numbers and are refused as such.
        pieces = iter(lambda: text.readline(_WIDEST * width), "")
        lines = (line for line in pieces if line.strip())
        for run in record_runs(header.count, record):
            rows = list(islice(lines, run.stop - run.start))
            if len(rows) < run.stop - run.start:
                raise FileFormatError(
                    f"{path}: claims {header.count} records and holds {run.start + len(rows)}; it "
                    "was cut off"
                )
            yield _table(path, rows, run.start, width).view(record)[:, 0]
        if header.after is not None and next(lines, None) is not None:
            raise FileFormatError(f"{path}: holds more than the {header.count} records it claims")


def _table(path: Path, rows: list[str], start: int, width: int) -> NDArray[np.float64]:
    try:
        values = np.loadtxt(rows, np.float64, comments=None, ndmin=2)
        fits = values.shape[1] == width
    except ValueError:
        fits = False
    if not fits:
        raise FileFormatError(
            f"{path}: records {start} to {start + len(rows)} are no lines of {width} numbers each; "
            "the file is damaged"
        )
    return values
