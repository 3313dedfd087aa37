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
from rift_cl.io.mat_scan import open_mat5_scan, open_mat73_scan
from rift_cl.io.npz_scan import open_npz_scan
from rift_cl.io.scan_file import ArrayNames, ScanFile
from rift_cl.io.tiff_scan import open_tiff_scan

# What reads a file, by its extension and then by its content.
_READERS = {
    **{suffix: {"HDF5": open_hdf5_scan} for suffix in (".h5", ".hdf5", ".hdf", ".nxs")},
    **{suffix: {"TIFF": open_tiff_scan} for suffix in (".tif", ".tiff")},
    ".mat": {"MAT": open_mat5_scan, "HDF5": open_mat73_scan},
    ".npz": {"NPZ": open_npz_scan},
}
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_ZIP_SIGNATURE = b"PK\x03\x04"
_TIFF_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# The version and the order of bytes, after 124 bytes of text.
_MAT_SIGNATURES = (b"\0\1IM", b"\1\0MI")
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
    """Find the scan in a file or a folder; only headers and angles are read.

    HDF5 (.h5, .hdf5, .hdf, .nxs) may hold a Data Exchange scan, an NXtomo scan, or arrays that
    are named here. NPZ holds ``projections`` (angle, row, bin) or ``sinogram`` (angle, bin) and
    ``angles`` in radians, and may hold ``flats``, ``darks`` and ``pitch``. MAT, of version 5 to
    7.3, holds a scan of the Helsinki Tomography Challenge, the dendrites of ToMoBAR, or arrays
    that are named here (``scan.projections`` inside a structure). TIFF is a folder with a file
    for each projection, in the order of their numbers, or one file with a page for each; flats
    and darks are recognised by the names of files and folders, angles by ``angles.txt`` or
    ``theta.txt``, and are else taken as even over 180 degrees, which ``ScanFile.notes`` then says.

    Args:
        path: the file or the folder.
        dataset: name of the projections, (angle, row, bin), or of a sinogram, (angle, bin);
            or the name of an HDF5 group that holds one NXtomo scan of several.
        theta: name of the angles. HDF5: degrees unless their ``units`` say radians; MAT: degrees
            unless ``rad`` is part of the name. Of all but NXtomo also a file of degrees (.txt,
            .csv, .npy), or a turn that is evenly divided, ``0:180`` or ``360``, its end left out.
        flats: name of frames with the beam but without the sample; for TIFF, of a file or folder.
            Arrays named by ``dataset`` without them count as attenuation, and so does TIFF.
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
    if suffix not in _READERS and path.is_dir():
        return open_tiff_scan(path, names, budget=budget)
    if suffix not in _READERS and not path.exists():
        raise InputError(f"{path}: there is no such file or folder")
    if suffix not in _READERS:
        known = ", ".join(sorted(_READERS))
        raise InputError(
            f"{path}: a scan is read from a folder of TIFF files, or from {known}, not from "
            f"{suffix!r}"
        )
    with reading(path, "the file"):
        content = _content(path)
    readers = _READERS[suffix]
    if content not in readers:
        raise FileFormatError(
            f"{path}: the name says {' or '.join(readers)}, the content is {content}; rename or "
            "replace the file"
        )
    return readers[content](path, names, budget=budget)


def _content(path: Path) -> str:
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is not a file")
    with path.open("rb") as file:
        start = file.read(128)
        if start[:4] == _ZIP_SIGNATURE:
            return "NPZ"
        if start[:4] in _TIFF_SIGNATURES:
            return "TIFF"
        if start[124:] in _MAT_SIGNATURES:
            return "MAT"
        for offset in _USER_BLOCKS:
            file.seek(offset)
            if file.read(8) == _HDF5_SIGNATURE:
                return "HDF5"
    return "of no known kind"
