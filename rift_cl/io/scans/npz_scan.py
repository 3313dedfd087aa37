"""Finds the scan in an NPZ file: ``projections`` or ``sinogram``, and ``angles`` in radians."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.npz_archive import NpzArchive
from rift_cl.io.scans.angle_list import AngleList, named_unit
from rift_cl.io.scans.frame_stack import FrameStack, StackedRows
from rift_cl.io.scans.named_arrays import scan_in
from rift_cl.io.scans.own_layout import PROJECTIONS, own_layout
from rift_cl.io.scans.scan_file import Frames, Part, ScanFile, ScanRequest, ScanRows

# Eight million projections: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST_VECTOR = 64 << 20


# The array that names the unit of lengths.
_UNIT = "unit"


class NpzRows(StackedRows):
    """Reads rows of a scan in an NPZ file (a ``RowSource``); each array is loaded whole."""

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        stacks = [stack for stack in (self.projections, self.flats, self.darks) if stack]
        with _open(self.path) as archive:
            _demand_unchanged(archive, self.projections)
            headers = [archive.header(stack.name) for stack in stacks]
            kept = sum(4 * math.prod(header.shape) for header in headers)
            check_claim(self.path, "the scan", kept + max(h.size for h in headers), self.budget)
            rows = slice(start, stop)
            return ScanRows(
                self._frames(archive, self.projections, rows),
                self._frames(archive, self.flats, rows) if self.flats else None,
                self._frames(archive, self.darks, rows) if self.darks else None,
            )

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames of one stack; its array is loaded whole."""
        stack = getattr(self, part)
        with _open(self.path) as archive:
            _demand_unchanged(archive, stack)
            return self._frames(archive, stack, list(rows), list(frames))

    def _frames(
        self,
        archive: NpzArchive,
        stack: FrameStack,
        rows: slice | list[int],
        frames: list[int] | None = None,
    ) -> Frames:
        values = stack.arranged(archive.load(stack.name, budget=self.budget))
        places = stack.indices()
        whole = len(stack.runs) == 1 and places.size == values.shape[0]
        if frames is not None or not whole:
            values = values[places if frames is None else places[frames]]
        with np.errstate(over="ignore"):
            return np.array(values[:, rows, :], dtype=np.float32, order="C")


def _demand_unchanged(archive: NpzArchive, stack: FrameStack) -> None:
    if archive.header(stack.name).shape != stack.shape:
        raise FileFormatError(
            f"{archive.path}: {stack.name!r} changed its shape since it was opened; open the scan "
            "again"
        )


def open_npz_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan in an NPZ file; see ``open_scan``."""
    with _open(path) as archive:
        store = NpzStore(archive, budget)
        layout = own_layout(store, "NPZ", request.dataset)
        if request.geometry is not None and layout.pitch is None:
            # Of parallel rays it would be that of no length.
            layout = replace(layout, unit=store.unit(_UNIT))
        return scan_in(store, layout, request)


@dataclass(frozen=True)
class NpzStore:
    """The arrays of an open NPZ archive (an ``ArrayStore``).

    Args:
        archive: the archive.
        budget: bytes that one reading may take.
    """

    archive: NpzArchive
    budget: int | None

    @property
    def path(self) -> Path:
        """The file."""
        return self.archive.path

    def __contains__(self, name: str) -> bool:
        return name in self.archive

    def shape(self, name: str) -> tuple[int, ...]:
        """See ``NpzArchive.header``."""
        return self.archive.header(name).shape

    def dtype(self, name: str) -> np.dtype[np.generic]:
        """See ``NpzArchive.header``."""
        return self.archive.header(name).dtype

    def vector(self, name: str) -> NDArray[np.float64]:
        """An array of one number per frame."""
        values = self.archive.load(name, budget=_LONGEST_VECTOR)
        if values.size != max(values.shape, default=1):
            raise ShapeError(
                f"{self.path}: {name!r} has shape {values.shape}, wanted one number per projection"
            )
        return np.asarray(values, dtype=np.float64).reshape(values.size)

    def angles(self, name: str) -> AngleList:
        """The angles in an array, in the unit that its name states."""
        return AngleList(name, self.vector(name), unit=named_unit(name))

    def unit(self, name: str) -> str:
        """The text ``unit``, which is that of the file's lengths; of other arrays nothing."""
        return "" if name in PROJECTIONS else self.archive.text(_UNIT)

    def axes(self, name: str) -> str | None:
        """None: NPZ states no axes."""
        return None

    def beside(self, name: str) -> list[str]:
        """Names of all arrays."""
        return self.archive.names()

    def contents(self) -> str:
        """See ``NpzArchive.contents``."""
        return self.archive.contents()

    def rows(
        self, projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
    ) -> NpzRows:
        """What reads these stacks."""
        return NpzRows(self.path, projections, flats, darks, self.budget)


@contextmanager
def _open(path: Path) -> Iterator[NpzArchive]:
    with reading(path, "the NPZ file"), zipfile.ZipFile(path) as archive:
        yield NpzArchive(path, archive)
