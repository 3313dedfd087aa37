"""Finds the scan in NPY files: projections in one of them, and what belongs to them beside it.

``np.save`` gives an array no name but that of its file. So files of the same folder take the place
of the arrays in an archive: ``theta.npy`` beside ``proj.npy`` are its angles and ``flat.npy`` its
flats, where the names say so and the shapes fit; what a person names may lie anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.npy_file import SUFFIX, load_npy, map_npy, npy_header
from rift_cl.io.scans.angle_list import AngleList, named_unit
from rift_cl.io.scans.frame_stack import FrameStack, StackedRows
from rift_cl.io.scans.named_arrays import Layout, scan_in
from rift_cl.io.scans.scan_file import Frames, Part, ScanFile, ScanRequest, ScanRows

# Eight million projections: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST_VECTOR = 64 << 20
_LISTED = 8


class NpyRows(StackedRows):
    """Reads rows of a scan in NPY files (a ``RowSource``), which are mapped and not loaded."""

    @property
    def files(self) -> list[Path]:
        """The files whose rows are read."""
        stacks = (self.projections, self.flats, self.darks)
        return [_file(self.path, stack.name) for stack in stacks if stack]

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        rows = range(start, stop)
        return ScanRows(
            self._frames(self.projections, rows),
            self._frames(self.flats, rows) if self.flats else None,
            self._frames(self.darks, rows) if self.darks else None,
        )

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some frames of one stack."""
        return self._frames(getattr(self, part), rows, frames)

    def _frames(
        self, stack: FrameStack, rows: Sequence[int], frames: Sequence[int] | None = None
    ) -> Frames:
        places = stack.indices() if frames is None else stack.indices()[list(frames)]
        need = 4 * len(places) * len(rows) * stack.bins
        check_claim(self.path, f"rows of {stack.name!r}", need, self.budget)
        file = _file(self.path, stack.name)
        found = np.empty((len(places), len(rows), stack.bins), np.float32)
        with reading(file, "the NPY file"), np.errstate(over="ignore"):
            values = map_npy(file)
            if values.shape != stack.shape:
                raise FileFormatError(
                    f"{file}: had shape {stack.shape} when it was opened and has {values.shape} "
                    "now; open the scan again"
                )
            arranged = stack.arranged(values)
            for number, place in enumerate(places):
                found[number] = arranged[place][list(rows)]
        return found


def open_npy_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan whose projections are in an NPY file; see ``open_scan``."""
    if request.dataset is not None:
        raise InputError(
            f"{path}: dataset= (--dataset) is about named arrays, and NPY holds a single one"
        )
    store = NpyStore(path, budget)
    named: dict[str, Any] = {
        part: str(_file(path, name))
        for part in ("theta", "flats", "darks", "image_key")
        if (name := getattr(request, part)) is not None and _is_named(path, name)
    }
    layout = Layout(source="NPY", projections=path.stem, search=True)
    return scan_in(store, layout, replace(request, **named))


@dataclass(frozen=True)
class NpyStore:
    """The NPY files of a folder as arrays that are called as the files are (an ``ArrayStore``).

    Args:
        path: the file of the projections.
        budget: bytes that one reading may take.
    """

    path: Path
    budget: int | None

    def __contains__(self, name: str) -> bool:
        return _file(self.path, name).is_file()

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of the array in a file."""
        return self._header(name)[0]

    def dtype(self, name: str) -> np.dtype[np.generic]:
        """Type of the numbers as they are stored."""
        return self._header(name)[1]

    def _header(self, name: str) -> tuple[tuple[int, ...], np.dtype[np.generic]]:
        file = _file(self.path, name)
        with reading(file, "the NPY file"):
            header = npy_header(file)
        return header.shape, header.dtype

    def vector(self, name: str) -> NDArray[np.float64]:
        """An array of one number per frame."""
        file = _file(self.path, name)
        with reading(file, "the NPY file"):
            values = load_npy(file, f"{file.name!r}", _LONGEST_VECTOR)
        if values.size != max(values.shape, default=1):
            raise ShapeError(f"{file}: has shape {values.shape}, wanted one number per projection")
        return values.reshape(values.size)

    def angles(self, name: str) -> AngleList:
        """The angles in a file, in the unit that its name states."""
        return AngleList(name, self.vector(name), unit=named_unit(name))

    def unit(self, name: str) -> str:
        """Nothing: NPY states no units."""
        return ""

    def axes(self, name: str) -> str | None:
        """None: NPY states no axes."""
        return None

    def beside(self, name: str) -> list[str]:
        """Names of the files in the folder that lie in it and are no links to elsewhere."""
        files = sorted(self.path.parent.glob(f"*{SUFFIX}"))
        return [file.stem for file in files if file.is_file() and not file.is_symlink()]

    def contents(self) -> str:
        """A phrase that lists the files beside the projections, and how to name one."""
        others = [name for name in self.beside("") if name != self.path.stem]
        listed = ", ".join(f"{name}{SUFFIX}" for name in others[:_LISTED])
        more = ", ..." if len(others) > _LISTED else ""
        beside = f"beside it lie {listed}{more}: " if others else ""
        return (
            f"{beside}give angles with theta= (--theta: a file of them, or a turn such as 0:180), "
            "flats and darks as files with flats= and darks= (--flats, --darks)"
        )

    def rows(
        self, projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
    ) -> NpyRows:
        """What reads these stacks."""
        return NpyRows(self.path, projections, flats, darks, self.budget)


def _is_named(path: Path, name: str) -> bool:
    """Whether a person named a file, and not a word that stands for one beside the projections."""
    return Path(name).suffix.lower() == SUFFIX and not (path.parent / f"{name}{SUFFIX}").is_file()


def _file(path: Path, name: str) -> Path:
    """The file that is called so: beside the projections, or where a person says that it lies."""
    if not _is_named(path, name):
        return path.parent / f"{name}{SUFFIX}"
    here = Path(name).absolute()
    return here if here.is_file() else path.parent / name
