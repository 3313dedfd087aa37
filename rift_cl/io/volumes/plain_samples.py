"""Files whose samples are plain bytes at a known place, after a header that a library writes.

The libraries behind HDF5, TIFF and MRC write the header alone. Once a disk is full some of them
can no longer close their file, and closing it again ends the process; samples that are written
there as to any file end in an error like any other. Room is taken first, where the system can.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import OutputError
from rift_cl.io.output import staged_file, writing
from rift_cl.io.volumes.layout import VolumeLayout, WriteSlab

_HEADER = 1 << 16
_CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.EINVAL)


@contextmanager
def staged_samples(
    path: Path,
    layout: VolumeLayout,
    write_header: Callable[[Path], int],
    finish: Callable[[Path], None] | None = None,
) -> Iterator[WriteSlab]:
    """Write slices into a file that gets its name at the end.

    Args:
        path: the final name.
        layout: the volume.
        write_header: makes the file of a temporary name and gives the place of its first sample.
        finish: changes the header of the file of that name once all samples are there.
    """
    with staged_file(path) as part:
        with writing(path):
            _reserve(part, 0, _HEADER)
            offset = write_header(part)
            _reserve(part, offset, layout.size)
            file = part.open("r+b", buffering=0)
        with file:
            yield partial(_write_slab, path, file, offset)
        if part.stat().st_size < offset + layout.size:
            raise OutputError(f"{path}: is shorter than its samples; the disk lost some of them")
        if finish is not None:
            with writing(path):
                finish(part)


def _write_slab(path: Path, file: FileIO, offset: int, start: int, slab: NDArray[Any]) -> None:
    rest = slab.reshape(-1).view(np.uint8).data
    with writing(path):
        file.seek(offset + start * slab[0].nbytes)
        while rest:
            rest = rest[file.write(rest) :]


def _reserve(part: Path, start: int, size: int) -> None:
    """Take the room on the disk now, where the system can, so that a full disk shows at once."""
    if not hasattr(os, "posix_fallocate"):
        return
    handle = os.open(part, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        os.posix_fallocate(handle, start, size)
    except OSError as error:
        if error.errno not in _CANNOT_RESERVE:
            raise
    finally:
        os.close(handle)
