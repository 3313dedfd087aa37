"""Finds the scan in an HDF5 file: Data Exchange, NXtomo, or arrays that the caller names.

Data Exchange is the layout of the synchrotron beamlines: ``/exchange/data`` with ``data_white``,
``data_dark`` and ``theta`` (De Carlo et al., J. Synchrotron Rad. 21, 1224, 2014).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.hdf5_tree import Hdf5Tree
from rift_cl.io.scans.angle_list import AngleList
from rift_cl.io.scans.frame_stack import FrameStack
from rift_cl.io.scans.hdf5_frames import Hdf5Rows
from rift_cl.io.scans.hdf5_places import Hdf5Files, open_files
from rift_cl.io.scans.hdf5_values import (
    axes_stated,
    in_unit,
    numeric_shape,
    read_angles,
    read_beam,
    read_length,
    read_pitches,
    read_vector,
    unit_of,
)
from rift_cl.io.scans.named_arrays import Layout, layout_by_name, scan_in
from rift_cl.io.scans.nxtomo import entry_of, find_entry, nxtomo_layout
from rift_cl.io.scans.scan_file import ScanFile, ScanRequest, usable_pitch

_DATA = "/exchange/data"
_WHITE = "/exchange/data_white"
_DARK = "/exchange/data_dark"
_THETA = "/exchange/theta"
# Sizes of a pixel along the rows and along the bins: at the sample, and of the detector itself.
_AT_SAMPLE, _OF_DETECTOR = (
    tuple(f"/measurement/instrument/detector/{what}pixel_size_{axis}" for axis in "yx")
    for what in ("actual_", "")
)
# Of the source and of the detector from the sample.
_DISTANCES = (
    "/measurement/instrument/source/distance",
    "/measurement/instrument/detector/distance",
)
# Datasets among which one is looked for whose name says that it holds projections.
_MOST_NAMED = 1000


def open_hdf5_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan in an HDF5 file; see ``open_scan``."""
    with open_files(path) as files:
        store = Hdf5Store(files, budget)
        layout = _layout(store, request.dataset)
        frame = store.shape(layout.projections)
        settled = replace(
            request,
            theta=files.settled("theta", request.theta, frame),
            flats=files.settled("flats", request.flats, frame),
            darks=files.settled("darks", request.darks, frame),
        )
        return scan_in(store, layout, settled)


def _layout(store: Hdf5Store, dataset: str | None) -> Layout:
    """What there is to know of the file before anything is named."""
    tree = store.tree
    named = tree.find(dataset) if dataset else tree.root
    exchange = tree.find(_DATA)
    if exchange is not None and (dataset is None or named == exchange):
        return _data_exchange(tree)
    if dataset is not None and not isinstance(named, h5py.Group):
        entry = entry_of(tree, dataset)
        if entry is not None:
            return nxtomo_layout(tree, entry)
        return Layout(source=f"array {dataset}", projections=dataset, search=True)
    entry = find_entry(tree, dataset or "/")
    if entry is not None:
        return nxtomo_layout(tree, entry)
    inside = (name for name, _ in tree.datasets(_MOST_NAMED))
    called = None if dataset else layout_by_name(store, "HDF5", inside)
    if called is None:
        raise FileFormatError(
            f"{tree.path}: holds neither a Data Exchange scan ({_DATA}) nor an NXtomo scan; "
            f"{tree.contents()}"
        )
    return called


def _data_exchange(tree: Hdf5Tree) -> Layout:
    present = {name: name if tree.find(name) is not None else None for name in (_WHITE, _DARK)}
    theta = _THETA if tree.find(_THETA) is not None else None
    detector = [read_length(tree, name) for name in _OF_DETECTOR]
    pitches, doubts = read_pitches(*_at_sample(tree, *detector))
    beam, notes = read_beam(tree, _DISTANCES, tuple(detector))
    return Layout(
        source="Data Exchange",
        projections=_DATA,
        theta=theta,
        flats=present[_WHITE],
        darks=present[_DARK],
        axes={2: "nb", 3: axes_stated(tree, _DATA) or "nrb"},
        beam=beam,
        notes=(*doubts, *notes),
        pitch=pitches.bin,
        row_pitch=pitches.row,
        unit=pitches.unit,
    )


def _at_sample(
    tree: Hdf5Tree, row: tuple[float, str] | None, bin: tuple[float, str] | None
) -> tuple[tuple[float, str] | None, tuple[float, str] | None]:
    """Sizes of a pixel at the sample where the file tells them, else those of the detector.

    Optics magnify both alike, so that one of them tells the other.

    Args:
        tree: the file.
        row: size of the detector's pixel along the rows, and its unit.
        bin: the same along the bins.
    """
    seen_row, seen_bin = (read_length(tree, name) for name in _AT_SAMPLE)
    if seen_bin is None:
        return row, bin
    if seen_row is None and row is not None and bin is not None:
        height = in_unit(row, bin[1])
        if height is not None and usable_pitch(bin[0]):
            seen_row = height / bin[0] * seen_bin[0], seen_bin[1]
    return seen_row, seen_bin


@dataclass(frozen=True)
class Hdf5Store:
    """The arrays of an open HDF5 file, and of those named beside it (an ``ArrayStore``).

    Args:
        files: the file, and those.
        budget: bytes that one reading may take.
    """

    files: Hdf5Files
    budget: int | None

    @property
    def tree(self) -> Hdf5Tree:
        """The file of the projections."""
        return self.files.tree

    @property
    def path(self) -> Path:
        """The file."""
        return self.tree.path

    def __contains__(self, name: str) -> bool:
        tree, inner = self.files.at(name)
        return tree.find(inner) is not None

    def shape(self, name: str) -> tuple[int, ...]:
        """See ``numeric_shape``."""
        return numeric_shape(*self.files.at(name))

    def dtype(self, name: str) -> np.dtype[np.generic]:
        """Type of the numbers as they are stored."""
        tree, inner = self.files.at(name)
        dtype: np.dtype[np.generic] = tree.dataset(inner).dtype
        return dtype

    def vector(self, name: str) -> NDArray[np.float64]:
        """See ``read_vector``."""
        return read_vector(*self.files.at(name))

    def angles(self, name: str) -> AngleList:
        """See ``read_angles``."""
        return read_angles(*self.files.at(name))

    def unit(self, name: str) -> str:
        """The attribute ``units``."""
        return unit_of(*self.files.at(name))

    def axes(self, name: str) -> str | None:
        """The attribute ``axes``."""
        return axes_stated(*self.files.at(name))

    def beside(self, name: str) -> list[str]:
        """Names of the datasets in the same group."""
        group, _, _ = name.rpartition("/")
        node = self.tree.find(group or "/")
        if not isinstance(node, h5py.Group):
            return []
        places = [f"{group}/{child}" if group else str(child) for child in node]
        # Links that lead astray are not followed before somebody names them.
        return [place for place in places if isinstance(_plain(node, place), h5py.Dataset)]

    def contents(self) -> str:
        """See ``Hdf5Tree.contents``."""
        return self.tree.contents()

    def rows(
        self, projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
    ) -> Hdf5Rows:
        """What reads these stacks."""
        return Hdf5Rows(self.path, projections, flats, darks, self.budget)


def _plain(group: h5py.Group, place: str) -> object:
    child = place.rpartition("/")[2]
    link = group.get(child, getlink=True)
    return group[child] if isinstance(link, h5py.HardLink) else None
