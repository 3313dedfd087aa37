"""Finds the scan in an NPZ file: ``projections`` or ``sinogram``, and ``angles`` in radians."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, ShapeError
from rift_cl.io.angle_list import given_angles
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.npz_archive import NpzArchive
from rift_cl.io.scan_file import (
    ArrayNames,
    Frames,
    Kind,
    ScanFile,
    ScanRows,
    check_angles,
    usable_pitch,
)

# Eight million projections: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST_VECTOR = 64 << 20


@dataclass(frozen=True)
class NpzRows:
    """Reads rows of a scan in an NPZ file (a ``RowSource``); each array is loaded whole.

    Args:
        path: the file.
        projections: name of the projections.
        flats: name of the frames without the sample, if there are any.
        darks: name of the frames without the beam, if there are any.
        shape: shape of the projections as stored.
        budget: bytes that one reading may take; 60 % of the free memory when None.
    """

    path: Path
    projections: str
    flats: str | None
    darks: str | None
    shape: tuple[int, ...]
    budget: int | None

    def read(self, start: int, stop: int) -> ScanRows:
        """Read detector rows ``start`` to ``stop`` of every stack."""
        with _open(self.path) as archive:
            if archive.header(self.projections).shape != self.shape:
                raise FileFormatError(
                    f"{self.path}: {self.projections!r} changed its shape since it was opened; "
                    "open the scan again"
                )
            names = [name for name in (self.projections, self.flats, self.darks) if name]
            headers = [archive.header(name) for name in names]
            kept = sum(4 * math.prod(header.shape) for header in headers)
            check_claim(self.path, "the scan", kept + max(h.size for h in headers), self.budget)
            projections = self._rows(archive, self.projections, start, stop)
            flats = self._rows(archive, self.flats, start, stop) if self.flats else None
            darks = self._rows(archive, self.darks, start, stop) if self.darks else None
        return ScanRows(projections, flats, darks)

    def _rows(self, archive: NpzArchive, name: str, start: int, stop: int) -> Frames:
        values = archive.load(name, budget=self.budget)
        if values.ndim < len(self.shape):
            values = values[np.newaxis]
        if values.ndim == 2:
            values = values[:, np.newaxis, :]
        with np.errstate(over="ignore"):
            return np.array(values[:, start:stop, :], dtype=np.float32, order="C")


def open_npz_scan(path: Path, names: ArrayNames, *, budget: int | None) -> ScanFile:
    """Find the scan in an NPZ file; see ``open_scan``."""
    with _open(path) as archive:
        names = _complete(archive, names)
        name = str(names.dataset)
        shape = archive.header(name).shape
        if len(shape) not in (2, 3):
            raise ShapeError(
                f"{path}: {name!r} has shape {shape}, wanted (angle, row, bin) or (angle, bin)"
            )
        for calibration in (names.flats, names.darks):
            if calibration:
                _check_calibration(archive, calibration, shape)
        theta = str(names.theta)
        given = None if theta in archive else given_angles(theta, shape[0])
        if given is None:
            given = check_angles(path, theta, _vector(archive, theta), projections=shape[0])
        pitch = usable_pitch(float(_vector(archive, "pitch")[0])) if "pitch" in archive else None
    kind: Kind = "transmission" if names.flats else "attenuation"
    frames = (shape[0], shape[1] if len(shape) == 3 else 1, shape[-1])
    rows = NpzRows(path, name, names.flats, names.darks, shape, budget)
    return ScanFile(path, frames, given, pitch, "", kind, "NPZ", rows)


@contextmanager
def _open(path: Path) -> Iterator[NpzArchive]:
    with reading(path, "the NPZ file"), zipfile.ZipFile(path) as archive:
        yield NpzArchive(path, archive)


def _complete(archive: NpzArchive, names: ArrayNames) -> ArrayNames:
    usual = [name for name in ("projections", "sinogram") if name in archive]
    if names.dataset is None and not usual:
        raise FileFormatError(
            f"{archive.path}: has neither 'projections' nor 'sinogram'; {archive.contents()}"
        )
    names = replace(names, theta=names.theta or "angles")
    if names.dataset is not None:
        return names
    return replace(
        names,
        dataset=usual[0],
        flats=names.flats or ("flats" if "flats" in archive else None),
        darks=names.darks or ("darks" if "darks" in archive else None),
    )


def _check_calibration(archive: NpzArchive, name: str, projections: tuple[int, ...]) -> None:
    shape = archive.header(name).shape
    if projections[1:] not in (shape, shape[1:]):
        raise ShapeError(
            f"{archive.path}: {name!r} has shape {shape}, the projections have {projections}: "
            "rows and bins must agree"
        )


def _vector(archive: NpzArchive, name: str) -> NDArray[np.float64]:
    values = archive.load(name, budget=_LONGEST_VECTOR)
    if values.size != max(values.shape, default=1):
        raise ShapeError(
            f"{archive.path}: {name!r} has shape {values.shape}, wanted one number per projection"
        )
    return np.asarray(values, dtype=np.float64).reshape(values.size)
