"""A volume as a Zarr array, one chunk per slice; for Zarr 2.18 and 3.

A store says ``complete: false`` until its last slice is on the disk, so that one that was cut off
is known even when somebody renames it.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from rift_cl.errors import FileFormatError, PathEscapeError, ShapeError
from rift_cl.io.boundary import check_claim, check_numeric
from rift_cl.io.output import staged_folder, writing
from rift_cl.io.volume import Slab, VolumeLayout, WriteSlab

_HEADER = re.compile(r"(zarr\.|\.zarray).*")
_CHUNK = re.compile(r"c|\.zattrs.*|\d+\.\d+\.\d+(\..*\.partial)?")
_LARGEST_HEADER = 1 << 20
# Decoders that only unpack bytes. Others, such as "pickle", would run what the file says.
_CODECS = {"blosc", "bytes", "crc32c", "gzip", "lz4", "zlib", "zstd"}


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write chunks into a store that gets its name at the end."""
    with staged_folder(path, _strange) as folder:
        with writing(path):
            array = zarr.open_array(
                str(folder),
                mode="w",
                shape=layout.shape,
                chunks=(1, *layout.shape[1:]),
                dtype="<f4",
                fill_value=0.0,
            )
            array.attrs.update({**layout.attributes, "complete": False})

        yield partial(_write_slab, path, array)
        with writing(path):
            array.attrs["complete"] = True


def load_volume(path: Path, *, budget: int | None) -> Slab:
    """Read the array whole."""
    _check_links(path)
    _check_codecs(path)
    array: Any = zarr.open_array(str(path), mode="r")
    check_numeric(path, "the array", array.dtype)
    if array.attrs.get("complete", True) is not True:
        raise FileFormatError(f"{path}: was cut off while it was written; write it again")
    if array.ndim != 3 or 0 in array.shape:
        raise ShapeError(f"{path}: has shape {array.shape}, wanted (z, y, x)")
    each = array.dtype.itemsize + (0 if array.dtype == np.float32 else 4)
    need = math.prod(array.shape) * each + math.prod(array.chunks) * array.dtype.itemsize
    check_claim(path, "the volume", need, budget)
    return np.asarray(array[...], np.float32)


def _write_slab(path: Path, array: Any, start: int, slab: Slab) -> None:
    with writing(path):
        array[start : start + len(slab)] = slab


def _check_links(path: Path) -> None:
    root = path.resolve()
    for entry in path.rglob("*"):
        if entry.is_symlink() and not entry.resolve().is_relative_to(root):
            raise PathEscapeError(f"{path}: {entry.name!r} leads outside the store; copy it in")


def _check_codecs(path: Path) -> None:
    for header in (path / "zarr.json", path / ".zarray"):
        if header.exists():
            strange = _codecs(header) - _CODECS
            if strange:
                raise FileFormatError(
                    f"{path}: is packed with {sorted(strange)}, wanted some of {sorted(_CODECS)}"
                )


def _codecs(header: Path) -> set[str]:
    if header.stat().st_size > _LARGEST_HEADER:
        raise FileFormatError(f"{header}: is too long for the header of an array")
    meta = json.loads(header.read_text(encoding="utf-8"))
    codecs = [*meta.get("codecs", []), meta.get("compressor"), *(meta.get("filters") or [])]
    names = (codec.get(key) for codec in codecs if codec for key in ("name", "id"))
    return {str(name) for name in names if name is not None}


def _strange(names: list[str]) -> str | None:
    strange = [name for name in names if not _HEADER.fullmatch(name)]
    if len(strange) == len(names):
        return next(iter(names), None)
    return next((name for name in strange if not _CHUNK.fullmatch(name)), None)
