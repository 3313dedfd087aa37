"""A volume as one HDF5 dataset, ``/volume``, contiguous and without a time of writing."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rift_cl.errors import ShapeError
from rift_cl.io.boundary import check_claim, check_numeric
from rift_cl.io.hdf5_tree import Hdf5Tree, open_tree
from rift_cl.io.volumes.layout import Floats, VolumeLayout, VolumePlace, WriteSlab
from rift_cl.io.volumes.plain_samples import staged_samples
from rift_cl.io.volumes.sample_window import restored

_DATASET = "volume"
_TYPES = {
    "float32": h5py.h5t.IEEE_F32LE,
    "uint16": h5py.h5t.STD_U16LE,
    "uint8": h5py.h5t.STD_U8LE,
}


def staged_volume(path: Path, layout: VolumeLayout) -> AbstractContextManager[WriteSlab]:
    """Write slices into a file that gets its name at the end."""
    return staged_samples(path, layout, partial(_write_header, layout))


def load_volume(path: Path, *, budget: int | None) -> Floats:
    """Read the dataset whole."""
    with open_tree(path) as tree:
        dataset = _volume_in(tree)
        check_numeric(path, _DATASET, dataset.dtype)
        if dataset.shape is None or len(dataset.shape) != 3 or 0 in dataset.shape:
            raise ShapeError(f"{path}: /{_DATASET} has shape {dataset.shape}, wanted (z, y, x)")
        chunk = math.prod(dataset.chunks) * dataset.dtype.itemsize if dataset.chunks else 0
        check_claim(path, "the volume", 4 * math.prod(dataset.shape) + chunk, budget)
        volume = np.empty(dataset.shape, np.float32)
        dataset.read_direct(volume)
        scale, offset = (dataset.attrs.get(name) for name in ("scale_factor", "add_offset"))
    if scale is None:
        return volume
    return restored(volume, float(scale), 0.0 if offset is None else float(offset))


def load_place(path: Path) -> VolumePlace:
    """What the dataset's attributes say of where its samples stand."""
    with open_tree(path) as tree:
        return VolumePlace.of(_volume_in(tree).attrs)


def _volume_in(tree: Hdf5Tree) -> Any:
    """The dataset of a volume.

    Raises:
        FileFormatError: there is none; the error lists those that there are.
    """
    return tree.dataset(f"/{_DATASET}", remedy="a scan becomes a volume by 'rift reconstruct'")


def _write_header(layout: VolumeLayout, part: Path) -> int:
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    # Otherwise equal volumes differ by the second in which they were made.
    creation.set_obj_track_times(False)
    space = h5py.h5s.create_simple(layout.shape)
    with h5py.File(part, "w") as file:
        kind = _TYPES[layout.dtype.name]
        dataset = h5py.Dataset(h5py.h5d.create(file.id, _DATASET.encode(), kind, space, creation))
        for name, value in layout.attributes.items():
            dataset.attrs[name] = value
        microns = layout.lengths(1e-6)
        if microns is not None:
            # The name by which Fiji's and ilastik's readers know the size of a voxel.
            dataset.attrs["element_size_um"] = microns
        return int(dataset.id.get_offset())
