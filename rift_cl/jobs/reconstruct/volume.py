"""The volume that ``rift reconstruct`` leaves, and whether there is a place for it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Literal

from rift_cl.io.volumes import VolumeWriter, open_volume
from rift_cl.jobs.reconstruct.settings import ReconstructSettings
from rift_cl.jobs.reconstruct.slice_input import SliceInput
from rift_cl.jobs.reconstruct.slice_window import Window
from rift_cl.jobs.scan_input import VOLUME_NAMES

Format = Literal["tiff", "zarr", "h5"]


class _PlaceFoundError(Exception):
    """Leaves a volume that was opened only to see whether it can be."""


def volume_path(settings: ReconstructSettings) -> Path:
    """Where the volume goes."""
    return settings.out / VOLUME_NAMES[settings.format]


def open_slices(
    settings: ReconstructSettings, source: SliceInput, window: Window, format: Format | None = None
) -> VolumeWriter:
    """Prepare to write the slices of all rows that were asked for, in the settings' format."""
    format = format or settings.format
    return open_volume(
        settings.out / VOLUME_NAMES[format],
        (source.rows[1] - source.rows[0], *window.shape),
        format=format,
        spacing=(source.pitch, window.pixel, window.pixel),
        unit=source.unit,
    )


def demand_place(settings: ReconstructSettings, source: SliceInput, window: Window) -> None:
    """Tell before the work, not after it, that the volume cannot be written; nothing is left.

    An earlier volume in another format is looked at as well, since it goes when this one comes.

    Raises:
        OutputError: a place holds something else, or cannot be written to.
    """
    formats: tuple[Format, ...] = ("tiff", "zarr", "h5")
    for format in formats:
        there = (settings.out / VOLUME_NAMES[format]).exists()
        if there or format == settings.format:
            with suppress(_PlaceFoundError), open_slices(settings, source, window, format):
                raise _PlaceFoundError
