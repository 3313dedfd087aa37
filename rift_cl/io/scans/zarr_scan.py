"""Finds the scan in a Zarr store: our own names, those of Data Exchange, or arrays that are named.

A store (a folder ``.zarr``, of Zarr 2 or 3) is a group with the arrays that an NPZ file would have,
in chunks, so that several processes read their rows side by side; or it has the names of Data
Exchange, ``exchange/data``, ``exchange/theta`` and the like; or it is an image of OME-Zarr, or a
single array, whose angles are named. Axes are those of ``_ARRAY_DIMENSIONS`` (as xarray writes) or
of ``dimension_names``. Zarr leaves out chunks that are all zero, and takes those that were lost for
such: of darks they are, of all else one that is missing is an error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, PathEscapeError, ShapeError
from rift_cl.io.boundary import HOW_TO_NAME, check_claim, check_numeric, reading
from rift_cl.io.scans.angle_list import AngleList, stated_unit
from rift_cl.io.scans.axes import spelled
from rift_cl.io.scans.frame_stack import FrameStack, StackedRows
from rift_cl.io.scans.named_arrays import Layout, scan_in
from rift_cl.io.scans.own_layout import PROJECTIONS, own_layout
from rift_cl.io.scans.scan_file import Frames, Part, ScanFile, ScanRequest, ScanRows
from rift_cl.io.zarr_store import (
    ARRAY_2,
    GROUP_2,
    NODE_3,
    check_codecs,
    check_entries,
    read_header,
)

_EXCHANGE = "exchange/data"
_BESIDE_EXCHANGE = {
    "theta": "exchange/theta",
    "flats": "exchange/data_white",
    "darks": "exchange/data_dark",
}
# The name of an array that is a store by itself.
_ALONE = "."
_LONGEST_VECTOR = 64 << 20
# Chunks that Zarr holds unpacked at the same time besides what is returned, at most.
_AT_ONCE = 16
_LISTED = 20


def is_zarr(path: Path) -> bool:
    """Whether a folder is a Zarr store."""
    return any((path / name).is_file() for name in (GROUP_2, ARRAY_2, NODE_3))


def open_zarr_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan in a Zarr store; see ``open_scan``."""
    with reading(path, "the Zarr store"):
        check_entries(path)
        store = ZarrStore(path, budget)
        return scan_in(store, _layout(store, request.dataset), request)


def _layout(store: ZarrStore, dataset: str | None) -> Layout:
    """What there is to know of the store before anything is named."""
    if dataset is None and not any(name in store for name in PROJECTIONS):
        if _EXCHANGE in store:
            there: dict[str, Any] = {
                part: name for part, name in _BESIDE_EXCHANGE.items() if name in store
            }
            usual = {2: "nb", 3: store.axes(_EXCHANGE) or "nrb"}
            return Layout(source="Data Exchange", projections=_EXCHANGE, axes=usual, **there)
        image = store.image()
        if image is not None:
            return Layout(source="Zarr", projections=image, search=True)
    return own_layout(store, "Zarr", dataset)


@dataclass(frozen=True)
class ZarrStore:
    """The arrays of a Zarr store (an ``ArrayStore``), whose entries were checked.

    Args:
        path: the folder.
        budget: bytes that one reading may take.
    """

    path: Path
    budget: int | None

    def __contains__(self, name: str) -> bool:
        try:
            return _is_array(self._place(name))
        except (PathEscapeError, ValueError, OSError):
            return False

    def array(self, name: str) -> Any:
        """An array, open for reading.

        Raises:
            FileFormatError: there is none of that name, or it is packed in a strange way.
            PathEscapeError: the name leads outside the store.
        """
        import zarr

        place = self._place(name)
        if not _is_array(place):
            raise FileFormatError(f"{self.path}: has no array {name!r}; {self.contents()}")
        check_codecs(place)
        return zarr.open_array(str(place), mode="r")

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of an array of real numbers, none of whose axes is empty."""
        array = self.array(name)
        check_numeric(self.path, name, array.dtype)
        if 0 in array.shape:
            raise ShapeError(f"{self.path}: {name!r} has shape {array.shape}, it holds nothing")
        return tuple(int(n) for n in array.shape)

    def dtype(self, name: str) -> np.dtype[np.generic]:
        """Type of the numbers as they are stored."""
        dtype: np.dtype[np.generic] = np.dtype(self.array(name).dtype)
        return dtype

    def vector(self, name: str) -> NDArray[np.float64]:
        """An array of one number per frame; axes of length 1 are dropped."""
        shape = self.shape(name)
        size = math.prod(shape)
        if size != max(shape, default=1):
            raise ShapeError(
                f"{self.path}: {name!r} has shape {shape}, wanted one number per frame"
            )
        array = self.array(name)
        check_claim(self.path, f"{name!r}", 8 * max(size, _chunk(array)), _LONGEST_VECTOR)
        _check_chunks(self._place(name), array, tuple(slice(0, n) for n in shape))
        return np.asarray(array[...], np.float64).reshape(size)

    def angles(self, name: str) -> AngleList:
        """The angles in an array, in the unit that its attribute or its name states."""
        return AngleList(
            name, self.vector(name), unit=stated_unit(self.path, name, self.unit(name))
        )

    def unit(self, name: str) -> str:
        """The attribute ``units``."""
        return str(_attributes(self._place(name)).get("units", ""))

    def axes(self, name: str) -> str | None:
        """The letters of the axes that the array names, or None."""
        place = self._place(name)
        named: Any = _attributes(place).get("_ARRAY_DIMENSIONS")
        if named is None and (place / NODE_3).is_file():
            named = read_header(place / NODE_3).get("dimension_names")
        return spelled(" ".join(map(str, named))) if isinstance(named, list) and named else None

    def beside(self, name: str) -> list[str]:
        """Names of the arrays in the same group."""
        group = name.rpartition("/")[0]
        folder = self._place(group or _ALONE)
        if _is_array(folder) or not folder.is_dir():
            return []
        places = sorted(place for place in folder.iterdir() if _is_array(place))
        return [place.relative_to(self.path.resolve()).as_posix() for place in places]

    def contents(self) -> str:
        """What arrays there are, and how to name them."""
        listed = [f"{name!r} {tuple(self.array(name).shape)}" for name in self._names()]
        more = "" if len(listed) < _LISTED else " and more"
        return f"it holds {', '.join(listed) or 'no array'}{more}; {HOW_TO_NAME}"

    def image(self) -> str | None:
        """The array that stands for the store: itself, or the finest of OME-Zarr."""
        if _is_array(self.path):
            return _ALONE
        attributes = _attributes(self.path)
        try:
            return str(attributes.get("ome", attributes)["multiscales"][0]["datasets"][0]["path"])
        except (KeyError, IndexError, TypeError):
            return None

    def rows(
        self, projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
    ) -> ZarrRows:
        """What reads these stacks."""
        return ZarrRows(self.path, projections, flats, darks, self.budget)

    def _names(self) -> list[str]:
        found: list[str] = []
        folders = [self.path.resolve()]
        while folders and len(found) < _LISTED:
            place = folders.pop(0)
            if _is_array(place):
                found.append(place.relative_to(self.path.resolve()).as_posix())
            else:
                folders += sorted(entry for entry in place.iterdir() if entry.is_dir())
        return found

    def _place(self, name: str) -> Path:
        root = self.path.resolve()
        place = (root / name.strip("/")).resolve()
        if not place.is_relative_to(root):
            raise PathEscapeError(f"{self.path}: {name!r} leads outside the store")
        return place


class ZarrRows(StackedRows):
    """Reads rows of a scan in a Zarr store (a ``RowSource``), a run of chunks at a time."""

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the store, in order."""
        return tuple(sorted(path for path in self.path.rglob("*") if path.is_file()))

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        with reading(self.path, "the Zarr store"):
            stacks = [stack for stack in (self.projections, self.flats, self.darks) if stack]
            arrays = {stack.name: self._array(stack) for stack in stacks}
            need = sum(
                4 * stack.frames * (stop - start) * stack.bins
                + _block_bytes(arrays[stack.name], stack, stop - start)
                for stack in stacks
            )
            check_claim(self.path, f"rows {start} to {stop} of the scan", need, self.budget)
            rows = {"r": slice(start, stop), "b": slice(None)}
            found = [
                self._frames(arrays[stack.name], stack, rows) if stack else None
                for stack in (self.projections, self.flats, self.darks)
            ]
        assert found[0] is not None
        return ScanRows(found[0], found[1], found[2])

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames of one stack."""
        stack: FrameStack = getattr(self, part)
        with reading(self.path, "the Zarr store"):
            array = self._array(stack)
            found = np.empty((len(frames), len(rows), stack.bins), np.float32)
            need = found.nbytes + _block_bytes(array, stack, 1)
            check_claim(self.path, f"a part of {stack.name!r}", need, self.budget)
            places = stack.indices()[list(frames)]
            for (i, n), (j, r) in product(enumerate(places), enumerate(rows)):
                chosen = {"n": slice(n, n + 1), "r": slice(r, r + 1), "b": slice(None)}
                found[i, j] = self._block(array, stack, chosen)[0, 0]
        return found

    def _frames(self, array: Any, stack: FrameStack, chosen: dict[str, slice]) -> Frames:
        rows = chosen["r"].stop - chosen["r"].start
        frames, done = np.empty((stack.frames, rows, stack.bins), np.float32), 0
        for first, stop in _frame_runs(array, stack):
            block = self._block(array, stack, {**chosen, "n": slice(first, stop)})
            frames[done : done + stop - first] = block
            done += stop - first
        return frames

    def _block(self, array: Any, stack: FrameStack, chosen: dict[str, slice]) -> NDArray[Any]:
        """A part of an array, as (frame, row, bin)."""
        selection = tuple(
            slice(*chosen[axis].indices(size))
            for axis, size in zip(stack.axes, array.shape, strict=True)
        )
        if self.darks is None or stack.name != self.darks.name:
            _check_chunks(ZarrStore(self.path, None)._place(stack.name), array, selection)
        with np.errstate(over="ignore"):
            return stack.arranged(np.asarray(array[selection], np.float32))

    def _array(self, stack: FrameStack) -> Any:
        array = ZarrStore(self.path, self.budget).array(stack.name)
        if tuple(array.shape) != stack.shape:
            raise FileFormatError(
                f"{self.path}: {stack.name!r} had shape {stack.shape} when it was opened and has "
                f"{tuple(array.shape)} now; open the scan again"
            )
        return array


def _frame_runs(array: Any, stack: FrameStack) -> Iterator[tuple[int, int]]:
    """Runs of frames that lie in the same chunks."""
    each = int(array.chunks[stack.axes.index("n")]) if "n" in stack.axes else 1
    for first, stop in stack.runs:
        seams = range((first // each + 1) * each, stop, each)
        yield from pairwise((first, *seams, stop))


def _block_bytes(array: Any, stack: FrameStack, rows: int) -> int:
    """Bytes of the rows of a run of frames, as stored and as numbers, and of their chunks."""
    frames = int(array.chunks[stack.axes.index("n")]) if "n" in stack.axes else 1
    item = int(np.dtype(array.dtype).itemsize)
    return (item + 4) * frames * rows * stack.bins + _AT_ONCE * item * _chunk(array)


def _chunk(array: Any) -> int:
    return math.prod(int(n) for n in array.chunks)


def _is_array(place: Path) -> bool:
    if (place / ARRAY_2).is_file():
        return True
    header = place / NODE_3
    return header.is_file() and read_header(header).get("node_type") == "array"


def _attributes(place: Path) -> dict[str, Any]:
    if (place / NODE_3).is_file():
        found = read_header(place / NODE_3).get("attributes", {})
        return found if isinstance(found, dict) else {}
    return read_header(place / ".zattrs") if (place / ".zattrs").is_file() else {}


def _check_chunks(place: Path, array: Any, selection: tuple[slice, ...]) -> None:
    """Make sure that the chunks of a selection are there.

    Raises:
        FileFormatError: one is missing.
    """
    version_3 = (place / NODE_3).is_file()
    header = read_header(place / (NODE_3 if version_3 else ARRAY_2))
    if version_3:
        encoding = header.get("chunk_key_encoding", {})
        default = encoding.get("name") == "default"
        separator = encoding.get("configuration", {}).get("separator", "/" if default else ".")
        prefix = ["c"] if default else []
    else:
        separator, prefix = header.get("dimension_separator", "."), []
    if separator not in ("/", "."):
        raise FileFormatError(f"{place}: separates the numbers of chunks by {separator!r}")
    runs = (
        range(part.start // chunk, -(-part.stop // chunk))
        for part, chunk in zip(selection, array.chunks, strict=True)
    )
    for numbers in product(*runs):
        name = separator.join([*prefix, *map(str, numbers)])
        if not (place / name).is_file():
            raise FileFormatError(
                f"{place}: the chunk {name} is missing, which Zarr takes for zeros, as a chunk of "
                "zeros alone that zarr-python left out, or one that was lost: write the array with "
                "config={'write_empty_chunks': True} (write_empty_chunks=True in zarr 2), or copy "
                "the store again"
            )
