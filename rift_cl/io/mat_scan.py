"""Finds the scan in a MAT file of MATLAB, of version 5 to 7 or of version 7.3."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim
from rift_cl.io.hdf5_frames import Hdf5Rows
from rift_cl.io.hdf5_tree import open_tree
from rift_cl.io.mat5 import Mat5File
from rift_cl.io.mat73 import Mat73File
from rift_cl.io.mat_file import MatStack
from rift_cl.io.mat_layout import MatLayout, find_layout
from rift_cl.io.scan_file import ArrayNames, Frames, RowSource, ScanFile, ScanRows


@dataclass(frozen=True)
class Mat5Rows:
    """Reads rows of a scan in a MAT file of version 5 (a ``RowSource``); arrays are loaded whole.

    Args:
        path: the file.
        projections: the projections.
        flats: the frames without the sample, if there are any.
        darks: the frames without the beam, if there are any.
        budget: bytes that one reading may take; 60 % of the free memory when None.
    """

    path: Path
    projections: MatStack
    flats: MatStack | None
    darks: MatStack | None
    budget: int | None

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        file = Mat5File(self.path, self.budget)
        stacks = [stack for stack in (self.projections, self.flats, self.darks) if stack]
        for stack in stacks:
            array = file.arrays.get(stack.name)
            if array is None or array.shape != stack.shape or not array.real:
                raise FileFormatError(
                    f"{self.path}: {stack.name!r} changed since it was opened; open the scan again"
                )
        rows = sum(4 * math.prod(stack.shape) for stack in stacks)
        need = rows + 2 * max(file.arrays[stack.name].size for stack in stacks)
        check_claim(self.path, "the scan", need, self.budget)
        return ScanRows(
            _rows(file, self.projections, start, stop),
            _rows(file, self.flats, start, stop) if self.flats else None,
            _rows(file, self.darks, start, stop) if self.darks else None,
        )


def open_mat5_scan(path: Path, names: ArrayNames, *, budget: int | None) -> ScanFile:
    """Find the scan in a MAT file of version 5 to 7; see ``open_scan``."""
    layout = find_layout(Mat5File(path, budget), names)
    rows = Mat5Rows(path, layout.projections, layout.flats, layout.darks, budget)
    return _scan(path, layout, rows)


def open_mat73_scan(path: Path, names: ArrayNames, *, budget: int | None) -> ScanFile:
    """Find the scan in a MAT file of version 7.3; see ``open_scan``."""
    with open_tree(path) as tree:
        file = Mat73File(tree)
        layout = find_layout(file, names)
        flats = file.frames(layout.flats) if layout.flats else None
        darks = file.frames(layout.darks) if layout.darks else None
        rows = Hdf5Rows(path, file.frames(layout.projections), flats, darks, budget)
    return _scan(path, layout, rows)


def _scan(path: Path, layout: MatLayout, rows: RowSource) -> ScanFile:
    stack = layout.projections
    return ScanFile(
        path=path,
        shape=(stack.size("n"), stack.size("r"), stack.size("b")),
        angles=layout.angles,
        pitch=layout.fan.pitch if layout.fan else None,
        unit=layout.unit,
        kind=layout.kind,
        source=layout.source,
        rows=rows,
        fan=layout.fan,
        background=layout.background,
        notes=layout.notes,
    )


def _rows(file: Mat5File, stack: MatStack, start: int, stop: int) -> Frames:
    values = file.load(stack.name)
    order = [stack.axes.index(axis) for axis in "nrb" if axis in stack.axes]
    shape = (stack.size("n"), stack.size("r"), stack.size("b"))
    with np.errstate(over="ignore"):
        frames = values.transpose(order).reshape(shape)[:, start:stop]
        return np.array(frames, dtype=np.float32, order="C")
