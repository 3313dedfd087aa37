"""Volumes (z, y, x), written while they grow and read back whole.

A volume is often larger than memory, so it is handed over in slabs of slices. Whatever the format,
nothing carries the final name before every slice is on the disk, and equal volumes give equal
bytes.
"""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import (
    DTypeError,
    FileFormatError,
    InputError,
    NonFiniteError,
    OutputError,
    ShapeError,
)
from rift_cl.geometry import Grid
from rift_cl.geometry.numbers import real_numbers
from rift_cl.io.boundary import reading
from rift_cl.io.npy_file import SIGNATURE
from rift_cl.io.output import check_space, leftovers
from rift_cl.io.scans.tiff_folder import tiff_names
from rift_cl.io.volumes.layout import Floats, VolumeLayout, VolumePlace, WriteSlab
from rift_cl.io.volumes.sample_window import SampleWindow

Format = Literal["tiff", "tiff-stack", "zarr", "h5", "mrc"]
# What is read besides.
Readable = Format | Literal["npy"]
SampleType = Literal["float32", "uint16", "uint8"]

# What a volume is usually called, by format.
VOLUME_NAMES: dict[Format, str] = {
    "tiff": "slices",
    "tiff-stack": "volume.tif",
    "zarr": "volume.zarr",
    "h5": "volume.h5",
    "mrc": "volume.mrc",
}
# The libraries behind the formats take up to a second to load: only the one in use is.
_MODULES = {
    "tiff": "tiff_slices",
    "tiff-stack": "tiff_stack",
    "zarr": "ome_zarr",
    "h5": "hdf5",
    "mrc": "mrc",
    "npy": "npy",
}
_HEADER_ROOM = 1 << 16
_SLICE_ROOM = 1 << 12
# Formats that keep coarser copies as well: a quarter, a sixteenth, ... at most.
_COPIES = {"zarr": 4 / 3}
_MRC_MARK = (208, b"MAP")


def other_volumes(format: Format) -> list[str]:
    """Names of volumes in other formats, and of what writing one leaves where it is killed."""
    names = [name for other, name in VOLUME_NAMES.items() if other != format]
    return [*names, *(left for name in names for left in leftovers(name))]


class _Format(Protocol):
    def staged_volume(
        self, path: Path, layout: VolumeLayout
    ) -> AbstractContextManager[WriteSlab]: ...

    def load_volume(self, path: Path, *, budget: int | None) -> Floats: ...


def open_volume(
    path: str | os.PathLike[str],
    shape: Sequence[int],
    *,
    format: Format,
    spacing: float | Sequence[float],
    unit: str = "",
    origin: float | Sequence[float] = 0.0,
    dtype: SampleType = "float32",
    window: tuple[float, float] | None = None,
    attenuation: bool = True,
) -> VolumeWriter:
    """Prepare to write a volume; nothing is written before the ``with`` block begins.

    Args:
        path: a folder of slices (tiff), a store (zarr) or a file (the others). An earlier volume
            there is replaced when the new one is complete; a folder that holds anything else is
            refused.
        shape: (z, y, x).
        format: "tiff", a folder of slices ``slice_00000.tif``; "tiff-stack", one TIFF file of many
            pages; both with ImageJ's notes. "zarr", OME-Zarr 0.4 with coarser copies; "h5", one
            HDF5 dataset ``/volume``; "mrc", MRC2014.
        spacing: distance between samples, one number or one for each of (z, y, x).
        unit: unit of the spacing, such as "mm".
        origin: position of the first sample, one number or one for each of (z, y, x), in the same
            unit.
        dtype: type of the samples in the file.
        window: for integers, the values that the least and the greatest integer stand for; values
            in between are rounded to the nearest, others are clipped and counted.
        attenuation: whether the values are attenuation per unit of length; others are noted to have
            no unit.

    Returns:
        A context manager; leaving it without an exception makes the volume appear.

    Raises:
        InputError: the format or type is unknown, shape, spacing or window cannot be used, or the
            format has no such samples.
        OutputError: the disk has too little room.
    """
    path = Path(path)
    if format not in VOLUME_NAMES:
        raise InputError(f"{path}: format is {format!r}, wanted one of {', '.join(VOLUME_NAMES)}")
    grid = Grid(shape, spacing)
    if len(grid.shape) != 3:
        raise ShapeError(f"{path}: shape is {grid.shape}, a volume has (z, y, x)")
    first = Grid(grid.shape, grid.spacing, origin).center
    layout = VolumeLayout(
        _three(grid.shape),
        _three(grid.spacing),
        unit,
        _three(first),
        _window(path, dtype, window),
        attenuation,
    )
    if format == "mrc" and dtype == "uint8":
        raise InputError(f"{path}: MRC has no unsigned 8-bit samples; choose uint16")
    size = math.ceil(layout.size * _COPIES.get(format, 1))
    check_space(path, size + _HEADER_ROOM + _SLICE_ROOM * layout.shape[0])
    return VolumeWriter(path, layout, _module(format).staged_volume(path, layout))


def read_volume(path: str | os.PathLike[str], *, budget: int | None = None) -> Floats:
    """Read a whole volume (z, y, x), float32, that ``open_volume`` wrote in any of its formats.

    Also NumPy's .npy, TIFF files of plain pages and folders of numbered TIFF slices of other
    programs. Integers are turned back into the values that they stand for.

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


def read_volume_place(path: str | os.PathLike[str]) -> VolumePlace:
    """Where the samples of a volume stand that ``open_volume`` wrote as "zarr" or "h5".

    Spacing 1, origin 0 and no unit where the file does not say, or is of another format.

    Args:
        path: the folder, store or file.

    Raises:
        InputError: there is nothing of that name.
        FileFormatError: it is damaged, or no volume.
    """
    path = Path(path)
    with reading(path, "the volume"):
        load = getattr(_module(_format_of(path)), "load_place", None)
        place: VolumePlace = VolumePlace() if load is None else load(path)
    return place


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
        self._clipped = np.zeros((2, layout.shape[0]), np.int64)

    @property
    def clipped(self) -> tuple[int, int]:
        """How many samples were clipped at the lower and at the upper end of the window."""
        below, above = (int(count) for count in self._clipped.sum(axis=1))
        return below, above

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
            block: (n, y, x), real numbers.

        Raises:
            ShapeError: the block does not fit the volume.
            DTypeError: the block does not hold real numbers.
            NonFiniteError: it holds NaN, and the volume integers.
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
        self._write(start, self._stored(start, np.ascontiguousarray(slab, np.float32)))
        self._written[start:stop] = True

    def _stored(self, start: int, slab: Floats) -> NDArray[Any]:
        """The slab in the type of the file."""
        dtype, window = self.layout.dtype, self.layout.window
        if window is None:
            return slab.astype(dtype, copy=False)
        stored = np.empty(slab.shape, dtype)
        for index, image in enumerate(slab):
            try:
                stored[index], *self._clipped[:, start + index] = window.integers(image)
            except NonFiniteError as error:
                raise NonFiniteError(f"{self.path}: in slice {start + index} {error}") from None
        return stored


def _window(
    path: Path, dtype: SampleType, window: tuple[float, float] | None
) -> SampleWindow | None:
    if dtype == "float32":
        if window is not None:
            raise InputError(f"{path}: a window is for uint16 and uint8; float32 needs none")
        return None
    if dtype not in ("uint16", "uint8"):
        raise InputError(f"{path}: dtype is {dtype!r}, wanted float32, uint16 or uint8")
    if window is None:
        raise InputError(f"{path}: {dtype} needs a window, the values of 0 and of its largest")
    ends = real_numbers(window)
    if ends is None or ends.shape != (2,):
        raise InputError(f"{path}: window is {window!r}, wanted two numbers, the lower end first")
    return SampleWindow(dtype, float(ends[0]), float(ends[1]))


def _format_of(path: Path) -> Readable:
    if path.is_dir():
        if any((path / name).is_file() for name in ("zarr.json", ".zgroup", ".zarray")):
            return "zarr"
        if tiff_names(path):
            return "tiff"
        raise FileFormatError(
            f"{path}: holds neither slices (slice_00000.tif, ...) nor a Zarr array"
        )
    with path.open("rb") as file:
        start = file.read(_MRC_MARK[0] + len(_MRC_MARK[1]))
    if start[:2] in (b"II", b"MM"):
        return "tiff-stack"
    if start.startswith(SIGNATURE):
        return "npy"
    if start[_MRC_MARK[0] :] == _MRC_MARK[1]:
        return "mrc"
    import h5py

    if h5py.is_hdf5(path):
        return "h5"
    raise FileFormatError(
        f"{path}: is no volume, or a damaged one: wanted TIFF, HDF5, MRC or .npy, or a folder of "
        "TIFF slices or a Zarr store"
    )


def _module(format: Readable) -> _Format:
    return cast(_Format, importlib.import_module(f"{__package__}.{_MODULES[format]}"))


def _three(values: Sequence[Any]) -> tuple[Any, Any, Any]:
    z, y, x = values
    return z, y, x
