"""A volume as one TIFF file of many pages, as ImageJ saves a stack.

Up to 4 GB it is a classic TIFF, which ImageJ opens by itself. Beyond, it is a BigTIFF, which Fiji
opens by Bio-Formats. The pages lie one behind the other without a gap, as ImageJ expects.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import tifffile

from rift_cl.io.boundary import check_claim
from rift_cl.io.volumes.imagej import description, resolution
from rift_cl.io.volumes.layout import Floats, VolumeLayout, WriteSlab
from rift_cl.io.volumes.plain_samples import staged_samples
from rift_cl.io.volumes.plain_tiff import plain_pages
from rift_cl.io.volumes.sample_window import restored
from rift_cl.io.volumes.slice_statistics import SliceStatistics

# Offsets of a classic TIFF have 32 bits; the pages' directories take their share.
_CLASSIC = (1 << 32) - (1 << 25)
_DIRECTORY = 1 << 9


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write pages into a file that gets its name at the end."""
    statistics = SliceStatistics(layout.shape[0])
    header, finish = partial(_write_header, layout), partial(_write_display, layout, statistics)
    with staged_samples(path, layout, header, finish) as write:
        yield statistics.watching(write)


def load_volume(path: Path, *, budget: int | None) -> Floats:
    """Read every page of a stack that ``staged_volume`` wrote, ImageJ or another program."""
    pages = plain_pages(path)
    size = len(pages.places) * math.prod(pages.shape)
    check_claim(path, "the volume", size * (4 + pages.dtype.itemsize), budget)
    return restored(pages.samples(), pages.step, pages.offset)


def _write_header(layout: VolumeLayout, part: Path) -> int:
    count = layout.shape[0]
    big = layout.size + _DIRECTORY * count > _CLASSIC
    with tifffile.TiffWriter(part, bigtiff=big) as file:
        place = file.write(
            None,
            shape=layout.shape,
            dtype=layout.dtype,
            photometric="minisblack",
            contiguous=True,
            metadata=None,
            software=False,
            description=description(layout, slices=count, display=_display(layout, (0.0, 0.0))),
            returnoffset=True,
            **resolution(layout),
        )
    if place is None:
        raise OSError("tifffile did not place the pages")
    return int(place[0])


def _display(layout: VolumeLayout, range: tuple[float, float]) -> tuple[float, float]:
    if layout.window is not None:
        return 0, layout.window.levels
    return range if all(map(math.isfinite, range)) else (0.0, 0.0)


def _write_display(layout: VolumeLayout, statistics: SliceStatistics, part: Path) -> None:
    """Fill in the range of the samples, which is known at the end."""
    display = _display(layout, statistics.range)
    with tifffile.TiffFile(part, mode="r+b") as file:
        tag: Any = file.pages.first.tags["ImageDescription"]
        tag.overwrite(description(layout, slices=layout.shape[0], display=display))
