"""Opens a scan, whatever layout of file it is in.

A file must be what its name says: the extension chooses the reader and the first bytes have to
agree, so that no reader ever meets a file that was not meant for it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from rift_cl.errors import FileFormatError, InputError, checked_flag
from rift_cl.io.boundary import reading
from rift_cl.io.npy_file import SIGNATURE
from rift_cl.io.scans.beam_file import DESCRIPTIONS, projections_of
from rift_cl.io.scans.geometries.described import DESCRIBED, is_described
from rift_cl.io.scans.hdf5_places import HDF5_SUFFIXES
from rift_cl.io.scans.hdf5_scan import open_hdf5_scan
from rift_cl.io.scans.literals import AngleUnit, Kind
from rift_cl.io.scans.mat_scan import open_mat5_scan, open_mat73_scan
from rift_cl.io.scans.mrc_scan import SUFFIXES as MRC_SUFFIXES
from rift_cl.io.scans.mrc_scan import open_mrc_scan
from rift_cl.io.scans.npy_scan import open_npy_scan
from rift_cl.io.scans.npz_scan import open_npz_scan
from rift_cl.io.scans.scan_file import ScanFile, ScanRequest
from rift_cl.io.scans.tiff_scan import open_tiff_scan
from rift_cl.io.scans.txrm_scan import open_txrm_scan
from rift_cl.io.scans.zarr_scan import is_zarr, open_zarr_scan
from rift_cl.registry import Registry

# What reads a file, by its extension and then by its content.
_READERS = {
    **{suffix: {"HDF5": open_hdf5_scan} for suffix in HDF5_SUFFIXES},
    **{suffix: {"TIFF": open_tiff_scan} for suffix in (".tif", ".tiff")},
    ".mat": {"MAT": open_mat5_scan, "HDF5": open_mat73_scan},
    ".npy": {"NPY": open_npy_scan},
    ".npz": {"NPZ": open_npz_scan},
    **{suffix: {"MRC": open_mrc_scan} for suffix in MRC_SUFFIXES},
    ".txrm": {"TXRM": open_txrm_scan},
    ".zarr": {"Zarr": open_zarr_scan},
}
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# What files begin with: TXRM is one of Microsoft's containers of streams.
_SIGNATURES = (
    ((b"PK\x03\x04",), "NPZ"),
    ((SIGNATURE,), "NPY"),
    ((b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), "TXRM"),
    ((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"), "TIFF"),
)
# The version and the order of bytes, after 124 bytes of text.
_MAT_SIGNATURES = (b"\0\1IM", b"\1\0MI")
# The name of the format, after 52 numbers.
_MRC_SIGNATURE = b"MAP "
_USER_BLOCKS = (0, 512, 1024, 2048, 4096, 8192)


Reader = Callable[[Path, ScanRequest], ScanFile]
# Readers of other files, by extension.
SCAN_READERS: Registry[Reader] = Registry("scan reader", {})


def register_scan_reader(extension: str, reader: Reader, *, replace: bool = False) -> None:
    """Read scans from files of another kind, in ``open_scan`` and in every command.

    Args:
        extension: of the files, lower case with its dot, such as ``.raw``.
        reader: takes the file and what a person said about it, and gives back its scan, as
            ``scan_of_arrays`` makes it.
        replace: take the place of one that was registered for it before.

    Raises:
        InputError: the extension has no dot, is read already, or the reader is no function.
    """
    if not isinstance(extension, str) or not re.fullmatch(r"\.[^./\\A-Z]+", extension):
        raise InputError(
            f"register_scan_reader: extension is {extension!r}, wanted lower case such as '.raw'"
        )
    if not callable(reader):
        raise InputError(f"register_scan_reader: reader is {reader!r}, wanted a function")
    if extension in _READERS:
        raise InputError(f"register_scan_reader: {extension!r} is read by the package already")
    SCAN_READERS.add(extension, reader, replace=replace)


def is_scan_file(path: Path) -> bool:
    """Whether a path is a file of a kind that holds or describes scans.

    Its extension tells, but for .json, .yaml and .yml, which may hold anything, such as the poses
    of photographs.
    """
    suffix = path.suffix.lower()
    if not (suffix in _READERS or suffix in SCAN_READERS or suffix in DESCRIPTIONS):
        return False
    if suffix == ".zarr":
        return is_zarr(path)
    return path.is_file() and (suffix not in DESCRIBED or is_described(path))


def open_scan(
    path: str | os.PathLike[str],
    *,
    dataset: str | None = None,
    theta: str | None = None,
    flats: str | None = None,
    darks: str | None = None,
    image_key: str | None = None,
    kind: Kind | None = None,
    axes: str | None = None,
    angle_unit: AngleUnit | None = None,
    values: bool = True,
    geometry: str | os.PathLike[str] | None = None,
    reversed: bool = False,
    repeat: int | None = None,
    budget: int | None = None,
) -> ScanFile:
    """Find the scan in a file or a folder, and settle what it holds.

    Only headers, angles and a few rows of a few views are read. What the values are, which axis is
    which and the unit of the angles is taken from what is said here, else from the layout, names
    and attributes, else from numbers and values. ``ScanFile.notes[0]`` says what was found in one
    line; what remains doubtful is refused with the option that settles it.

    HDF5 (.h5, .hdf5, .hdf, .nxs, .nx) may hold a Data Exchange scan, an NXtomo scan, or arrays that
    are named here. NPZ holds ``projections`` (angle, row, bin) or ``sinogram`` (angle, bin) and
    ``angles`` in radians, and may hold ``flats``, ``darks``, ``pitch`` (one number, or those of
    rows and of bins) and ``unit``, the text that names the unit of lengths. NPY holds the
    projections or a sinogram alone; angles, flats and darks are files beside it that are called so,
    or are named here. MAT, of version 5 to
    7.3, holds a scan of the Helsinki Tomography Challenge, the dendrites of ToMoBAR, or arrays
    that are named here (``scan.projections`` inside a structure). Zarr (.zarr, a
    folder of Zarr 2 or 3) holds arrays of the same names as NPZ, a Data Exchange scan, or arrays
    that are named here. TIFF is a folder with a file
    for each projection, in the order of their numbers, one file with a page for each, or sinograms;
    flats and darks are recognised by the names of files and folders, angles by ``angles.txt`` or
    ``theta.txt``, and are else taken as even over 180 degrees. MRC (.mrc, .st, .ali, .rec) is a
    tilt series about the y axis, its angles in the extended header or in a .tlt, .rawtlt
    or .mdoc file.

    Fans and cones are told by what the scanner wrote: Nikon's .xtekct and SkyScan's .log, opened
    themselves or lying in the folder of their images, as our own .yaml or .json; Zeiss' .txrm;
    distances in NXtomo, Data Exchange and NPZ (``source_to_axis``, ``source_to_detector`` and the
    like beside ``pitch``); or a file of ``geometry``.

    Args:
        path: the file or the folder.
        dataset: name of the projections, (angle, row, bin), or of a sinogram, (angle, bin);
            or the name of an HDF5 group that holds one NXtomo scan of several.
        theta: name of the angles; or a file of them (.txt, .csv, .npy); or a turn in degrees that
            is evenly divided, ``0:180`` or ``360``, its end left out, or included as in
            ``0:180:endpoint``.
        flats: name of frames with the beam but without the sample; for TIFF, of a file or folder.
            Counts without any: "air", where the outermost 2 % of the bins at both ends of the
            detector see nothing but air, takes the beam of every view and row from these; "mean"
            takes it to be the mean of every view, which leaves an unknown level.
        darks: name of frames without the beam. Of HDF5 scans, flats, darks and angles may be in
            other files, ``FILE.h5:/name``, or ``FILE.h5`` where one array alone fits.
        image_key: name of an array that says what each frame is, as in NXtomo: 0 a projection, 1 a
            flat, 2 a dark, 3 invalid.
        kind: what the values are: "counts", "transmission" (counts divided by those of the beam)
            or "attenuation" (line integrals).
        axes: names of the axes of the projections in the file's order, such as "row,angle,bin" for
            a stack of sinograms, or "bin,angle".
        angle_unit: unit of the angles, "degrees" or "radians".
        values: whether to look at values and settle their kind; False for who wants to know of the
            geometry alone, to whom ``ScanFile.kind`` means nothing.
        geometry: a file that says where source and detector stand, in place of what the scan says:
            Nikon's .xtekct, SkyScan's .log, RTK's .xml, ASTRA's twelve numbers a view (.geom,
            .npy, .txt), or ours (.yaml, .json), whose names ``docs/how-to/scan_cones.md`` lists.
        reversed: the object turned the other way than the file is taken to say; the angles change
            their sign.
        repeat: for a sample that is symmetric about the axis: its one TIFF image is taken for as
            many views evenly over a full turn.
        budget: bytes that one ``read`` may take; 60 % of the free memory when not given.

    Raises:
        InputError: there is no such file, its extension is unknown, or what it holds is doubtful.
        FileFormatError: the file is damaged, or holds no scan.
        ShapeError: the arrays do not fit each other.
        DTypeError: an array does not hold real numbers.
        NonFiniteError: an angle is not finite.
        PathEscapeError: the file leads to another one outside its folder.
        ResourceLimitError: an array that must be read now is larger than the budget.
    """
    path = Path(path).absolute()
    request = ScanRequest(
        dataset=dataset,
        theta=theta,
        flats=flats,
        darks=darks,
        image_key=image_key,
        kind=_one_of("kind", kind, get_args(Kind)),
        axes=axes,
        angle_unit=_one_of("angle_unit", angle_unit, get_args(AngleUnit)),
        values=checked_flag("open_scan", "values", values),
        geometry=None if geometry is None else os.fspath(geometry),
        reversed=checked_flag("open_scan", "reversed", reversed),
        repeat=repeat,
    )
    if path.suffix.lower() in DESCRIPTIONS and path.is_file():
        request = replace(request, geometry=request.geometry or str(path))
        path = projections_of(path)
    return _opened(path, request, budget)


def _opened(path: Path, request: ScanRequest, budget: int | None) -> ScanFile:
    """The scan in a file or a folder that holds projections."""
    suffix = path.suffix.lower()
    if request.repeat is not None and not (path.is_dir() or suffix in (".tif", ".tiff")):
        raise InputError(f"{path}: repeat= (--repeat) is for one TIFF image")
    known_suffix = suffix in _READERS or suffix in SCAN_READERS
    if not known_suffix and path.is_dir():
        return open_tiff_scan(path, request, budget=budget)
    if not known_suffix and not path.exists():
        raise InputError(f"{path}: there is no such file or folder")
    if not known_suffix:
        known = ", ".join(sorted({*_READERS, *SCAN_READERS, *DESCRIPTIONS}))
        raise InputError(
            f"{path}: a scan is read from a folder of TIFF files, or from {known}, not from "
            f"{suffix!r}: describe projections of one of these kinds in a few lines of .yaml "
            "(docs/how-to/scan_cones.md), or read others by a function of yours "
            "(register_scan_reader, in a file that --load names)"
        )
    with reading(path, "the file"):
        if suffix in SCAN_READERS:
            found = SCAN_READERS[suffix](path, request)
            return found if request.kind is None else replace(found, kind=request.kind)
        content = _content(path)
    readers = _READERS[suffix]
    if content not in readers:
        raise FileFormatError(
            f"{path}: the name says {' or '.join(readers)}, the content is {content}; rename or "
            "replace the file"
        )
    return readers[content](path, request, budget=budget)


def _one_of(name: str, value: Any, known: tuple[str, ...]) -> Any:
    if value is not None and value not in known:
        raise InputError(f"{name} is {value!r}, wanted {', '.join(known)}")
    return value


def _content(path: Path) -> str:
    if is_zarr(path):
        return "Zarr"
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is not a file")
    with path.open("rb") as file:
        start = file.read(212)
        for signatures, kind in _SIGNATURES:
            if start.startswith(signatures):
                return kind
        if start[124:128] in _MAT_SIGNATURES:
            return "MAT"
        if start[208:] == _MRC_SIGNATURE:
            return "MRC"
        for offset in _USER_BLOCKS:
            file.seek(offset)
            if file.read(8) == _HDF5_SIGNATURE:
                return "HDF5"
    return "of no known kind"
