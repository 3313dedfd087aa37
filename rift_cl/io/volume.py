"""Volumes (z, y, x), written while they grow and read back whole.

A volume is often larger than memory, so it is handed over in slabs of slices. Whatever the format,
nothing carries the final name before every slice is on the disk.
"""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, FileFormatError, InputError, OutputError, ShapeError
from rift_cl.geometry import Grid
from rift_cl.io.boundary import reading
from rift_cl.io.output import check_space

Slab = NDArray[np.float32]
WriteSlab = Callable[[int, Slab], None]

# The libraries behind the formats take a second to load: only the one in use is.
_MODULES = {
    "tiff": "rift_cl.io.volume_tiff",
    "zarr": "rift_cl.io.volume_zarr",
    "h5": "rift_cl.io.volume_h5",
}
_HEADER_ROOM = 1 << 16
_SLICE_ROOM = 1 << 12


@dataclass(frozen=True)
class VolumeLayout:
    """What is known of a volume before its first slice.

    Args:
        shape: (z, y, x).
        spacing: distance between samples along each axis.
        unit: unit of the spacing, empty where it is not known.
    """

    shape: tuple[int, int, int]
    spacing: tuple[float, float, float]
    unit: str

    @property
    def size(self) -> int:
        """Bytes of the samples."""
        return 4 * math.prod(self.shape)

    @property
    def attributes(self) -> dict[str, Any]:
        """The description that goes into the file."""
        return {"axes": ["z", "y", "x"], "spacing": list(self.spacing), "unit": self.unit}


class _Format(Protocol):
    def staged_volume(
        self, path: Path, layout: VolumeLayout
    ) -> AbstractContextManager[WriteSlab]: ...

    def load_volume(self, path: Path, *, budget: int | None) -> Slab: ...


def open_volume(
    path: str | os.PathLike[str],
    shape: Sequence[int],
    *,
    format: Literal["tiff", "zarr", "h5"],
    spacing: float | Sequence[float],
    unit: str = "",
) -> VolumeWriter:
    """Prepare to write a volume; nothing is written before the ``with`` block begins.

    Args:
        path: a folder of slices (tiff), a store (zarr) or a file (h5). An earlier volume there is
            replaced when the new one is complete; a folder that holds anything else is refused.
        shape: (z, y, x).
        format: "tiff", 32-bit floating slices ``slice_00000.tif``; "zarr", one chunk per slice;
            "h5", one dataset ``/volume``.
        spacing: distance between samples, one number or one for each of (z, y, x).
        unit: unit of the spacing, such as "mm".

    Returns:
        A context manager; leaving it without an exception makes the volume appear.

    Raises:
        InputError: the format is unknown, or shape or spacing cannot be used.
        OutputError: the disk has too little room.
    """
    path = Path(path)
    if format not in _MODULES:
        raise InputError(f"{path}: format is {format!r}, wanted one of {', '.join(_MODULES)}")
    grid = Grid(shape, spacing)
    if len(grid.shape) != 3:
        raise ShapeError(f"{path}: shape is {grid.shape}, a volume has (z, y, x)")
    layout = VolumeLayout(_three(grid.shape), _three(grid.spacing), unit)
    check_space(path, layout.size + _HEADER_ROOM + _SLICE_ROOM * layout.shape[0])
    return VolumeWriter(path, layout, _module(format).staged_volume(path, layout))


def read_volume(path: str | os.PathLike[str], *, budget: int | None = None) -> Slab:
    """Read a whole volume (z, y, x), float32, that ``open_volume`` wrote in any of its formats.

    Args:
        path: the folder, store or file.
        budget: bytes that it may take; 60 % of the free memory when not given.

    Raises:
        InputError: there is nothing of that name.
        FileFormatError: it is damaged, incomplete, or no volume.
        ResourceLimitError: it is larger than the budget; nothing was allocated.
    """
    path = Path(path)
    with reading(path, "the volume"):
        return _module(_format_of(path)).load_volume(path, budget=budget)


class VolumeWriter:
    """Takes the slabs of one volume, in any order; use it in a ``with`` statement.

    Args:
        path: the final name.
        layout: the volume.
        stage: the format's own context manager.
    """

    def __init__(
        self, path: Path, layout: VolumeLayout, stage: AbstractContextManager[WriteSlab]
    ) -> None:
        self.path = path
        self.layout = layout
        self._stage = stage
        self._write: WriteSlab | None = None
        self._written = np.zeros(layout.shape[0], np.bool_)

    def __enter__(self) -> VolumeWriter:
        self._write = self._stage.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._write = None
        missing = np.flatnonzero(~self._written)
        if kind is None and missing.size:
            error = OutputError(
                f"{self.path}: {missing.size} of {self._written.size} slices were never written, "
                f"the first is {missing[0]}; the volume was discarded"
            )
            self._stage.__exit__(OutputError, error, None)
            raise error
        self._stage.__exit__(kind, error, trace)

    def write(self, start: int, block: ArrayLike) -> None:
        """Write slices ``start``, ``start + 1``, ...

        Args:
            start: index of the first slice.
            block: (n, y, x), real numbers; kept as float32.

        Raises:
            ShapeError: the block does not fit the volume.
            DTypeError: the block does not hold real numbers.
            OutputError: it cannot be written, or the volume is not open.
        """
        if self._write is None:
            raise OutputError(f"{self.path}: is not open; write inside its with block")
        slab = np.asarray(block)
        if slab.dtype.kind not in "iuf":
            raise DTypeError(f"{self.path}: block holds {slab.dtype}, wanted float32")
        slices, *frame = self.layout.shape
        if slab.ndim != 3 or list(slab.shape[1:]) != frame or slab.shape[0] == 0:
            raise ShapeError(
                f"{self.path}: block has shape {slab.shape}, wanted (n, {frame[0]}, {frame[1]})"
            )
        stop = start + slab.shape[0]
        if not 0 <= start < stop <= slices:
            raise ShapeError(
                f"{self.path}: slices {start} to {stop} do not exist, the volume has {slices}"
            )
        self._write(start, np.ascontiguousarray(slab, np.float32))
        self._written[start:stop] = True


def _format_of(path: Path) -> str:
    if not path.is_dir():
        path.stat()
        return "h5"
    if any((path / name).is_file() for name in ("zarr.json", ".zarray")):
        return "zarr"
    if (path / "slice_00000.tif").is_file():
        return "tiff"
    raise FileFormatError(f"{path}: holds neither slices (slice_00000.tif, ...) nor a Zarr array")


def _module(format: str) -> _Format:
    return cast(_Format, importlib.import_module(_MODULES[format]))


def _three(values: Sequence[Any]) -> tuple[Any, Any, Any]:
    z, y, x = values
    return z, y, x
