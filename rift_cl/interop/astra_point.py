"""ASTRA's fans and cones: the geometries of rays from a point."""

from __future__ import annotations

from typing import Any

import numpy as np

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Fan, Vectors
from rift_cl.interop.astra_entries import (
    IN_PLANE,
    Floats,
    Geometry,
    count_of,
    entry_of,
    vectors_of,
)
from rift_cl.interop.circular import circular, number_of, numbers_of, places


def point_scan(kind: str, proj_geom: Geometry) -> Fan | Cone | Vectors:
    """The scan of a geometry of type ``fanflat``, ``cone``, or one of them with ``_vec``.

    Raises:
        InputError: an entry is missing or no usable number, or a fan is not circular.
        ShapeError: an entry has the wrong shape.
    """
    flat = kind.startswith("fan")
    bins = count_of(proj_geom, "DetectorCount" if flat else "DetectorColCount")
    rows = 1 if flat else count_of(proj_geom, "DetectorRowCount")
    if kind.endswith("_vec"):
        vectors = vectors_of(proj_geom, 6 if flat else 12)
        if flat:
            # A fan's detector has one row; any height does.
            vectors[:, 11] = np.hypot(vectors[:, 6], vectors[:, 7])
            return Cone.of_vectors(_places(vectors, 1, bins), tolerance=1e-4).fan()
        return circular(_places(vectors, rows, bins))
    names = ["DetectorWidth"] if flat else ["DetectorSpacingY", "DetectorSpacingX"]
    pitch = [_length(proj_geom, name) for name in names]
    to_axis, beyond = (_length(proj_geom, f"DistanceOrigin{end}") for end in ("Source", "Detector"))
    angles = numbers_of(
        "proj_geom",
        "ProjectionAngles",
        entry_of(proj_geom, "proj_geom", "ProjectionAngles"),
        shape=(None,),
    )
    if flat:
        return Fan(angles, bins, pitch[0], to_axis, to_axis + beyond)
    return Cone(angles, rows, bins, pitch, to_axis, to_axis + beyond)


def point_proj_geom(scan: Fan | Cone | Vectors) -> dict[str, Any]:
    """The dictionary of a scan.

    Raises:
        InputError: the detector is curved.
    """
    if isinstance(scan, Vectors):
        return _vector_geom(scan, flat=False)
    if scan.curved:
        raise InputError("ASTRA: curved is True, and its detectors are flat")
    flat = isinstance(scan, Fan)
    cone = scan if isinstance(scan, Cone) else _one_row(scan)
    counts = (cone.rows, cone.bins)
    middle = all(c == (n - 1) / 2 for c, n in zip(cone.center, counts, strict=True))
    if not middle or cone.heights.any():
        return _vector_geom(places(cone), flat=flat)
    beyond = cone.source_to_detector - cone.source_to_axis
    sizes: dict[str, Any] = {
        "DetectorSpacingX": cone.pitch[1],
        "DetectorSpacingY": cone.pitch[0],
        "DetectorRowCount": cone.rows,
        "DetectorColCount": cone.bins,
    }
    if flat:
        sizes = {"DetectorWidth": cone.pitch[1], "DetectorCount": cone.bins}
    return {
        "type": "fanflat" if flat else "cone",
        **sizes,
        "ProjectionAngles": cone.angles.copy(),
        "DistanceOriginSource": cone.source_to_axis,
        "DistanceOriginDetector": beyond,
    }


def _one_row(fan: Fan) -> Cone:
    lengths = fan.pitch, fan.source_to_axis, fan.source_to_detector
    return Cone(fan.angles, 1, fan.bins, *lengths, (0, fan.center))


def _vector_geom(scan: Vectors, *, flat: bool) -> dict[str, Any]:
    vectors = np.concatenate([scan.source, scan.middle, scan.across, scan.down], axis=1)
    if flat:
        return {"type": "fanflat_vec", "DetectorCount": scan.bins, "Vectors": vectors[:, IN_PLANE]}
    counts = {"DetectorRowCount": scan.rows, "DetectorColCount": scan.bins}
    return {"type": "cone_vec", **counts, "Vectors": vectors}


def _places(vectors: Floats, rows: int, bins: int) -> Vectors:
    source, middle, across, down = (vectors[:, k : k + 3] for k in (0, 3, 6, 9))
    return Vectors(source, middle, across, down, rows, bins)


def _length(proj_geom: Geometry, name: str) -> float:
    return number_of("proj_geom", name, entry_of(proj_geom, "proj_geom", name))
