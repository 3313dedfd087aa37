"""tomosipo's cone geometries as scans, and back.

    scan = from_tomosipo(pg)
    pg = tomosipo.cone_vec(**to_tomosipo(scan))

tomosipo is ASTRA in another order: vectors are (z, y, x), and projections (rows, angles, bins).
Source: ``ConeVectorGeometry`` of tomosipo, whose ``to_astra`` turns its vectors round and changes
nothing else. tomosipo itself is not needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Vectors
from rift_cl.interop.circular import circular, numbers_of, places

__all__ = ["from_tomosipo", "to_tomosipo"]

_PARTS = ("src_pos", "det_pos", "det_u", "det_v")


def from_tomosipo(geometry: Any) -> Cone | Vectors:
    """Read a geometry of tomosipo's.

    Args:
        geometry: a cone, or cone vectors: an object with ``src_pos``, ``det_pos``, ``det_v``,
            ``det_u`` (views, 3), and ``det_shape``.

    Raises:
        InputError: it has no such attributes.
        ShapeError: they have another shape.
    """
    missing = [name for name in (*_PARTS, "det_shape") if not hasattr(geometry, name)]
    if missing:
        raise InputError(
            f"tomosipo: {type(geometry).__name__} has no {missing[0]}, wanted a cone or cone_vec"
        )
    source, middle, across, down = (
        numbers_of("tomosipo", name, getattr(geometry, name), shape=(None, 3))[:, ::-1]
        for name in _PARTS
    )
    rows, bins = geometry.det_shape
    return circular(Vectors(source, middle, across, down, rows, bins))


def to_tomosipo(scan: Cone | Vectors) -> dict[str, Any]:
    """The arguments of ``tomosipo.cone_vec``.

    Raises:
        InputError: the detector is curved.
    """
    vectors = places(scan)
    order = (vectors.source, vectors.middle, vectors.across, vectors.down)
    parts = {name: np.ascontiguousarray(v[:, ::-1]) for name, v in zip(_PARTS, order, strict=True)}
    return {"shape": (vectors.rows, vectors.bins), **parts}
