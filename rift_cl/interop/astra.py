"""ASTRA's geometry dictionaries as a grid and a scan, and back.

    from rift_cl.interop.astra import from_astra

    grid, scan = from_astra(proj_geom, vol_geom)
    A = rift.Projector(grid, scan)

The dictionaries are those of ``astra.create_proj_geom`` and ``astra.create_vol_geom``; ASTRA
itself is not needed. Arrays pass between the two packages as they are, except that ASTRA stores
the projections of a volume as (rows, angles, bins), and this package as (angles, rows, bins).

ASTRA's detector at the angle a looks along (sin a, -cos a), with bins that grow towards
(cos a, sin a), as ours do. Its images in two dimensions have y pointing up, from the last row to
the first, so that their angles change sign here; its volumes have y and z growing with the index,
as ours have (the geometries of astra-toolbox 2.5, and its three-dimensional projector).

Cones pass as they are: source, detector and volume of ``cone`` and ``cone_vec`` stand where ours
do.
Images of fans (``fanflat``, ``fanflat_vec``) are ours upside down, ``image[::-1]``, and their
projections as they are; no change of angles would do for both, since a fan has a side.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Fan, Grid, Parallel, Scan
from rift_cl.geometry.numbers import one_number
from rift_cl.interop.astra_entries import (
    IN_PLANE,
    Geometry,
    count_of,
    entry_of,
    mapping_of,
    vectors_of,
)
from rift_cl.interop.astra_point import point_proj_geom, point_scan

__all__ = ["from_astra", "to_astra"]

Floats = NDArray[np.float64]
# Views differ by this much of a bin at most, or they have no pitch and no axis in common.
_SAME = 1e-4
_AXES = {"X": "GridColCount", "Y": "GridRowCount", "Z": "GridSliceCount"}
_KINDS = {
    "parallel": 2,
    "parallel_vec": 2,
    "parallel3d": 3,
    "parallel3d_vec": 3,
    "fanflat": 2,
    "fanflat_vec": 2,
    "cone": 3,
    "cone_vec": 3,
}


def from_astra(proj_geom: Geometry, vol_geom: Geometry) -> tuple[Grid, Scan]:
    """Read ASTRA's description of a scan.

    Args:
        proj_geom: of type ``parallel``, ``fanflat``, ``parallel3d`` or ``cone``, or one of these
            with ``_vec``. The vectors of parallel rays and of fans must differ by a turn about the
            z axis alone: one pitch, one axis. The rows of a detector of parallel rays must be the
            slices of the volume.
        vol_geom: of an image for the first two, of a volume for the others.

    Returns:
        The grid and the scan, in ASTRA's unit of length: a ``Parallel``, a ``Fan``, a ``Cone``, or
        ``Vectors`` where the sources of ``cone_vec`` stand on no circle.

    Raises:
        InputError: the type is not known, an entry is missing or no usable number, or the scan is
            none that ``Parallel`` or ``Fan`` describes.
        ShapeError: an entry has the wrong shape, or image and scan are not of one dimension.
    """
    kind = entry_of(proj_geom, "proj_geom", "type")
    if kind not in _KINDS:
        raise InputError(
            f"proj_geom is of type {kind!r}, wanted one of {', '.join(_KINDS)}: no other has a "
            "counterpart here"
        )
    grid = _grid(vol_geom)
    flat = len(grid.shape) == 2
    if len(grid.shape) != _KINDS[kind]:
        raise ShapeError(
            f"proj_geom is of type {kind!r} and vol_geom of {len(grid.shape)} dimensions, wanted "
            f"{_KINDS[kind]}"
        )
    if kind.startswith(("fan", "cone")):
        # The rows of a fan's image are ours in reverse.
        middle = (-grid.center[0], *grid.center[1:]) if flat else grid.center
        return Grid(grid.shape, grid.spacing, middle), point_scan(kind, proj_geom)
    bins = count_of(proj_geom, "DetectorCount" if flat else "DetectorColCount")
    if kind.endswith("_vec"):
        vectors = vectors_of(proj_geom, 6 if flat else 12)
        scan = _scan(vectors, bins, up=flat)
    else:
        scan, along = _turns(proj_geom, bins, up=flat)
        vectors = _turned(scan.angles, scan.pitch, along)
    if not flat:
        _check_rows(vectors, count_of(proj_geom, "DetectorRowCount"), bins, grid)
    return grid, scan


def to_astra(grid: Grid, scan: Scan) -> tuple[dict[str, Any], dict[str, Any]]:
    """Describe a grid and a scan for ASTRA.

    Args:
        grid: of an image or a volume.
        scan: of it; a fan of an image, a cone or vectors of a volume. With the axis in the middle
            of the bins the result has angles; otherwise, or where parallel rays look at a volume
            whose middle is not at z = 0, it has vectors.

    Returns:
        ``proj_geom`` and ``vol_geom``.

    Raises:
        InputError: the detector is curved.
        ShapeError: grid and scan are not of one dimension.
    """
    flat = len(grid.shape) == 2
    sizes, option = {}, {}
    axes = zip(_AXES.items(), grid.shape[::-1], grid.spacing[::-1], grid.center[::-1], strict=False)
    for (axis, name), n, spacing, center in axes:
        middle = -center if flat and axis == "Y" and isinstance(scan, Parallel) else center
        sizes[name] = n
        option[f"WindowMin{axis}"] = middle - n * spacing / 2
        option[f"WindowMax{axis}"] = middle + n * spacing / 2
    if not isinstance(scan, Parallel):
        if flat != isinstance(scan, Fan):
            raise ShapeError("ASTRA: a Fan is of an image, a Cone or Vectors of a volume")
        return point_proj_geom(scan), {"option": option, **sizes}
    angles = -scan.angles if flat else scan.angles.copy()
    return _proj_geom(grid, scan, angles), {"option": option, **sizes}


def _proj_geom(grid: Grid, scan: Parallel, angles: Floats) -> dict[str, Any]:
    flat, shift = len(grid.shape) == 2, (scan.bins - 1) / 2 - scan.center
    height = 0.0 if flat else grid.center[0]
    if flat:
        counts = {"DetectorCount": scan.bins}
        spacings = {"DetectorWidth": scan.pitch}
    else:
        counts = {"DetectorRowCount": grid.slices, "DetectorColCount": scan.bins}
        spacings = {"DetectorSpacingX": scan.pitch, "DetectorSpacingY": grid.spacing[0]}
    kind = "parallel" if flat else "parallel3d"
    if shift == 0 and height == 0:
        return {"type": kind, **spacings, **counts, "ProjectionAngles": angles}
    vectors = _turned(angles, scan.pitch, grid.spacing[0])
    vectors[:, 3:6] = shift * vectors[:, 6:9] + [0, 0, height]
    if flat:
        vectors = vectors[:, IN_PLANE]
    return {"type": f"{kind}_vec", **counts, "Vectors": vectors}


def _grid(vol_geom: Geometry) -> Grid:
    option = mapping_of("vol_geom", vol_geom).get("option", {})
    option = mapping_of("the option of vol_geom", option)
    shape, spacing, center = [], [], []
    for axis, name in _AXES.items():
        if axis == "Z" and name not in vol_geom:
            break
        n = count_of(vol_geom, name, "vol_geom")
        low = one_number(option.get(f"WindowMin{axis}", -n / 2))
        high = one_number(option.get(f"WindowMax{axis}", n / 2))
        if not low < high:
            raise InputError(f"vol_geom: its window along {axis} is not from a number to a larger")
        shape.append(n)
        spacing.append((high - low) / n)
        center.append((low + high) / 2)
    if len(shape) == 2:
        center[1] = -center[1]
    return Grid(shape[::-1], spacing[::-1], center[::-1])


def _turns(proj_geom: Geometry, bins: int, *, up: bool) -> tuple[Parallel, float]:
    """The scan of a geometry that has angles, and the distance of its rows."""
    names = ["DetectorWidth"] if up else ["DetectorSpacingX", "DetectorSpacingY"]
    lengths = [one_number(entry_of(proj_geom, "proj_geom", name)) for name in names]
    for name, length in zip(names, lengths, strict=True):
        if not length > 0:
            raise InputError(f"proj_geom: {name} is {proj_geom[name]!r}, wanted a positive length")
    given = Parallel(entry_of(proj_geom, "proj_geom", "ProjectionAngles"), bins, lengths[0])
    scan = Parallel(-given.angles, bins, lengths[0]) if up else given
    return scan, lengths[-1]


def _turned(angles: Floats, across: float, along: float) -> Floats:
    vectors = np.zeros((len(angles), 12))
    vectors[:, 0], vectors[:, 1] = np.sin(angles), -np.cos(angles)
    vectors[:, 6], vectors[:, 7] = across * np.cos(angles), across * np.sin(angles)
    vectors[:, 11] = along
    return vectors


def _scan(vectors: Floats, bins: int, *, up: bool) -> Parallel:
    rays = vectors[:, :2]
    lengths = np.hypot(*rays.T)
    if not lengths.all():
        raise InputError("proj_geom: the ray of a view has no direction across the z axis")
    normals = np.stack([-rays[:, 1], rays[:, 0]], axis=1) / lengths[:, None]
    pitches = (normals * vectors[:, 6:8]).sum(1)
    normals *= np.where(pitches < 0, -1, 1)[:, None]
    pitches, middles = np.abs(pitches), (normals * vectors[:, 3:5]).sum(1)
    pitch, middle = pitches.mean(), middles.mean()
    spread = max(np.ptp(pitches) * bins / 2, np.ptp(middles))
    if not pitch > 0 or spread > _SAME * pitch:
        raise InputError(
            "proj_geom: its views have no pitch and no axis in common, which a parallel scan "
            "must have: resample or shift the views first"
        )
    angles = np.arctan2(normals[:, 1], normals[:, 0])
    return Parallel(-angles if up else angles, bins, pitch, (bins - 1) / 2 - middle / pitch)


def _check_rows(vectors: Floats, rows: int, bins: int, grid: Grid) -> None:
    """Rays across the z axis, and the detector's rows where the slices are."""
    spacing, center = grid.spacing[0], grid.center[0]
    rise = np.abs(vectors[:, 2]) / np.linalg.norm(vectors[:, :3], axis=1) * max(grid.shape)
    off = [
        rise * max(grid.spacing),
        np.abs(vectors[:, 5] - center),
        np.abs(vectors[:, 8]) * bins,
        np.abs(vectors[:, 9:] - [0, 0, spacing]).max(1) * rows,
    ]
    if rows != grid.slices or np.max(off) > _SAME * spacing:
        raise InputError(
            f"proj_geom: the {rows} rows of its detector must be the {grid.slices} slices of the "
            f"volume, {spacing:g} apart about z = {center:g}, and its rays lie in them"
        )
