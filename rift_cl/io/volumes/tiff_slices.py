"""A volume as a folder of uncompressed TIFF slices with ImageJ's notes: every program reads it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, OutputError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.output import atomic_path, staged_folder
from rift_cl.io.volumes.imagej import description, resolution
from rift_cl.io.volumes.layout import Floats, VolumeLayout, WriteSlab
from rift_cl.io.volumes.plain_tiff import plain_pages
from rift_cl.io.volumes.sample_window import restored

_SLICE = re.compile(r"slice_(\d{5,})\.tif")


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write slices into a folder that gets its name at the end."""
    display = None if layout.window is None else (0, layout.window.levels)
    notes = {"description": description(layout, display=display), **resolution(layout)}
    with staged_folder(path, _strange) as folder:
        yield partial(_write_slices, folder, notes)


def load_volume(path: Path, *, budget: int | None) -> Floats:
    """Read every slice of a folder."""
    names = sorted(entry.name for entry in path.iterdir() if _SLICE.fullmatch(entry.name))
    count = len(names)
    missing = next((i for i in range(count) if not _slice(path, i).is_file()), None)
    if missing is not None:
        raise FileFormatError(f"{path}: slice {missing} of {count} is missing")
    volume = np.empty((0, 0, 0), np.float32)
    for index in range(count):
        place = _slice(path, index)
        with reading(place, "the slice"):
            page = plain_pages(place)
            if index == 0:
                check_claim(path, "the volume", (4 * count + 8) * math.prod(page.shape), budget)
                volume = np.empty((count, *page.shape), np.float32)
            if page.shape != volume.shape[1:]:
                raise ShapeError(
                    f"{place}: has shape {page.shape}, the first slice {volume.shape[1:]}"
                )
            volume[index] = restored(page.samples(1), page.step, page.offset)[0]
    return volume


def _slice(folder: Path, index: int) -> Path:
    return folder / f"slice_{index:05d}.tif"


def _write_slices(folder: Path, notes: dict[str, Any], start: int, slab: NDArray[Any]) -> None:
    for index, image in enumerate(slab, start):
        path = _slice(folder, index)
        with atomic_path(path) as part:
            tifffile.imwrite(
                part, image, photometric="minisblack", metadata=None, software=False, **notes
            )
            if part.stat().st_size < image.nbytes:
                raise OutputError(f"{path}: is shorter than its samples; the disk lost some")


def _strange(names: list[str]) -> str | None:
    return next((n for n in names if not _SLICE.fullmatch(n.removesuffix(".part"))), None)
