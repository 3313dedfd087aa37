"""LEAP's cone beams as scans, and back: the arguments of its ``set_conebeam``.

    kind, arguments = to_leap(scan)
    getattr(leapct, f"set_{kind}")(**arguments)
    scan = from_leap(**arguments)

Projections pass as they are, (angles, rows, bins), volumes as (z, y, x); lengths are millimetres
there and whatever the scan has here. LEAP's angle is ours in degrees: it subtracts a quarter of a
turn (``parameters::set_angles``), and its source then stands at ``R (cos, sin) = R (sin a, -cos
a)``, with bins along ``(cos a, sin a)`` and rows along z. ``tau`` moves source and detector
against the bins. Source of the formulas: the documentation of ``set_conebeam`` in LEAP 1.26. LEAP
itself is not needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Vectors
from rift_cl.interop.circular import circular, number_of, numbers_of, places, shifted

__all__ = ["from_leap", "to_leap"]


def from_leap(
    numAngles: int,
    numRows: int,
    numCols: int,
    pixelHeight: float,
    pixelWidth: float,
    centerRow: float | None = None,
    centerCol: float | None = None,
    phis: ArrayLike | None = None,
    sod: float = 0.0,
    sdd: float = 0.0,
    tau: float = 0.0,
    helicalPitch: float = 0.0,
    *,
    sourcePositions: ArrayLike | None = None,
    moduleCenters: ArrayLike | None = None,
    rowVectors: ArrayLike | None = None,
    colVectors: ArrayLike | None = None,
) -> Cone | Vectors:
    """Read the arguments of LEAP's ``set_conebeam`` or ``set_modularbeam``.

    Args:
        numAngles: number of views.
        numRows: number of rows.
        numCols: number of bins.
        pixelHeight: distance of rows.
        pixelWidth: distance of bins.
        centerRow: row that the ray through the origin hits.
        centerCol: bin that it hits.
        phis: (angles,) degrees.
        sod: distance of the source from the axis.
        sdd: distance of the source from the detector.
        tau: offset of source and detector against the bins.
        helicalPitch: 0; a helix is told by vectors.
        sourcePositions: (angles, 3) of a modular beam, as the following.
        moduleCenters: (angles, 3) middles of the detector.
        rowVectors: (angles, 3) unit vectors from row to row.
        colVectors: (angles, 3) unit vectors from bin to bin.

    Raises:
        ShapeError: an array has another shape.
        InputError: a number is none, or a helix is given by its pitch.
    """
    counts = int(number_of("LEAP", "numRows", numRows)), int(number_of("LEAP", "numCols", numCols))
    pitch = number_of("LEAP", "pixelHeight", pixelHeight), number_of("LEAP", "", pixelWidth)
    views = int(number_of("LEAP", "numAngles", numAngles))
    if sourcePositions is not None:
        given = (sourcePositions, moduleCenters, colVectors, rowVectors)
        names = ("sourcePositions", "moduleCenters", "colVectors", "rowVectors")
        source, middle, across, down = (
            numbers_of("LEAP", name, values, shape=(views, 3))
            for name, values in zip(names, given, strict=True)
        )
        return circular(Vectors(source, middle, pitch[1] * across, pitch[0] * down, *counts))
    if number_of("LEAP", "helicalPitch", helicalPitch):
        raise InputError("LEAP: helicalPitch is not 0: give a helix as a modular beam")
    angles = np.deg2rad(numbers_of("LEAP", "phis", phis, shape=(views,)))
    center = (
        ((counts[0] - 1) / 2 if centerRow is None else number_of("LEAP", "", centerRow)),
        ((counts[1] - 1) / 2 if centerCol is None else number_of("LEAP", "", centerCol)),
    )
    cone = Cone(angles, *counts, pitch, sod, sdd, center)
    return shifted(cone, -number_of("LEAP", "tau", tau))


def to_leap(scan: Cone | Vectors) -> tuple[str, dict[str, Any]]:
    """Describe a scan for LEAP.

    Args:
        scan: a cone with a flat detector, or vectors of one pitch.

    Returns:
        ``"conebeam"`` or ``"modularbeam"``, and the arguments of LEAP's function of that name.

    Raises:
        InputError: the detector is curved, or the pitch of vectors changes.
    """
    if isinstance(scan, Cone) and scan.circular and not scan.heights[0] and not scan.curved:
        return "conebeam", {
            **_sizes(scan.views, scan.rows, scan.bins, scan.pitch),
            "centerRow": scan.center[0],
            "centerCol": scan.center[1],
            "phis": np.rad2deg(scan.angles).astype(np.float32),
            "sod": scan.source_to_axis,
            "sdd": scan.source_to_detector,
        }
    vectors = places(scan)
    lengths = [np.linalg.norm(step, axis=1) for step in (vectors.down, vectors.across)]
    if max(np.ptp(length) / length.mean() for length in lengths) > 1e-6:
        raise InputError("Vectors: the pitch changes from view to view, LEAP has one for all")
    pitch = float(lengths[0].mean()), float(lengths[1].mean())
    return "modularbeam", {
        **_sizes(vectors.views, vectors.rows, vectors.bins, pitch),
        "sourcePositions": vectors.source.astype(np.float32),
        "moduleCenters": vectors.middle.astype(np.float32),
        "rowVectors": (vectors.down / pitch[0]).astype(np.float32),
        "colVectors": (vectors.across / pitch[1]).astype(np.float32),
    }


def _sizes(views: int, rows: int, bins: int, pitch: tuple[float, float]) -> dict[str, Any]:
    return {
        "numAngles": views,
        "numRows": rows,
        "numCols": bins,
        "pixelHeight": pitch[0],
        "pixelWidth": pitch[1],
    }
