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

Beams that are not parallel have no counterpart here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Grid, Parallel
from rift_cl.geometry.numbers import one_number, real_numbers

__all__ = ["from_astra", "to_astra"]

Floats = NDArray[np.float64]
Geometry = Mapping[str, Any]
# Views differ by this much of a bin at most, or they have no pitch and no axis in common.
_SAME = 1e-4
_AXES = {"X": "GridColCount", "Y": "GridRowCount", "Z": "GridSliceCount"}
# What a vector of two dimensions holds of one of three.
_IN_PLANE = [0, 1, 3, 4, 6, 7]
_KINDS = {"parallel": 2, "parallel_vec": 2, "parallel3d": 3, "parallel3d_vec": 3}


def from_astra(proj_geom: Geometry, vol_geom: Geometry) -> tuple[Grid, Parallel]:
    """Read ASTRA's description of a parallel scan.

    Args:
        proj_geom: of type ``parallel``, ``parallel_vec``, ``parallel3d`` or ``parallel3d_vec``.
            The vectors of a scan must differ by a turn about the z axis alone: one pitch, one
            axis. The rows of a detector must be the slices of the volume.
        vol_geom: of an image for the first two, of a volume for the others.

    Returns:
        The grid and the scan, in ASTRA's unit of length.

    Raises:
        InputError: the beam is not parallel, an entry is missing or no usable number, or the
            scan is none that ``Parallel`` describes.
        ShapeError: an entry has the wrong shape, or image and scan are not of one dimension.
    """
    kind = _entry(proj_geom, "proj_geom", "type")
    if kind not in _KINDS:
        raise InputError(
            f"proj_geom is of type {kind!r}, wanted one of {', '.join(_KINDS)}: only parallel "
            "beams have a counterpart here"
        )
    grid = _grid(vol_geom)
    flat = len(grid.shape) == 2
    if len(grid.shape) != _KINDS[kind]:
        raise ShapeError(
            f"proj_geom is of type {kind!r} and vol_geom of {len(grid.shape)} dimensions, wanted "
            f"{_KINDS[kind]}"
        )
    bins = _count(proj_geom, "DetectorCount" if flat else "DetectorColCount")
    if kind.endswith("_vec"):
        vectors = _vectors(proj_geom, 6 if flat else 12)
        scan = _scan(vectors, bins, up=flat)
    else:
        scan, along = _turns(proj_geom, bins, up=flat)
        vectors = _turned(scan.angles, scan.pitch, along)
    if not flat:
        _check_rows(vectors, _count(proj_geom, "DetectorRowCount"), bins, grid)
    return grid, scan


def to_astra(grid: Grid, scan: Parallel) -> tuple[dict[str, Any], dict[str, Any]]:
    """Describe a grid and a scan for ASTRA.

    Args:
        grid: of an image or a volume.
        scan: of it. With the axis in the middle of the bins the result has angles; otherwise, or
            where a volume's middle is not at z = 0, it has vectors.

    Returns:
        ``proj_geom`` and ``vol_geom``.
    """
    flat = len(grid.shape) == 2
    sizes, option = {}, {}
    axes = zip(_AXES.items(), grid.shape[::-1], grid.spacing[::-1], grid.center[::-1], strict=False)
    for (axis, name), n, spacing, center in axes:
        middle = -center if flat and axis == "Y" else center
        sizes[name] = n
        option[f"WindowMin{axis}"] = middle - n * spacing / 2
        option[f"WindowMax{axis}"] = middle + n * spacing / 2
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
        vectors = vectors[:, _IN_PLANE]
    return {"type": f"{kind}_vec", **counts, "Vectors": vectors}


def _grid(vol_geom: Geometry) -> Grid:
    option = _mapping("vol_geom", vol_geom).get("option", {})
    option = _mapping("the option of vol_geom", option)
    shape, spacing, center = [], [], []
    for axis, name in _AXES.items():
        if axis == "Z" and name not in vol_geom:
            break
        n = _count(vol_geom, name, "vol_geom")
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
    lengths = [one_number(_entry(proj_geom, "proj_geom", name)) for name in names]
    for name, length in zip(names, lengths, strict=True):
        if not length > 0:
            raise InputError(f"proj_geom: {name} is {proj_geom[name]!r}, wanted a positive length")
    given = Parallel(_entry(proj_geom, "proj_geom", "ProjectionAngles"), bins, lengths[0])
    scan = Parallel(-given.angles, bins, lengths[0]) if up else given
    return scan, lengths[-1]


def _vectors(proj_geom: Geometry, wide: int) -> Floats:
    """Ray, detector's middle, and the steps from bin to bin and from row to row: (views, 12)."""
    values = real_numbers(_entry(proj_geom, "proj_geom", "Vectors"))
    if values is None or values.ndim != 2 or values.shape[1] != wide or not len(values):
        raise ShapeError(f"proj_geom: Vectors must be numbers of shape (angles, {wide})")
    if not np.isfinite(values).all():
        raise InputError("proj_geom: Vectors holds NaN or infinity")
    if wide == 12:
        return values
    vectors = np.zeros((len(values), 12))
    vectors[:, _IN_PLANE] = values
    return vectors


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


def _count(geometry: Geometry, key: str, name: str = "proj_geom") -> int:
    number = one_number(_entry(geometry, name, key))
    if not (number >= 1 and number.is_integer()):
        raise InputError(f"{name}: {key} is {geometry[key]!r}, wanted a positive whole number")
    return int(number)


def _entry(geometry: Geometry, name: str, key: str) -> Any:
    if key not in _mapping(name, geometry):
        raise InputError(f"{name} has no {key!r}: make it with astra.create_{name}")
    return geometry[key]


def _mapping(name: str, geometry: Any) -> Geometry:
    if not isinstance(geometry, Mapping):
        raise InputError(f"{name} is a {type(geometry).__name__}, wanted a dictionary of ASTRA's")
    return geometry
