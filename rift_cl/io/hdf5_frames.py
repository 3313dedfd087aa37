"""Frames in HDF5 datasets: described first, read later, a few rows at a time.

A stack of frames is a dataset and the runs of its first axis that belong together, because NXtomo
keeps projections, flats and darks in one array.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, ShapeError
from rift_cl.io.boundary import check_claim
from rift_cl.io.hdf5_tree import Hdf5Tree, open_tree
from rift_cl.io.hdf5_values import numeric_shape
from rift_cl.io.scan_file import Frames, ScanRows

_AXES = {3: "nrb", 2: "nb"}


@dataclass(frozen=True)
class FrameStack:
    """Frames of one kind inside a dataset.

    Args:
        dataset: name of the dataset.
        shape: shape of the whole dataset, to notice when it changes.
        axes: one letter per axis of the dataset: n frame, r row, b bin. MATLAB's are in the
            opposite order.
        runs: (start, stop) along the frame axis, in order.
    """

    dataset: str
    shape: tuple[int, ...]
    axes: str
    runs: tuple[tuple[int, int], ...]

    @property
    def frames(self) -> int:
        """Number of frames in the stack."""
        return sum(stop - start for start, stop in self.runs)

    @property
    def rows(self) -> int:
        """Number of detector rows."""
        return self.shape[self.axes.index("r")] if "r" in self.axes else 1

    @property
    def bins(self) -> int:
        """Number of detector bins."""
        return self.shape[self.axes.index("b")]


@dataclass(frozen=True)
class Hdf5Rows:
    """Reads rows of a scan in an HDF5 file (a ``RowSource``).

    Args:
        path: the file.
        projections: the projections.
        flats: the frames without the sample, if there are any.
        darks: the frames without the beam, if there are any.
        budget: bytes that one reading may take; 60 % of the free memory when None.
    """

    path: Path
    projections: FrameStack
    flats: FrameStack | None
    darks: FrameStack | None
    budget: int | None

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        stacks = (self.projections, self.flats, self.darks)
        with open_tree(self.path) as tree:
            nodes = [_unchanged(tree, stack) if stack else None for stack in stacks]
            need = sum(
                _claim(node, stack, stop - start)
                for node, stack in zip(nodes, stacks, strict=True)
                if stack is not None
            )
            check_claim(self.path, f"rows {start} to {stop} of the scan", need, self.budget)
            projections = _read(nodes[0], self.projections, start, stop)
            flats = _read(nodes[1], self.flats, start, stop) if self.flats else None
            darks = _read(nodes[2], self.darks, start, stop) if self.darks else None
        return ScanRows(projections, flats, darks)


def projection_stack(tree: Hdf5Tree, name: str) -> FrameStack:
    """Describe a dataset (angle, row, bin) or, as a scan of one row, (angle, bin).

    Raises:
        FileFormatError: there is no such dataset.
        DTypeError: it does not hold real numbers.
        ShapeError: it has other axes, or an empty one.
    """
    shape = numeric_shape(tree, name)
    if len(shape) not in _AXES:
        raise ShapeError(
            f"{tree.path}: {name!r} has shape {shape}, wanted (angle, row, bin) or (angle, bin)"
        )
    return FrameStack(name, shape, _AXES[len(shape)], ((0, shape[0]),))


def calibration_stack(tree: Hdf5Tree, name: str, projections: FrameStack) -> FrameStack:
    """Describe flats or darks: frames like the projections, or one without the frame axis.

    Raises:
        FileFormatError: there is no such dataset.
        DTypeError: it does not hold real numbers.
        ShapeError: the frames are not of the projections' size.
    """
    shape = numeric_shape(tree, name)
    frame = projections.shape[1:]
    axes = projections.axes if len(shape) > len(frame) else projections.axes[1:]
    if shape[-len(frame) :] != frame or len(shape) != len(axes):
        raise ShapeError(
            f"{tree.path}: {name!r} has shape {shape}, the projections {projections.dataset!r} "
            f"have {projections.shape}: rows and bins must agree"
        )
    return FrameStack(name, shape, axes, ((0, shape[0] if "n" in axes else 1),))


def runs_of(indices: NDArray[np.intp]) -> tuple[tuple[int, int], ...]:
    """Cut rising indices into runs (start, stop) of consecutive ones."""
    edges = np.flatnonzero(np.diff(indices) > 1) + 1
    return tuple((int(run[0]), int(run[-1]) + 1) for run in np.split(indices, edges) if run.size)


def _unchanged(tree: Hdf5Tree, stack: FrameStack) -> Any:
    node = tree.dataset(stack.dataset)
    if node.shape != stack.shape:
        raise FileFormatError(
            f"{tree.path}: {stack.dataset!r} had shape {stack.shape} when it was opened and has "
            f"{node.shape} now; open the scan again"
        )
    return node


def _claim(node: Any, stack: FrameStack, rows: int) -> int:
    # A compressed chunk is unpacked whole, however few of its rows are wanted.
    chunk = math.prod(node.chunks) * node.dtype.itemsize if node.chunks else 0
    rest = 4 * rows * stack.bins
    # Frames in another order are read as they are stored, and then turned.
    turned = 0 if _in_order(stack) else stack.frames * rest
    return stack.frames * rest + chunk + turned


def _in_order(stack: FrameStack) -> bool:
    return stack.axes in ("nrb", "nb", "rb", "b")


def _read(node: Any, stack: FrameStack, start: int, stop: int) -> Frames:
    rows = stop - start
    frames = np.empty((stack.frames, rows, stack.bins), np.float32)
    done = 0
    for first, last in stack.runs:
        ranges = {"n": slice(first, last), "r": slice(start, stop), "b": slice(None)}
        selection = tuple(ranges[axis] for axis in stack.axes)
        block = frames[done : done + last - first]
        sizes = {"n": last - first, "r": rows, "b": stack.bins}
        shape = [sizes[axis] for axis in stack.axes]
        if _in_order(stack):
            node.read_direct(block.reshape(shape), selection)
        else:
            stored = np.empty(shape, np.float32)
            node.read_direct(stored, selection)
            order = [stack.axes.index(axis) for axis in "nrb" if axis in stack.axes]
            block[:] = stored.transpose(order).reshape(block.shape)
        done += last - first
    return frames
