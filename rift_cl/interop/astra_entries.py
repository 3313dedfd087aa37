"""Entries of ASTRA's dictionaries, checked as they are taken out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers

Floats = NDArray[np.float64]
Geometry = Mapping[str, Any]
# What a vector of two dimensions holds of one of three.
IN_PLANE = [0, 1, 3, 4, 6, 7]


def vectors_of(proj_geom: Geometry, wide: int) -> Floats:
    """Ray or source, detector's middle, steps from bin to bin and from row to row: (views, 12)."""
    values = real_numbers(entry_of(proj_geom, "proj_geom", "Vectors"))
    if values is None or values.ndim != 2 or values.shape[1] != wide or not len(values):
        raise ShapeError(f"proj_geom: Vectors must be numbers of shape (angles, {wide})")
    if not np.isfinite(values).all():
        raise InputError("proj_geom: Vectors holds NaN or infinity")
    if wide == 12:
        return values
    vectors = np.zeros((len(values), 12))
    vectors[:, IN_PLANE] = values
    return vectors


def count_of(geometry: Geometry, key: str, name: str = "proj_geom") -> int:
    """A positive whole number."""
    number = one_number(entry_of(geometry, name, key))
    if not (number >= 1 and number.is_integer()):
        raise InputError(f"{name}: {key} is {geometry[key]!r}, wanted a positive whole number")
    return int(number)


def entry_of(geometry: Geometry, name: str, key: str) -> Any:
    """An entry that must be there."""
    if key not in mapping_of(name, geometry):
        raise InputError(f"{name} has no {key!r}: make it with astra.create_{name}")
    return geometry[key]


def mapping_of(name: str, geometry: Any) -> Geometry:
    """A dictionary."""
    if not isinstance(geometry, Mapping):
        raise InputError(f"{name} is a {type(geometry).__name__}, wanted a dictionary of ASTRA's")
    return geometry
