"""A volume as a folder of TIFF slices, 32-bit floating and uncompressed: every program reads it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rift_cl.errors import FileFormatError, OutputError, ShapeError
from rift_cl.io.boundary import check_claim
from rift_cl.io.output import atomic_path, staged_folder
from rift_cl.io.pixels import read_pixels, write_pixels
from rift_cl.io.volume import Slab, VolumeLayout, WriteSlab

_SLICE = re.compile(r"slice_(\d{5,})\.tif")
_CENTIMETRES = {"m": 100.0, "cm": 1.0, "mm": 0.1, "um": 1e-4, "µm": 1e-4, "μm": 1e-4}


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write slices into a folder that gets its name at the end."""
    with staged_folder(path, _strange) as folder:
        yield partial(_write_slices, folder, _attributes(layout))


def load_volume(path: Path, *, budget: int | None) -> Slab:
    """Read every slice of a folder."""
    names = sorted(entry.name for entry in path.iterdir() if _SLICE.fullmatch(entry.name))
    count = len(names)
    missing = next((i for i in range(count) if not _slice(path, i).is_file()), None)
    if missing is not None:
        raise FileFormatError(f"{path}: slice {missing} of {count} is missing")
    first = read_pixels(_slice(path, 0), budget=budget)
    check_claim(path, "the volume", count * first.nbytes, budget)
    volume = np.empty((count, *first.shape[:2]), np.float32)
    for index in range(count):
        image = read_pixels(_slice(path, index), budget=budget)
        if image.shape != (*volume.shape[1:], 1):
            raise ShapeError(
                f"{_slice(path, index)}: has shape {image.shape}, the first slice {first.shape}; "
                "one channel is wanted"
            )
        volume[index] = image[..., 0]
    return volume


def _slice(folder: Path, index: int) -> Path:
    return folder / f"slice_{index:05d}.tif"


def _write_slices(folder: Path, attributes: dict[str, Any], start: int, slab: Slab) -> None:
    for index, image in enumerate(slab, start):
        path = _slice(folder, index)
        with atomic_path(path) as part:
            write_pixels(part, image[..., np.newaxis], format="tiff", attributes=attributes)
            if part.stat().st_size < image.nbytes:
                raise OutputError(f"{path}: is shorter than its samples; the disk lost some")


def _attributes(layout: VolumeLayout) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "compression": "none",
        "ImageDescription": json.dumps(layout.attributes),
        # Without this OpenImageIO 3.2 fails to write an empty Exif directory, and says so.
        "tiff:write_exif": 0,
    }
    length = _CENTIMETRES.get(layout.unit)
    if length is not None:
        _, high, wide = layout.spacing
        attributes["ResolutionUnit"] = "cm"
        attributes["XResolution"] = 1 / (wide * length)
        attributes["YResolution"] = 1 / (high * length)
        attributes["PixelAspectRatio"] = wide / high
    return attributes


def _strange(names: list[str]) -> str | None:
    return next((n for n in names if not _SLICE.fullmatch(n.removesuffix(".part"))), None)
