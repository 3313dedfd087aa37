"""Rows of a scan as line integrals, and what tells one scan from another."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, NonFiniteError
from rift_cl.io.scans.hdf5_frames import Hdf5Rows
from rift_cl.io.scans.npy_scan import NpyRows
from rift_cl.io.scans.scan_file import ScanFile, ScanRows
from rift_cl.io.scans.tiff_frames import TiffRows
from rift_cl.io.scans.zarr_scan import ZarrRows
from rift_cl.reconstruct.preprocess.flatfield import (
    Attenuation,
    attenuation,
    attenuation_without_flats,
    without_stuck,
)

# Blocks of a file that tell it from another, spread over it, and bytes of each.
_BLOCKS, _BLOCK = 64, 1 << 14


def scan_identity(scan: ScanFile) -> dict[str, str]:
    """What tells a scan from others, and from itself before a change; sentences by name."""
    angles = np.ascontiguousarray(scan.angles).tobytes()
    told = {"angles": f"{scan.angles.size} with the hash {_hash(angles)}"}
    if isinstance(scan.rows, Hdf5Rows) and scan.rows.others:
        told["flats and darks"] = "; ".join(map(_file_identity, scan.rows.others))
    if not isinstance(scan.rows, (TiffRows, ZarrRows, NpyRows)):
        return {"scan file": _file_identity(scan.path), **told}
    # A folder's own date tells nothing: what is beside the frames changes it, their content not.
    lines = []
    for path in scan.rows.files:
        state = path.stat()
        # Chunks of a store have the same names in each of its folders.
        name = path.relative_to(scan.path) if isinstance(scan.rows, ZarrRows) else path.name
        lines.append(f"{name}\0{state.st_size}\0{state.st_mtime_ns}\n")
    frames = _hash("".join(lines).encode("utf-8", "surrogateescape"))
    return {
        "scan file": str(scan.path),
        "frames": f"{len(lines)} files with the hash {frames}",
        **told,
    }


def _file_identity(path: Path) -> str:
    """A file in words: programs that copy files keep their times, so blocks of it count as well."""
    state = path.stat()
    with path.open("rb") as file:
        begins = np.linspace(0, max(state.st_size - _BLOCK, 0), _BLOCKS, dtype=np.int64)
        blocks = []
        for begin in np.unique(begins):
            file.seek(int(begin))
            blocks.append(file.read(_BLOCK))
    return (
        f"{path}, {state.st_size} bytes with the hash {_hash(b''.join(blocks))}, changed at "
        f"{state.st_mtime_ns}"
    )


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def read_attenuation(scan: ScanFile, start: int, stop: int) -> Attenuation:
    """Line integrals of some detector rows, less what the scan's background bins see.

    Raises:
        NonFiniteError: a sample is not finite; the sentence names the file, view, row and bin.
        InputError: the rows cannot be read or corrected.
    """
    rows = scan.read(start, stop)
    for name in ("projections", "flats", "darks"):
        frames = getattr(rows, name)
        if frames is not None:
            _check(frames, f"{scan.path}: {name}", start)
    try:
        integrals = _integrals(scan, rows, start)
    except InputError as error:
        raise type(error)(f"{scan.path}: {error}") from error
    integrals = without_stuck(integrals, scan.angles)
    if scan.background:
        subtract_background(integrals.projections, scan.background)
    return integrals


def _integrals(scan: ScanFile, rows: ScanRows, start: int) -> Attenuation:
    if scan.kind == "attenuation":
        none = np.zeros(rows.projections.shape[1], np.int64)
        return Attenuation(rows.projections, none, none)
    if rows.flats is None:
        return attenuation_without_flats(
            rows.projections, rows.darks, incident=scan.incident, first_row=start
        )
    return attenuation(
        rows.projections, rows.flats, rows.darks, flats_at=scan.flats_at, first_row=start
    )


def subtract_background(projections: NDArray[np.float32], bins: int) -> None:
    """Bring the mean of the outermost bins of both ends to zero, in every row of every view.

    Args:
        projections: line integrals (angle, row, bin); changed in place.
        bins: at each end.
    """
    ends = np.concatenate([projections[..., :bins], projections[..., -bins:]], axis=-1)
    offset = ends.mean(axis=-1, keepdims=True, dtype=np.float64)
    projections -= offset.astype(np.float32)


def _check(frames: NDArray[np.float32], name: str, start: int) -> None:
    finite = np.isfinite(frames)
    if not finite.all():
        view, row, bin = (int(i) for i in np.argwhere(~finite)[0])
        raise NonFiniteError(
            f"{name} hold {np.count_nonzero(~finite)} values that are not finite in these rows, "
            f"the first at view {view}, row {start + row}, bin {bin}: repair the file, or choose "
            "other rows"
        )


def chosen_rows(wanted: tuple[int, int] | None, scan: ScanFile) -> tuple[int, int]:
    """The detector rows that are asked for, all if none are.

    Raises:
        InputError: there are no such rows.
    """
    rows = wanted or (0, scan.shape[1])
    if not 0 <= rows[0] < rows[1] <= scan.shape[1]:
        raise InputError(
            f"--rows is {rows[0]} {rows[1]}, {scan.path} has the rows 0 to {scan.shape[1] - 1}: "
            f"give the first and the one after the last, {scan.shape[1]} at most"
        )
    return rows


def check_center(center: float | None, scan: ScanFile) -> None:
    """Make sure that a rotation axis lies on the detector: else no point is seen all round.

    Raises:
        InputError: it does not.
    """
    bins = scan.shape[2]
    if center is not None and not -0.5 <= center <= bins - 0.5:
        raise InputError(
            f"--center is {center:g}, off the detector of {scan.path}, which has the bins 0 to "
            f"{bins - 1}"
        )
