"""Opens a scan, whatever layout of file it is in.

A file must be what its name says: the extension chooses the reader and the first bytes have to
agree, so that no reader ever meets a file that was not meant for it.
"""

from __future__ import annotations

import os
from pathlib import Path

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.boundary import reading
from rift_cl.io.hdf5_scan import open_hdf5_scan
from rift_cl.io.npz_scan import open_npz_scan
from rift_cl.io.scan_file import ArrayNames, ScanFile

_HDF5_SUFFIXES = {".h5", ".hdf5", ".hdf", ".nxs"}
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_ZIP_SIGNATURE = b"PK\x03\x04"
_USER_BLOCKS = (0, 512, 1024, 2048, 4096, 8192)


def open_scan(
    path: str | os.PathLike[str],
    *,
    dataset: str | None = None,
    theta: str | None = None,
    flats: str | None = None,
    darks: str | None = None,
    budget: int | None = None,
) -> ScanFile:
    """Find the scan in a file; only headers and angles are read.

    HDF5 (.h5, .hdf5, .hdf, .nxs) may hold a Data Exchange scan, an NXtomo scan, or arrays that
    are named here. NPZ holds ``projections`` (angle, row, bin) or ``sinogram`` (angle, bin) and
    ``angles`` in radians, and may hold ``flats``, ``darks`` and ``pitch``.

    Args:
        path: the file.
        dataset: name of the projections, (angle, row, bin), or of a sinogram, (angle, bin);
            or the name of an HDF5 group that holds one NXtomo scan of several.
        theta: name of the angles. HDF5: degrees unless their ``units`` say radians.
        flats: name of frames with the beam but without the sample. Arrays named by ``dataset``
            without them count as attenuation.
        darks: name of frames without the beam.
        budget: bytes that one ``read`` may take; 60 % of the free memory when not given.

    Raises:
        InputError: there is no such file, or its extension is unknown.
        FileFormatError: the file is damaged, or holds no scan.
        ShapeError: the arrays do not fit each other.
        DTypeError: an array does not hold real numbers.
        NonFiniteError: an angle is not finite.
        PathEscapeError: the file leads to another one outside its folder.
        ResourceLimitError: an array that must be read now is larger than the budget.
    """
    path = Path(path).absolute()
    names = ArrayNames(dataset=dataset, theta=theta, flats=flats, darks=darks)
    suffix = path.suffix.lower()
    if suffix != ".npz" and suffix not in _HDF5_SUFFIXES:
        known = ", ".join(sorted(_HDF5_SUFFIXES))
        raise InputError(f"{path}: a scan is read from {known} or .npz, not from {suffix!r}")
    with reading(path, "the file"):
        content = _content(path)
    if suffix == ".npz":
        _demand(path, content, "NPZ")
        return open_npz_scan(path, names, budget=budget)
    _demand(path, content, "HDF5")
    return open_hdf5_scan(path, names, budget=budget)


def _content(path: Path) -> str:
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is not a file")
    with path.open("rb") as file:
        for offset in _USER_BLOCKS:
            file.seek(offset)
            start = file.read(8)
            if start == _HDF5_SIGNATURE:
                return "HDF5"
            if offset == 0 and start[:4] == _ZIP_SIGNATURE:
                return "NPZ"
    return "neither HDF5 nor NPZ"


def _demand(path: Path, content: str, wanted: str) -> None:
    if content != wanted:
        raise FileFormatError(
            f"{path}: the name says {wanted}, the content is {content}; rename or replace the file"
        )
