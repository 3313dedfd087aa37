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
from rift_cl.io.scans.tiff_folder import tiff_names
from rift_cl.io.volumes.imagej import description, resolution
from rift_cl.io.volumes.layout import Floats, VolumeLayout, WriteSlab
from rift_cl.io.volumes.plain_tiff import plain_pages
from rift_cl.io.volumes.sample_window import restored

_SLICE = re.compile(r"slice_(\d{5,})\.tif")
_NUMBERED = re.compile(r"(.*?)(\d+)\.tiff?", re.IGNORECASE)
# Names that an error shows.
_LISTED = 4


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write slices into a folder that gets its name at the end."""
    display = None if layout.window is None else (0, layout.window.levels)
    notes = {"description": description(layout, display=display), **resolution(layout)}
    with staged_folder(path, _strange) as folder:
        yield partial(_write_slices, folder, notes)


def load_volume(path: Path, *, budget: int | None) -> Floats:
    """Read every slice of a folder."""
    places = _slices(path)
    count = len(places)
    volume = np.empty((0, 0, 0), np.float32)
    for index, place in enumerate(places):
        with reading(place, "the slice"):
            page = plain_pages(place)
            if len(page.places) > 1:
                raise ShapeError(f"{place}: has {len(page.places)} pages, wanted one slice")
            if index == 0:
                check_claim(path, "the volume", (4 * count + 8) * math.prod(page.shape), budget)
                volume = np.empty((count, *page.shape), np.float32)
            if page.shape != volume.shape[1:]:
                raise ShapeError(
                    f"{place}: has shape {page.shape}, the first slice {volume.shape[1:]}"
                )
            volume[index] = restored(page.samples(), page.step, page.offset)[0]
    return volume


def _slices(folder: Path) -> list[Path]:
    """The slices of a folder in the order of their numbers, which other programs begin anywhere.

    Raises:
        FileFormatError: names have no number or different beginnings, or a number is missing.
    """
    names = tiff_names(folder)
    ours = [name for name in names if _SLICE.fullmatch(name)]
    found = [match for name in ours or names if (match := _NUMBERED.fullmatch(name))]
    if not ours and (len(found) < len(names) or len({match[1] for match in found}) > 1):
        raise FileFormatError(
            f"{folder}: wanted one series of numbered slices, such as slice_00000.tif, and finds "
            f"{', '.join(names[:_LISTED])}{', ...' if len(names) > _LISTED else ''}"
        )
    numbered = {int(match[2]): match[0] for match in found}
    first = 0 if ours else min(numbered)
    for index, number in enumerate(range(first, first + len(found))):
        if number not in numbered:
            raise FileFormatError(f"{folder}: slice {index} of {len(found)} is missing")
    return [folder / numbered[number] for number in sorted(numbered)]


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
