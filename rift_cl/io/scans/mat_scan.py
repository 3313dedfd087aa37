"""Finds the scan in a MAT file of MATLAB, of version 5 to 7 or of version 7.3."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim
from rift_cl.io.hdf5_tree import open_tree
from rift_cl.io.scans.frame_stack import FrameStack, StackedRows
from rift_cl.io.scans.hdf5_frames import Hdf5Rows
from rift_cl.io.scans.mat5 import Mat5File
from rift_cl.io.scans.mat73 import Mat73File
from rift_cl.io.scans.mat_layout import MatStore, find_layout
from rift_cl.io.scans.named_arrays import scan_in
from rift_cl.io.scans.scan_file import Frames, Part, RowSource, ScanFile, ScanRequest, ScanRows


class Mat5Rows(StackedRows):
    """Reads rows of a scan in a MAT file of version 5 (a ``RowSource``); arrays come whole."""

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        file = self._opened()
        stacks = [stack for stack in (self.projections, self.flats, self.darks) if stack]
        rows = sum(4 * math.prod(stack.shape) for stack in stacks)
        need = rows + 2 * max(file.arrays[stack.name].size for stack in stacks)
        check_claim(self.path, "the scan", need, self.budget)
        chosen = slice(start, stop)
        return ScanRows(
            _frames(file, self.projections, chosen),
            _frames(file, self.flats, chosen) if self.flats else None,
            _frames(file, self.darks, chosen) if self.darks else None,
        )

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames of one stack; its array is loaded whole."""
        return _frames(self._opened(), getattr(self, part), list(rows), list(frames))

    def _opened(self) -> Mat5File:
        file = Mat5File(self.path, self.budget)
        for stack in (self.projections, self.flats, self.darks):
            array = file.arrays.get(stack.name) if stack else None
            if stack and (array is None or array.shape != stack.shape or not array.real):
                raise FileFormatError(
                    f"{self.path}: {stack.name!r} changed since it was opened; open the scan again"
                )
        return file


def open_mat5_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan in a MAT file of version 5 to 7; see ``open_scan``."""

    def rows(
        projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
    ) -> RowSource:
        return Mat5Rows(path, projections, flats, darks, budget)

    file = Mat5File(path, budget)
    store = MatStore(file, rows)
    return scan_in(store, find_layout(store, request), request)


def open_mat73_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan in a MAT file of version 7.3; see ``open_scan``."""
    with open_tree(path) as tree:
        file = Mat73File(tree)

        def rows(
            projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
        ) -> RowSource:
            return Hdf5Rows(
                path,
                file.stored(projections),
                flats and file.stored(flats),
                darks and file.stored(darks),
                budget,
            )

        store = MatStore(file, rows)
        return scan_in(store, find_layout(store, request), request)


def _frames(
    file: Mat5File, stack: FrameStack, rows: slice | list[int], frames: list[int] | None = None
) -> Frames:
    places = stack.indices()
    values = stack.arranged(file.load(stack.name))
    with np.errstate(over="ignore"):
        chosen = values[places if frames is None else places[frames]]
        return np.array(chosen[:, rows], dtype=np.float32, order="C")
