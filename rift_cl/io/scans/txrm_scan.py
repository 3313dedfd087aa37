"""Finds the scan in a Zeiss (Xradia) ``.txrm`` file: a container of streams with known names.

Each projection is a stream ``ImageDataN/ImageK``, a hundred to a folder; the rest is small: angles
in degrees, distances of the source and of the detector from the axis in millimetres, the size of a
pixel at the object in micrometres. Names are those that the readers of tomopy's dxchange and of CIL
know. A cone beam is told by ``XrayGeometry``; the sense of rotation is CIL's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import olefile
from numpy.typing import NDArray

from rift_cl.errors import DTypeError, FileFormatError, InputError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.scans.angle_list import AngleList, given_angles
from rift_cl.io.scans.beam import PARALLEL_BELOW, Beam
from rift_cl.io.scans.beam_file import given_beam
from rift_cl.io.scans.contract import Finding, scan_of
from rift_cl.io.scans.scan_file import Frames, Part, ScanFile, ScanRequest, ScanRows, usable_pitch

_TYPES = {3: "<u1", 5: "<u2", 10: "<f4"}
_FOLDER = 100
_REFERENCES = ("ReferenceData/Image", "MultiReferenceData/Image1")
_CONE = 1
# Shifts of images, in pixels, below which nothing is said of them.
_MOVED = 0.1
# Images, and rows and bins of one, beyond which a header is forged.
_MOST, _WIDEST = 1 << 20, 1 << 16


class Reference(NamedTuple):
    """The stream of a reference image: its name, and the type of a sample."""

    name: str
    dtype: str


@dataclass(frozen=True)
class TxrmRows:
    """Reads rows of a scan in a TXRM file (a ``RowSource``); images are read one after another.

    Args:
        path: the file.
        shape: (angle, row, bin).
        dtype: type of a sample as it is stored.
        flats: stream of the beam without the sample, or None.
        darks: None; the format keeps none.
        budget: bytes that one reading may take; 60 % of the free memory when None.
    """

    path: Path
    shape: tuple[int, int, int]
    dtype: str
    flats: Reference | None
    darks: None
    budget: int | None

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every image."""
        views, rows, bins = self.shape
        need = 4 * views * (stop - start) * bins + rows * bins * np.dtype(self.dtype).itemsize
        check_claim(self.path, f"rows {start} to {stop} of the scan", need, self.budget)
        with _opened(self.path) as ole:
            found = np.empty((views, stop - start, bins), np.float32)
            for view in range(views):
                found[view] = self._image(ole, image_name(view))[start:stop]
            flats = None
            if self.flats is not None:
                flats = self._image(ole, *self.flats)[None, start:stop].astype(np.float32)
        return ScanRows(found, flats, None)

    def look(self, part: Part, frames: Sequence[int], rows: Sequence[int]) -> Frames:
        """Read some rows of some images."""
        with _opened(self.path) as ole:
            if part == "flats":
                assert self.flats is not None
                image = self._image(ole, *self.flats)
                return np.stack([image[list(rows)] for _ in frames]).astype(np.float32)
            images = [self._image(ole, image_name(view))[list(rows)] for view in frames]
        return np.stack(images).astype(np.float32)

    def _image(
        self, ole: olefile.OleFileIO, name: str, dtype: str | None = None
    ) -> NDArray[np.generic]:
        rows, bins = self.shape[1:]
        kind = np.dtype(dtype or self.dtype)
        values = np.frombuffer(_stream(self.path, ole, name, rows * bins * kind.itemsize), kind)
        return values.reshape(rows, bins)


def image_name(view: int) -> str:
    """The stream of a projection."""
    return f"ImageData{view // _FOLDER + 1}/Image{view + 1}"


def open_txrm_scan(path: Path, request: ScanRequest, *, budget: int | None) -> ScanFile:
    """Find the scan in a TXRM file; see ``open_scan``."""
    for name in ("dataset", "image_key", "axes", "darks"):
        if getattr(request, name) is not None:
            raise InputError(f"{path}: {name} is given, and a TXRM file has nothing to name")
    with _opened(path) as ole:
        header = _Header(path, ole)
        views, told = _views(header)
        shape = (views, header.whole("ImageHeight", _WIDEST), header.whole("ImageWidth", _WIDEST))
        dtype = header.dtype()
        missing = next((k for k in range(views) if not ole.exists(image_name(k))), None)
        if missing is not None:
            raise FileFormatError(
                f"{path}: names {views} images, and number {missing + 1} is missing"
            )
        reference, unused = _reference(header, shape[1] * shape[2])
        angles = AngleList("ImageInfo/Angles", header.numbers("Angles", views), unit="degrees")
        cone, pixel = _beam(header, views)
        silent = _silent_distances(header) if request.geometry is None else ()
        shifts = header.shifts(views)
    if cone is not None:
        # The sense that CIL reads; ours is the opposite.
        angles = AngleList(angles.name, -angles.values, unit="degrees")
    if request.theta is not None:
        given = given_angles(request.theta)
        if given is None:
            raise InputError(
                f"{path}: theta is {request.theta!r}, wanted a turn such as 0:360, or a list "
                "(.txt, .csv, .npy)"
            )
        angles = given
    beam = given_beam(request, path, None if pixel is None else (pixel, pixel), "um") or cone
    if beam is not None and request.theta is None and beam.angles is not None:
        angles = beam.angles
    radians, phrase, doubts = angles.settled(path, views, request.angle_unit)
    rows = TxrmRows(path, shape, dtype, reference, None, budget)
    found = Finding(
        path=path,
        source="Zeiss TXRM",
        name="its images",
        shape=shape,
        axes="nrb",
        dtype=np.dtype(dtype),
        rows=rows,
        angles=radians,
        angle_words=phrase,
        flats=0 if reference is None else 1,
        pitch=pixel,
        unit="" if pixel is None else "um",
        beam=beam,
        notes=(*told, *doubts, *silent, *_unapplied(shifts)),
        contents=lambda: unused,
    )
    return scan_of(found, request)


def _views(header: _Header) -> tuple[int, tuple[str, ...]]:
    """The number of images that there are, and a sentence where there were to be more."""
    wanted = header.whole("NoOfImages", _MOST)
    taken = header.number("ImagesTaken")
    if not 1 <= taken < wanted:
        return wanted, ()
    return int(taken), (
        f"The scan ended early: {taken:g} of {wanted} images were taken, which are read.",
    )


def _reference(header: _Header, pixels: int) -> tuple[Reference | None, str]:
    """The image of the beam, or a phrase about why there is one that cannot be read."""
    name = next((name for name in _REFERENCES if header.ole.exists(name)), None)
    if name is None:
        return None, ""
    size = header.ole.get_size(name)
    code = header.number(f"{name.partition('/')[0]}/DataType", within="")
    # Files that do not say so keep real numbers, if not what their images are.
    types = ("<f4", header.dtype()) if np.isnan(code) else (_TYPES.get(int(code)),)
    for dtype in types:
        if dtype is not None and size == pixels * np.dtype(dtype).itemsize:
            return Reference(name, dtype), ""
    of = "" if np.isnan(code) else f" of type {code:g}"
    return None, f"its {name} holds {size} bytes{of}, which is no image of {pixels} pixels"


def _silent_distances(header: _Header) -> tuple[str, ...]:
    """A doubt about parallel rays where distances are told, and not what the rays are."""
    if not np.isnan(header.number("XrayGeometry")):
        return ()
    lengths = [header.first(name) for name in ("StoRADistance", "DtoRADistance")]
    if not all(length > 0 for length in lengths) or 1 + lengths[1] / lengths[0] < PARALLEL_BELOW:
        return ()
    return (
        "The file does not say what its rays are (XrayGeometry), and they are taken as parallel. "
        f"It has the source {lengths[0]:.4g} mm and the detector {lengths[1]:.4g} mm from the "
        "axis: if they are a cone's, write these in a file of your own (--geometry).",
    )


def _unapplied(shifts: tuple[float, float]) -> tuple[str, ...]:
    """A sentence about shifts of the images, which are left as they are."""
    if max(shifts) < _MOVED:
        return ()
    bins, rows = shifts
    return (
        f"The file holds shifts of its images of up to {bins:.2g} bins and {rows:.2g} rows "
        "(Alignment), which are not applied: where they belong to the sample, edges blur by as "
        "much.",
    )


def _beam(header: _Header, views: int) -> tuple[Beam | None, float | None]:
    """Source and detector of a cone, and the size of a pixel at the object in micrometres."""
    pixel = usable_pitch(header.number("PixelSize"))
    if header.number("XrayGeometry") != _CONE or pixel is None:
        return None, pixel
    to_axis, beyond = (
        float(np.abs(header.numbers(name, views))[0]) for name in ("StoRADistance", "DtoRADistance")
    )
    pitch = pixel / 1000 * (to_axis + beyond) / max(to_axis, 1e-30)
    return Beam(
        source_to_axis=to_axis,
        source_to_detector=to_axis + beyond,
        pitch=(pitch, pitch),
        unit="mm",
        notes=(
            "Zeiss' pixel size is that at the object: the detector's pitch is taken to be as much "
            "larger as the magnification says. If edges are double, turn the sense of rotation "
            "with --reversed.",
        ),
    ), pixel


@dataclass(frozen=True)
class _Header:
    """Small streams, most of them of ``ImageInfo``."""

    path: Path
    ole: olefile.OleFileIO

    def numbers(self, name: str, count: int) -> NDArray[np.float64]:
        """So many real numbers."""
        data = _stream(self.path, self.ole, f"ImageInfo/{name}", 4 * count)
        return np.frombuffer(data, "<f4").astype(np.float64)

    def first(self, name: str) -> float:
        """The first of real numbers, without its sign; NaN where there are none."""
        if not self.ole.exists(f"ImageInfo/{name}"):
            return float("nan")
        return abs(float(self.numbers(name, 1)[0]))

    def number(self, name: str, *, within: str = "ImageInfo/") -> float:
        """A whole number or a real one, by its name; NaN where there is none."""
        if not self.ole.exists(f"{within}{name}"):
            return float("nan")
        data = _stream(self.path, self.ole, f"{within}{name}", 4)
        return float(np.frombuffer(data, "<f4" if name == "PixelSize" else "<i4")[0])

    def whole(self, name: str, most: int) -> int:
        """A whole number from 1 to so many."""
        value = self.number(name)
        if not 1 <= value <= most:
            raise FileFormatError(f"{self.path}: ImageInfo/{name} is {value:g}, wanted 1 to {most}")
        return int(value)

    def shifts(self, views: int) -> tuple[float, float]:
        """How far images are shifted at most, in bins and rows; 0 where the file says nothing."""
        most = []
        for name in ("Alignment/X-Shifts", "Alignment/Y-Shifts"):
            values = np.zeros(1, "<f4")
            if self.ole.exists(name) and self.ole.get_size(name) >= 4 * views:
                values = np.frombuffer(_stream(self.path, self.ole, name, 4 * views), "<f4")
            most.append(float(np.abs(values[np.isfinite(values)]).max(initial=0)))
        return most[0], most[1]

    def dtype(self) -> str:
        """Type of a sample."""
        code = self.number("DataType")
        if code not in _TYPES:
            raise DTypeError(f"{self.path}: samples are of type {code:g}, known are {[*_TYPES]}")
        return _TYPES[int(code)]


def _stream(path: Path, ole: olefile.OleFileIO, name: str, size: int) -> bytes:
    """A stream of that many bytes."""
    if not ole.exists(name):
        raise FileFormatError(f"{path}: has no {name}: it is no scan of projections")
    if ole.get_size(name) < size:
        raise FileFormatError(
            f"{path}: {name} holds {ole.get_size(name)} bytes, wanted {size}: the file is damaged"
        )
    data: bytes = ole.openstream(name).read(size)
    if len(data) < size:
        raise FileFormatError(f"{path}: {name} is cut short: the file is damaged")
    return data


@contextmanager
def _opened(path: Path) -> Iterator[olefile.OleFileIO]:
    with reading(path, "the TXRM file"), olefile.OleFileIO(str(path)) as ole:
        yield ole
