"""Frames in HDF5 datasets: described first, read later, a few rows at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim
from rift_cl.io.scans.frame_stack import FrameStack, StackedRows
from rift_cl.io.scans.hdf5_places import Hdf5Files, open_files
from rift_cl.io.scans.scan_file import Frames, Part, ScanRows


class Hdf5Rows(StackedRows):
    """Reads rows of a scan in an HDF5 file (a ``RowSource``)."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The scan's file, and every other in which the frames are stored or that leads to them."""
        with open_files(self.path) as files:
            for stack in (self.projections, self.flats, self.darks):
                if stack is not None:
                    _unchanged(files, stack)
            return (self.path, *files.others)

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        stacks = (self.projections, self.flats, self.darks)
        with open_files(self.path) as files:
            nodes = [_unchanged(files, stack) if stack else None for stack in stacks]
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

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames of one stack; a chunk is unpacked as seldom as can be."""
        stack = getattr(self, part)
        shape = (len(frames), len(rows), stack.bins)
        with open_files(self.path) as files:
            node = _unchanged(files, stack)
            need = 8 * math.prod(shape) + _chunk(node)
            check_claim(self.path, f"a part of {stack.name!r}", need, self.budget)
            places = [int(place) for place in stack.indices()[list(frames)]]
            chosen: dict[str, list[Any]] = {"n": places, "r": list(rows), "b": [slice(None)]}
            along = "r" if "r" in stack.axes and _chunk_size(node, stack, "n") > 1 else "n"
            found = np.empty(shape, np.float32)
            for index, place in enumerate(chosen[along]):
                block = found[index : index + 1] if along == "n" else found[:, index : index + 1]
                block[:] = _line(node, stack, {**chosen, along: [place]})
        return found


def _line(node: Any, stack: FrameStack, chosen: dict[str, list[Any]]) -> Frames:
    """A selection in which one axis at most has several places, as (frame, row, bin)."""
    several = {axis: places for axis, places in chosen.items() if axis in stack.axes}
    single = {axis: places[0] if len(places) == 1 else places for axis, places in several.items()}
    with np.errstate(over="ignore"):
        values = np.asarray(node[tuple(single[axis] for axis in stack.axes)], np.float32)
    sizes = [stack.bins if axis == "b" else len(chosen[axis]) for axis in stack.axes]
    return stack.arranged(values.reshape(sizes))


def _chunk_size(node: Any, stack: FrameStack, axis: str) -> int:
    return int(node.chunks[stack.axes.index(axis)]) if node.chunks else 1


def _unchanged(files: Hdf5Files, stack: FrameStack) -> Any:
    tree, name = files.at(stack.name)
    node = tree.dataset(name)
    if node.shape != stack.shape:
        raise FileFormatError(
            f"{tree.path}: {stack.name!r} had shape {stack.shape} when it was opened and has "
            f"{node.shape} now; open the scan again"
        )
    return node


def _claim(node: Any, stack: FrameStack, rows: int) -> int:
    # A compressed chunk is unpacked whole, however few of its rows are wanted.
    rest = 4 * rows * stack.bins
    # Frames in another order are read as they are stored, and then turned.
    turned = 0 if stack.in_order else stack.frames * rest
    return stack.frames * rest + _chunk(node) + turned


def _chunk(node: Any) -> int:
    return int(math.prod(node.chunks) * node.dtype.itemsize) if node.chunks else 0


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
        if stack.in_order:
            node.read_direct(block.reshape(shape), selection)
        else:
            stored = np.empty(shape, np.float32)
            node.read_direct(stored, selection)
            block[:] = stack.arranged(stored)
        done += last - first
    return frames
