"""The volume that ``rift reconstruct`` leaves, and whether there is a place for it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_input import SliceInput
from rift_cl.commands.reconstruct.slice_window import Window
from rift_cl.io.output import leftovers
from rift_cl.io.volumes import (
    VOLUME_NAMES,
    VolumeWriter,
    open_volume,
    suggested_window,
    whole_window,
)

Floats = NDArray[np.float32]


class _PlaceFoundError(Exception):
    """Leaves a volume that was opened only to see whether it can be."""


def volume_path(settings: ReconstructSettings) -> Path:
    """Where the volume goes."""
    return settings.out / VOLUME_NAMES[settings.format]


def made_words(settings: ReconstructSettings) -> str:
    """Where the volume and what is beside it are, for people."""
    volume = volume_path(settings)
    there = "the slices are in" if settings.format == "tiff" else "the volume is"
    return f"{there} {volume}, and report.html is in {settings.out}"


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
        spacing=(source.row_pitch, window.pixel, window.pixel),
        unit=source.unit,
        origin=(source.height, *(grid.coordinates(axis)[0] for axis in (-2, -1))),
        dtype=settings.dtype,
        window=values,
        attenuation=settings.attenuation,
    )


def chosen_window(
    settings: ReconstructSettings, few: Sequence[Floats], all_slices: Iterable[Floats]
) -> tuple[tuple[float, float], str]:
    """What the integers of a volume stand for where it was not said, and a sentence about it.

    Args:
        settings: the type of samples.
        few: some slices.
        all_slices: the volume, in parts; looked at for 16 bits alone.
    """
    if settings.dtype == "uint16":
        ends = [(np.fmin.reduce(part, None), np.fmax.reduce(part, None)) for part in all_slices]
        low, high = whole_window(few, float(min(ends)[0]), float(max(top for _, top in ends)))
        of = "the range of all slices"
    else:
        (low, high), of = suggested_window(few), f"a window chosen from {len(few)} slices"
    return (low, high), f"Samples are {settings.dtype} from {low:g} to {high:g}, {of} (--window)."


def clipped_words(
    clipped: tuple[int, int], window: tuple[float, float], reached: tuple[float, float], unit: str
) -> str:
    """A sentence about values outside a window; empty where there are none.

    Args:
        clipped: how many values were below and above.
        window: its ends.
        reached: the least value of the volume, and the greatest.
        unit: of length, one over which is that of the values; empty where it is not.
    """
    per = f" per {unit}" if unit else ""
    (below, above), (low, high), (least, most) = clipped, window, reached
    told = [f"{below} values below {low:g}{per} (down to {least:.4g})"] if below else []
    told += [f"{above} values above {high:g}{per} (up to {most:.4g})"] if above else []
    if not told:
        return ""
    return (
        f"{' and '.join(told)} were clipped to the ends of the window: --window LOW HIGH takes a "
        "wider one, --dtype float32 keeps all values."
    )


def check_place(settings: ReconstructSettings, source: SliceInput, window: Window) -> None:
    """Tell before the work, not after it, that the volume cannot be written; nothing is left.

    An earlier volume in another format is looked at as well, since it goes when this one comes.

    Raises:
        OutputError: a place holds something else, or cannot be written to.
    """
    for format, name in VOLUME_NAMES.items():
        earlier = any((settings.out / left).exists() for left in (name, *leftovers(name)))
        if format == settings.format or earlier:
            there = dataclasses.replace(settings, format=format, dtype="float32", window=None)
            with suppress(_PlaceFoundError), open_slices(there, source, window, None):
                raise _PlaceFoundError
