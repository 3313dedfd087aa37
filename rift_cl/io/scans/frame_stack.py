"""Frames inside an array of a file: which of its axes is which, and which frames belong together.

Files keep projections as (angle, row, bin), as sinograms (row, angle, bin), or turned round
altogether, and NXtomo keeps projections, flats and darks in one array.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Runs = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class FrameStack:
    """Frames of one kind inside an array.

    Args:
        name: name of the array.
        shape: shape of the whole array as its file states it, to notice when it changes.
        axes: one letter per axis of the array: n frame, r row, b bin.
        runs: (start, stop) along the frame axis, in order.
    """

    name: str
    shape: tuple[int, ...]
    axes: str
    runs: Runs

    @property
    def frames(self) -> int:
        """Number of frames in the stack."""
        return sum(stop - start for start, stop in self.runs)

    @property
    def rows(self) -> int:
        """Number of detector rows."""
        return self.size("r")

    @property
    def bins(self) -> int:
        """Number of detector bins."""
        return self.size("b")

    @property
    def in_order(self) -> bool:
        """Whether the axes are stored as (frame, row, bin), less those that are missing."""
        return self.axes == "".join(axis for axis in "nrb" if axis in self.axes)

    def size(self, axis: str) -> int:
        """Length of an axis of the array; 1 where it has none."""
        return self.shape[self.axes.index(axis)] if axis in self.axes else 1

    def indices(self) -> NDArray[np.intp]:
        """Where along the frame axis each frame of the stack is."""
        return np.concatenate([np.arange(start, stop, dtype=np.intp) for start, stop in self.runs])

    def arranged(self, values: NDArray[Any]) -> NDArray[Any]:
        """A view, as (frame, row, bin), of values that have the axes of the array."""
        order = [self.axes.index(axis) for axis in "nrb" if axis in self.axes]
        turned = values.transpose(order)
        missing = tuple(i for i, axis in enumerate("nrb") if axis not in self.axes)
        return np.expand_dims(turned, missing)


def runs_of(indices: NDArray[np.intp]) -> Runs:
    """Cut rising indices into runs (start, stop) of consecutive ones."""
    edges = np.flatnonzero(np.diff(indices) > 1) + 1
    return tuple((int(run[0]), int(run[-1]) + 1) for run in np.split(indices, edges) if run.size)


@dataclass(frozen=True)
class StackedRows:
    """The stacks of a scan in a file of arrays; readers of such files add how rows are read.

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
