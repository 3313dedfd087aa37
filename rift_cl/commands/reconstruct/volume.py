"""The volume that ``rift reconstruct`` leaves, and whether there is a place for it."""

from __future__ import annotations

import dataclasses
from contextlib import suppress
from pathlib import Path

from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_input import SliceInput
from rift_cl.commands.reconstruct.slice_window import Window
from rift_cl.io.volumes import VOLUME_NAMES, VolumeWriter, open_volume


class _PlaceFoundError(Exception):
    """Leaves a volume that was opened only to see whether it can be."""


def volume_path(settings: ReconstructSettings) -> Path:
    """Where the volume goes."""
    return settings.out / VOLUME_NAMES[settings.format]


def open_slices(
    settings: ReconstructSettings,
    source: SliceInput,
    window: Window,
    values: tuple[float, float] | None,
) -> VolumeWriter:
    """Prepare to write the slices of all rows that were asked for, in the settings' format.

    Args:
        settings: the format and the type of samples.
        source: the scan.
        window: where the slices lie.
        values: what the least and the greatest integer stand for; None for floating samples.
    """
    grid = window.grid(1)
    return open_volume(
        volume_path(settings),
        (source.rows[1] - source.rows[0], *window.shape),
        format=settings.format,
        spacing=(source.pitch, window.pixel, window.pixel),
        unit=source.unit,
        origin=(source.rows[0] * source.pitch, *(grid.coordinates(axis)[0] for axis in (-2, -1))),
        dtype=settings.dtype,
        window=values,
    )


def check_place(settings: ReconstructSettings, source: SliceInput, window: Window) -> None:
    """Tell before the work, not after it, that the volume cannot be written; nothing is left.

    An earlier volume in another format is looked at as well, since it goes when this one comes.

    Raises:
        OutputError: a place holds something else, or cannot be written to.
    """
    for format, name in VOLUME_NAMES.items():
        if format == settings.format or (settings.out / name).exists():
            there = dataclasses.replace(settings, format=format, dtype="float32", window=None)
            with suppress(_PlaceFoundError), open_slices(there, source, window, None):
                raise _PlaceFoundError
