"""Finds the scan in an NPZ file: ``projections`` or ``sinogram``, and ``angles`` in radians."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.npz_archive import NpzArchive
from rift_cl.io.scans.angle_list import AngleList, named_unit
from rift_cl.io.scans.axes import USUAL
from rift_cl.io.scans.beam import Beam
from rift_cl.io.scans.frame_stack import FrameStack, StackedRows
from rift_cl.io.scans.named_arrays import Layout, scan_in
from rift_cl.io.scans.scan_file import Frames, Part, ScanFile, ScanRequest, ScanRows, usable_pitch

# How distances are called: from the source to the axis, from there and from the axis to the
# detector.
_TO_AXIS = ("source_to_axis", "sid", "sod", "dso", "source_origin", "source_axis", "sad")
_TO_DETECTOR = ("source_to_detector", "sdd", "dsd", "source_detector")
_BEYOND = ("odd", "dod", "origin_detector", "axis_to_detector")
_DISTANCES = (*_TO_AXIS, *_TO_DETECTOR, *_BEYOND)
_PITCHES = (("pitch",), ("dv", "du"), ("row_pitch", "bin_pitch"), ("pixel_size",))
# Eight million projections: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST_VECTOR = 64 << 20


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
        return scan_in(store, _layout(store, request.dataset), request)


def _layout(store: NpzStore, dataset: str | None) -> Layout:
    archive = store.archive
    usual = [name for name in ("projections", "sinogram") if name in archive]
    if dataset is None and not usual:
        raise FileFormatError(
            f"{archive.path}: has neither 'projections' nor 'sinogram'; {archive.contents()}"
        )
    pitch = float(store.vector("pitch")[0]) if "pitch" in archive else 0.0
    known = dataset is None
    beam, notes = _beam(store)
    return Layout(
        source="NPZ",
        projections=dataset or usual[0],
        theta="angles" if "angles" in archive else None,
        flats="flats" if known and "flats" in archive else None,
        darks="darks" if known and "darks" in archive else None,
        axes=USUAL if known else None,
        angle_unit="radians",
        search=not known,
        pitch=usable_pitch(pitch),
        beam=beam,
        notes=notes,
    )


def _beam(store: NpzStore) -> tuple[Beam | None, tuple[str, ...]]:
    """Source and detector where the file names their distances, or a doubt."""
    archive = store.archive
    named = {name.lower(): name for name in archive.names()}
    found = [named[name] for name in _DISTANCES if name in named]
    if not found:
        return None, ()
    listed = ", ".join(map(repr, found))
    to_axis = _first_number(store, named, _TO_AXIS)
    to_detector = _first_number(store, named, _TO_DETECTOR)
    beyond = _first_number(store, named, _BEYOND)
    if to_detector is None and to_axis is not None and beyond is not None:
        to_detector = to_axis + beyond
    if to_axis is None and to_detector is not None and beyond is not None:
        to_axis = to_detector - beyond
    if to_axis is None or to_detector is None:
        return None, (
            f"The file names one distance of a source ({listed}) and not the other, so that it is "
            "not used: rays are taken as parallel. Give both with geometry= (--geometry).",
        )
    pitch = _pitch(store, named)
    if pitch is None:
        raise InputError(
            f"{archive.path}: names distances of a source ({listed}) and no pitch of the detector "
            "in the same unit: add 'pitch' (or 'dv' and 'du'), or give geometry= (--geometry)"
        )
    center = None
    if "center" in named:
        values = store.vector(named["center"])
        if values.size != 2:
            raise ShapeError(f"{archive.path}: 'center' has {values.size} numbers, not row and bin")
        center = (float(values[0]), float(values[1]))
    heights = store.vector(named["heights"]) if "heights" in named else None
    return Beam(
        source_to_axis=to_axis,
        source_to_detector=to_detector,
        pitch=pitch,
        center=center,
        heights=heights,
    ), (f"Distances of the source are {listed}, in the unit of the pitch.",)


def _first_number(store: NpzStore, named: dict[str, str], names: tuple[str, ...]) -> float | None:
    return next((float(store.vector(named[n])[0]) for n in names if n in named), None)


def _pitch(store: NpzStore, named: dict[str, str]) -> tuple[float, float] | None:
    """Distance between rows and between bins."""
    for names in _PITCHES:
        if all(name in named for name in names):
            values = np.concatenate([store.vector(named[name]) for name in names])
            return float(values[0]), float(values[-1])
    return None


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
        """Nothing: NPZ states no units."""
        return ""

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
