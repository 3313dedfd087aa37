"""Finds a tilt series in an MRC file, the format of electron tomography, by the library mrcfile.

Sections are views, and the tilt axis is along y (the convention of IMOD and of aligned stacks), so
that lines are detector rows and columns are bins. Tilt angles stand in a text beside the file
(``imod_files``), or in the extended header that FEI's or SerialEM's software writes. What the
intensities mean nobody writes down: in bright field they are counts whose beam is not seen, in dark
field they grow with mass thickness; so a person says it.

Source of the layout: Cheng et al., MRC2014, J. Struct. Biol. 192, 146 (2015); of SerialEM's
extended header: the description of IMOD's format (bits of nreal; the tilt is a short of hundredths
of a degree, and comes first).
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import DTypeError, FileFormatError, InputError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.scans.angle_list import AngleList, even_turn, file_and_column, file_angles
from rift_cl.io.scans.axes import axes_of
from rift_cl.io.scans.contract import AIR, MEAN, Finding, scan_of
from rift_cl.io.scans.frame_stack import FrameStack
from rift_cl.io.scans.imod_files import names_of_tilts, tilts_beside, unused_transforms
from rift_cl.io.scans.scan_file import (
    Frames,
    Part,
    Pitches,
    ScanFile,
    ScanRequest,
    ScanRows,
)

SUFFIXES = (".mrc", ".st", ".ali", ".rec")
_HEADER = 1024
# Bytes of a sample by mode; two modes are complex, and one packs two samples into a byte.
_MODES = {0: 1, 1: 2, 2: 4, 6: 2, 12: 2}
_LITTLE = (b"DD", b"DA")
# Where an extended header of SerialEM states the bytes of a section and what they hold.
_SERIAL = slice(16, 20)
_HAS_TILT = 1
_HUNDREDTHS = 100.0
_ADVICE = (
    "what intensities mean is not written in MRC: in bright field say --kind counts, which takes "
    "the beam to be each view's mean (--flats air: the outermost bins of both ends), in dark field "
    "(HAADF), where they grow with mass thickness, --kind attenuation"
)


@dataclass(frozen=True)
class MrcRows:
    """Reads rows of a tilt series in an MRC file (a ``RowSource``).

    Args:
        path: the file.
        projections: the views.
        flats: None; a tilt series has none.
        darks: None.
        budget: bytes that one reading may take; 60 % of the free memory when None.
    """

    path: Path
    projections: FrameStack
    flats: None
    darks: None
    budget: int | None

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop``."""
        stack = self.projections
        return ScanRows(self._rows(range(stack.frames), slice(start, stop)), None, None)

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some views."""
        return self._rows(frames, list(rows))

    def _rows(self, frames: Sequence[int], rows: slice | list[int]) -> Frames:
        stack = self.projections
        count = len(rows) if isinstance(rows, list) else rows.stop - rows.start
        need = 4 * len(frames) * count * stack.bins
        check_claim(self.path, "rows of the tilt series", need, self.budget)
        found = np.empty((len(frames), count, stack.bins), np.float32)
        with _opened(self.path) as file:
            if file.data.shape != stack.shape:
                raise FileFormatError(
                    f"{self.path}: had shape {stack.shape} when it was opened and has "
                    f"{file.data.shape} now; open the scan again"
                )
            views = stack.arranged(file.data)
            for place, view in enumerate(frames):
                found[place] = views[view][rows]
        return found


def open_mrc_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the tilt series in an MRC file; see ``open_scan``."""
    for name in ("dataset", "image_key", "darks"):
        if getattr(request, name) is not None:
            raise InputError(f"{path}: {name} is about named arrays, of which MRC holds none")
    if request.flats not in (None, AIR, MEAN):
        raise InputError(
            f"{path}: flats is {request.flats!r}, wanted air or mean: MRC holds no flats"
        )
    with _opened(path) as file:
        shape = tuple(int(size) for size in file.data.shape)
        dtype = file.data.dtype
        pixel = Pitches(float(file.voxel_size.y), float(file.voxel_size.x), "angstrom").usable
        angles, note = _angles(path, file, request.theta)
    axes = axes_of(
        path, path.name, shape, count=angles.count, asked=request.axes, usual=_usual(angles, shape)
    )
    stack = FrameStack("", shape, axes, ((0, shape[axes.index("n")]),))
    radians, phrase, doubts = angles.settled(path, stack.frames, request.angle_unit)
    found = Finding(
        path=path,
        source="MRC tilt series",
        name=repr(path.name),
        shape=(stack.frames, stack.rows, stack.bins),
        axes=axes,
        dtype=dtype,
        rows=MrcRows(path, stack, None, None, budget),
        angles=radians,
        angle_words=phrase,
        evidence=(path.stem,),
        pitch=pixel.bin,
        row_pitch=pixel.row,
        unit=pixel.unit,
        notes=(note, *doubts, *unused_transforms(path)),
        advice=_ADVICE,
    )
    return scan_of(found, request)


def _usual(angles: AngleList, shape: tuple[int, ...]) -> str | None:
    """Sections are views, unless their number is another one than that of the angles."""
    return "nrb" if angles.count in (None, shape[0]) else None


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file, mapped into memory, after what its header claims was held against its size."""
    with reading(path, "the MRC file"):
        import mrcfile

        _check_header(path)
        with warnings.catch_warnings():
            # Of values that are not finite, which are looked for where rows are used.
            warnings.simplefilter("ignore")
            file = mrcfile.mmap(path, mode="r", permissive=False)
        with file:
            if file.data.ndim not in (2, 3):
                raise FileFormatError(f"{path}: holds a stack of volumes, wanted a tilt series")
            yield file


def _check_header(path: Path) -> None:
    with path.open("rb") as file:
        header = file.read(_HEADER)
    if len(header) < _HEADER:
        raise FileFormatError(f"{path}: ends within the header of {_HEADER} bytes")
    order = "<" if header[212:214] in _LITTLE else ">"
    *size, mode = struct.unpack(order + "4i", header[:16])
    (extended,) = struct.unpack(order + "i", header[92:96])
    if mode not in _MODES:
        raise DTypeError(
            f"{path}: samples are of mode {mode}, wanted integers or real numbers (modes "
            f"{', '.join(map(str, _MODES))})"
        )
    if min(size) < 1 or extended < 0:
        raise FileFormatError(f"{path}: the header claims the size {tuple(size)}, it is damaged")
    claimed = _HEADER + extended + size[0] * size[1] * size[2] * _MODES[mode]
    stored = path.stat().st_size
    if claimed > stored:
        raise FileFormatError(
            f"{path}: the header claims {claimed} bytes, the file has {stored}; it is damaged or "
            "was cut short"
        )


def _angles(path: Path, file: Any, theta: str | None) -> tuple[AngleList, str]:
    """The tilt angles, and where they are from."""
    if theta is not None:
        file, column = file_and_column(theta)
        angles = even_turn(theta) or file_angles(Path(file).absolute(), column)
        return angles, f"The tilt angles are {theta}, about the y axis."
    beside = tilts_beside(path)
    if beside is not None:
        return beside, f"The tilt angles are those of {Path(beside.name).name}, about the y axis."
    recorded = _header_angles(file)
    if recorded is None:
        raise FileFormatError(
            f"{path}: holds no tilt angles, and none of {names_of_tilts(path)} beside it does: "
            "give them with theta= (--theta); a reconstructed volume is no scan"
        )
    told = "The tilt angles are those of the extended header, about the y axis."
    return AngleList("the extended header", recorded, unit="degrees"), told


def _header_angles(file: Any) -> NDArray[np.float64] | None:
    """The tilt angles in degrees that the microscope's software wrote, or None."""
    kind = bytes(file.header.exttyp)
    if kind in (b"FEI1", b"FEI2"):
        records = file.indexed_extended_header
        return None if records is None else np.array(records["Alpha tilt"], np.float64)
    if kind != b"SERI":
        return None
    order = file.header.mode.dtype.byteorder
    order = order if order in "<>" else "="
    size, flags = struct.unpack(order + "2h", bytes(file.header.extra2)[_SERIAL])
    sections = int(file.header.nz)
    content = bytes(file.extended_header)
    if not flags & _HAS_TILT or size < 2 or len(content) < size * sections:
        return None
    tilts = [struct.unpack_from(order + "h", content, size * place)[0] for place in range(sections)]
    return np.array(tilts) / _HUNDREDTHS
