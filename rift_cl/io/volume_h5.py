"""A volume as one HDF5 dataset, ``/volume``.

The HDF5 library writes the header alone. Once a disk is full it can no longer close its file, and
closing it again ends the process; but the samples of a contiguous dataset are plain bytes at a
known place, so they are written there as to any file.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from io import FileIO
from pathlib import Path

import h5py
import numpy as np

from rift_cl.errors import OutputError, ShapeError
from rift_cl.io.boundary import check_claim, check_numeric
from rift_cl.io.hdf5_tree import open_tree
from rift_cl.io.output import staged_file, writing
from rift_cl.io.volume import Slab, VolumeLayout, WriteSlab

_DATASET = "volume"
_HEADER = 1 << 16
_CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.EINVAL)


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write slices into a file that gets its name at the end."""
    with staged_file(path) as part:
        with writing(path):
            _reserve(part, 0, _HEADER)
            offset = _write_header(part, layout)
            _reserve(part, offset, layout.size)
            file = part.open("r+b", buffering=0)
        with file:
            yield partial(_write_slab, path, file, offset)
        if part.stat().st_size < offset + layout.size:
            raise OutputError(f"{path}: is shorter than its samples; the disk lost some of them")


def load_volume(path: Path, *, budget: int | None) -> Slab:
    """Read the dataset whole."""
    with open_tree(path) as tree:
        dataset = tree.dataset(f"/{_DATASET}")
        check_numeric(path, _DATASET, dataset.dtype)
        if dataset.shape is None or len(dataset.shape) != 3 or 0 in dataset.shape:
            raise ShapeError(f"{path}: /{_DATASET} has shape {dataset.shape}, wanted (z, y, x)")
        chunk = math.prod(dataset.chunks) * dataset.dtype.itemsize if dataset.chunks else 0
        check_claim(path, "the volume", 4 * math.prod(dataset.shape) + chunk, budget)
        volume = np.empty(dataset.shape, np.float32)
        dataset.read_direct(volume)
    return volume


def _write_slab(path: Path, file: FileIO, offset: int, start: int, slab: Slab) -> None:
    rest = slab.astype("<f4", copy=False).reshape(-1).view(np.uint8).data
    with writing(path):
        file.seek(offset + start * slab[0].nbytes)
        while rest:
            rest = rest[file.write(rest) :]


def _write_header(part: Path, layout: VolumeLayout) -> int:
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    space = h5py.h5s.create_simple(layout.shape)
    with h5py.File(part, "w") as file:
        dataset = h5py.Dataset(
            h5py.h5d.create(file.id, _DATASET.encode(), h5py.h5t.IEEE_F32LE, space, creation)
        )
        for name, value in layout.attributes.items():
            dataset.attrs[name] = value
        return int(dataset.id.get_offset())


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
