"""Which file says where source and detector of a scan stand, and what reads it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rift_cl.errors import FileFormatError, InputError, PathEscapeError
from rift_cl.io.boundary import reading
from rift_cl.io.scans.beam import AnyBeam
from rift_cl.io.scans.geometries.astra_vectors import read_vectors
from rift_cl.io.scans.geometries.described import DESCRIBED, read_described
from rift_cl.io.scans.geometries.nikon import read_nikon
from rift_cl.io.scans.geometries.rtk_xml import read_rtk
from rift_cl.io.scans.geometries.skyscan import read_skyscan
from rift_cl.io.scans.scan_file import ScanRequest

# Files that describe a scan and lie beside its projections.
_READERS: dict[str, Callable[[Path], AnyBeam]] = {
    ".xtekct": read_nikon,
    ".log": read_skyscan,
    **dict.fromkeys(DESCRIBED, read_described),
    ".geom": read_vectors,
}
DESCRIPTIONS = (*_READERS, ".xml")
# Those that are known for a geometry by their extension alone, wherever they lie; RTK's and ours
# have a name as well.
_TELLING = (".xtekct", ".log", ".geom")
_NAMED = ("geometry.xml", "geometry.json", "geometry.yaml", "geometry.yml")
# Arrays of vectors, where a person says that they are.
_VECTORS = (".npy", ".txt", ".csv")


def read_beam(path: Path, pitch: tuple[float, float] | None = None, unit: str = "") -> AnyBeam:
    """Source and detector as a file tells.

    Args:
        path: Nikon's .xtekct, SkyScan's .log, RTK's .xml, ASTRA's vectors (.geom, .npy, .txt,
            .csv), or ours (.yaml, .yml, .json).
        pitch: distance between rows and between bins, if the projections tell; RTK needs it.
        unit: of that pitch.

    Raises:
        InputError: there is no such file, or of no such kind; or what it says cannot be used.
    """
    suffix = path.suffix.lower()
    if suffix == ".xml":
        return read_rtk(path, pitch, unit)
    if suffix in _VECTORS:
        return read_vectors(path)
    if suffix not in _READERS:
        raise InputError(
            f"{path}: a geometry is read from {', '.join((*DESCRIPTIONS, *_VECTORS))}, not from "
            f"{suffix!r}"
        )
    return _READERS[suffix](path)


def given_beam(
    request: ScanRequest, scan: Path, pitch: tuple[float, float] | None = None, unit: str = ""
) -> AnyBeam | None:
    """What a person names with ``geometry=``, or None.

    Args:
        request: what a person says.
        scan: the scan.
        pitch: distance between rows and between bins as the scan tells.
        unit: of that.

    Raises:
        InputError: see ``read_beam``.
    """
    if request.geometry is None:
        return None
    places = [Path(request.geometry).absolute(), scan.parent / request.geometry]
    path = next((place for place in places if place.is_file()), None)
    if path is None and any(place.exists() for place in places):
        raise InputError(
            f"{scan}: the geometry {request.geometry!r} is no file that can be read twice, but a "
            "folder, a pipe or a device: copy it into a file (--geometry)"
        )
    if path is None:
        raise InputError(f"{scan}: the geometry {request.geometry!r} is not there (--geometry)")
    return read_beam(path, pitch, unit)


def description_in(folder: Path) -> Path | None:
    """The one file of a folder that says where source and detector stand, or None.

    Raises:
        FileFormatError: there are several.
    """
    with reading(folder, "the folder"):
        files = sorted(path for path in folder.iterdir() if path.is_file())
    found = [
        path
        for path in files
        if not path.name.startswith(".")
        and (path.suffix.lower() in _TELLING or path.name.lower() in _NAMED)
        and path.resolve().parent == folder.resolve()
        and not _other_log(path)
    ]
    if len(found) > 1:
        listed = ", ".join(repr(path.name) for path in found[:4])
        raise FileFormatError(
            f"{folder}: {listed} may all say where source and detector stand: name one with "
            "geometry= (--geometry)"
        )
    return found[0] if found else None


def _other_log(path: Path) -> bool:
    """Whether a .log is of something else than a SkyScan scan."""
    if path.suffix.lower() != ".log":
        return False
    with path.open("rb") as file:
        return b"object to source" not in file.read(1 << 16).lower()


def projections_of(path: Path) -> Path:
    """The folder or the file of the projections that a description belongs to.

    Args:
        path: the description. Where a scanner names a folder that is not there any more, the
            projections are those beside it.

    Raises:
        InputError: what our own file names is not there.
        PathEscapeError: it is outside the file's folder.
    """
    beam, folder = read_beam(path) if path.suffix.lower() != ".xml" else None, path.parent
    name = "" if beam is None else beam.folder.replace("\\", "/")
    if not name:
        return folder
    place = folder / name
    inside = "\0" not in name and place.resolve().is_relative_to(folder.resolve())
    if inside and place.exists():
        return place
    if path.suffix.lower() == ".xtekct":
        return folder
    if not inside:
        raise PathEscapeError(f"{path}: its projections {name!r} are outside the folder {folder}")
    raise InputError(f"{path}: its projections {name!r} are not there")
