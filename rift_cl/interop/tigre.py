"""TIGRE's geometry as a grid and a scan, and back.

    grid, scan = from_tigre(geo, angles)
    attributes, angles = to_tigre(grid, scan)

Projections pass as they are, (angles, rows, bins), and so do volumes, (z, y, x). At TIGRE's angle
the source stands at ``DSO (cos, sin)``, a quarter of a turn before ours: our angle is TIGRE's plus
90 degrees. Bins grow along ``(-sin, cos)`` and rows along z (its kernels count the rows of the
detector from the top and read the array from the bottom). ``offDetector`` moves the detector by
(row, bin) lengths, ``COR`` source and detector along the bins, ``offOrigin`` the volume's middle.
Source: ``computeDeltas_Siddon`` and the ray kernel in ``Siddon_projection.cu`` of TIGRE. TIGRE
itself is not needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Grid, Vectors
from rift_cl.interop.circular import number_of, numbers_of, shifted

__all__ = ["from_tigre", "to_tigre"]

_QUARTER = np.pi / 2
_ROTATIONS = "rotDetector"


def from_tigre(geo: Any, angles: ArrayLike) -> tuple[Grid, Cone | Vectors]:
    """Read a geometry of TIGRE's.

    Args:
        geo: an object with TIGRE's attributes: DSO, DSD, nDetector, dDetector, nVoxel, dVoxel, and
            perhaps offDetector, offOrigin, COR; one number each for all views. A dictionary of them
            does as well.
        angles: (views,) TIGRE's angles in radians.

    Raises:
        ShapeError: an attribute has another shape.
        InputError: an attribute is missing or no number, differs between views, or the rays are
            parallel or the detector turned.
    """
    look = geo.get if isinstance(geo, dict) else lambda name, other=None: getattr(geo, name, other)
    if look("mode", "cone") != "cone":
        raise InputError(f"TIGRE: mode is {look('mode')!r}, wanted 'cone'")
    rotation = look(_ROTATIONS)
    if rotation is not None and np.any(np.asarray(rotation, np.float64) != 0):
        raise InputError("TIGRE: rotDetector turns the detector: give its vectors, as ASTRA's")
    values = numbers_of("TIGRE", "angles", angles, shape=(None,))
    rows, bins = (int(n) for n in _vector(look, "nDetector", 2))
    pitch = _vector(look, "dDetector", 2)
    offset = _vector(look, "offDetector", 2, 0.0)
    voxels, spacing = _vector(look, "nVoxel", 3), _vector(look, "dVoxel", 3)
    grid = Grid([int(n) for n in voxels], list(spacing), list(_vector(look, "offOrigin", 3, 0.0)))
    center = (rows - 1) / 2 - offset[0] / pitch[0], (bins - 1) / 2 - offset[1] / pitch[1]
    lengths = float(_vector(look, "DSO", 1)[0]), float(_vector(look, "DSD", 1)[0])
    cone = Cone(values + _QUARTER, rows, bins, pitch, *lengths, center)
    return grid, shifted(cone, float(_vector(look, "COR", 1, 0.0)[0]))


def to_tigre(grid: Grid, scan: Cone) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Describe a grid and a scan for TIGRE.

    Args:
        grid: of a volume.
        scan: a circle with a flat detector.

    Returns:
        Attributes for ``tigre.geometry()``, by name, and the angles.

    Raises:
        InputError: the scan is no circle, or its detector is curved.
    """
    if not isinstance(scan, Cone) or scan.curved or not scan.circular or scan.heights[0]:
        raise InputError("TIGRE: wanted a Cone on a circle at z = 0 with a flat detector")
    counts = np.array([scan.rows, scan.bins])
    off = ((counts - 1) / 2 - scan.center) * scan.pitch
    spacing = np.array(grid.spacing)
    return {
        "mode": "cone",
        "DSO": scan.source_to_axis,
        "DSD": scan.source_to_detector,
        "nDetector": counts,
        "dDetector": np.array(scan.pitch),
        "sDetector": counts * scan.pitch,
        "offDetector": off,
        "nVoxel": np.array(grid.shape),
        "dVoxel": spacing,
        "sVoxel": np.array(grid.shape) * spacing,
        "offOrigin": np.array(grid.center),
        "COR": 0.0,
        "accuracy": 0.5,
    }, scan.angles - _QUARTER


def _vector(look: Any, name: str, size: int, usual: float | None = None) -> NDArray[np.float64]:
    """An attribute of so many numbers, which all views share."""
    value = look(name)
    if value is None and usual is not None:
        return np.full(size, usual)
    if value is None:
        raise InputError(f"TIGRE: the geometry has no {name}")
    numbers = np.asarray(value, np.float64) if np.ndim(value) else None
    if numbers is None:
        return np.full(size, number_of("TIGRE", name, value))
    if numbers.ndim == 1 and size == 1 and numbers.size > 1:
        numbers = numbers[:, None]
    if numbers.ndim == 2:
        if not (numbers == numbers[0]).all():
            raise InputError(f"TIGRE: {name} differs between views: give vectors, as ASTRA's")
        numbers = numbers[0]
    return numbers_of("TIGRE", name, numbers, shape=(size,))
