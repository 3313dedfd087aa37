"""What is asked of an angular basis that a user registers, before colours are made of it.

Shapes, finite values, the constant in the first place, and slopes that are those of the functions:
a derivative with a mistake in it would end in a fit that is merely worse than it could be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rift_cl.basis.angular.protocol import CONSTANT, AngularBasis, Floats, Slopes
from rift_cl.errors import InputError

_POINTS = 24
# Of the differences: one for functions computed in float64 and one for those in float32, whose
# rounding the first would show. A wrong slope agrees with neither.
_STEPS = 1e-5, 1e-3
# Of the largest slope: what differences lose, and a function that is not quite smooth.
_TOLERANCE = 1e-3
# Share of the slopes that may differ: functions may have edges.
_EDGES = 0.1


def check_own_basis(name: str, basis: AngularBasis, n_linear: int) -> None:
    """Check a basis where some lobes meet some directions.

    Args:
        name: what it is called.
        basis: the basis.
        n_linear: the number of functions that it was asked for.

    Raises:
        InputError: it has another number of functions or no geometry, arrays of other shapes,
            values that are not finite, functions that start as zero or as one another, another
            first function than the constant, or slopes that are not those of its functions.
    """
    said = f"angular basis {name!r}"
    if basis.n_linear != n_linear or not basis.n_geometry >= 1:
        raise InputError(
            f"{said}: has {basis.n_linear} functions and {basis.n_geometry} numbers of geometry, "
            f"wanted {n_linear} and at least one"
        )
    random = np.random.default_rng(0)
    axes, directions = random.normal(size=(2, _POINTS, 3))
    geometry = _array(f"{said}: start_geometry", basis.start_geometry(axes), basis.n_geometry)
    _check_start(said, _slopes(said, basis, geometry, directions).values)
    geometry = geometry + 0.01 * random.normal(size=geometry.shape)
    slopes = _slopes(said, basis, geometry, directions)
    if not np.allclose(slopes.values[:, 0], CONSTANT):
        raise InputError(
            f"{said}: its first function is {slopes.values[0, 0]:.4g}, wanted the constant "
            f"{CONSTANT:.4g} (rift_cl.basis.angular.CONSTANT), which all kinds begin with"
        )
    for axis, unit in enumerate(np.eye(basis.n_geometry)):

        def by_geometry(step: float, unit: Floats = unit) -> Floats:
            return _slopes(said, basis, geometry + step * unit, directions).values

        _compare(f"{said}: by_geometry[..., {axis}]", slopes.by_geometry[..., axis], by_geometry)
    for axis, unit in enumerate(np.eye(3)):

        def by_direction(step: float, unit: Floats = unit) -> Floats:
            return _slopes(said, basis, geometry, directions + step * unit).values

        found = slopes.by_directions[..., axis]
        _compare(f"{said}: by_directions[..., {axis}]", found, by_direction)


def _check_start(said: str, values: Floats) -> None:
    """Refuse functions that a fit cannot tell apart, or that it cannot move away from zero.

    Coefficients are zero at first, so that the slope by a geometry is, too; and that by a
    coefficient is the function itself.
    """
    zero = np.flatnonzero(~values.any(axis=0))
    if zero.size:
        raise InputError(
            f"{said}: function {zero[0]} is 0 everywhere where start_geometry puts it, and nothing "
            "that a fit learns would move it from there: start it elsewhere"
        )
    for number in range(1, values.shape[1]):
        same = np.flatnonzero(np.isclose(values[:, :number], values[:, [number]]).all(axis=0))
        if same.size:
            raise InputError(
                f"{said}: functions {same[0]} and {number} are the same where start_geometry puts "
                "them, and would stay so in a fit: start them apart"
            )


def _slopes(said: str, basis: AngularBasis, geometry: Floats, directions: Floats) -> Slopes:
    found = basis.slopes(geometry, directions)
    if not isinstance(found, Slopes):
        raise InputError(f"{said}: slopes gives {type(found).__name__}, wanted Slopes")
    n = basis.n_linear
    return Slopes(
        _array(f"{said}: values", found.values, n),
        _array(f"{said}: by_geometry", found.by_geometry, n, basis.n_geometry),
        _array(f"{said}: by_directions", found.by_directions, n, 3),
    )


def _array(what: str, values: Any, *shape: int) -> Floats:
    """Numbers for each of the points."""
    array = np.asarray(values)
    wanted = (_POINTS, *shape)
    if array.dtype.kind not in "fiu" or array.dtype == np.float16 or array.shape != wanted:
        raise InputError(
            f"{what} of {_POINTS} directions has shape {array.shape} and type {array.dtype}, "
            f"wanted float64 or float32 of shape {wanted}"
        )
    if not np.isfinite(array).all():
        raise InputError(f"{what} holds NaN or infinity")
    return array.astype(np.float64)


def _compare(what: str, slopes: Floats, values: Callable[[float], Floats]) -> None:
    """Compare slopes with differences of the values so far along the axis on either side."""
    both = [(values(step) - values(-step)) / (2 * step) for step in _STEPS]
    differences = min(both, key=lambda found: float(np.abs(slopes - found).mean()))
    off = np.abs(slopes - differences)
    bad = off > _TOLERANCE * max(np.abs(differences).max(), np.abs(slopes).max(), 1e-6)
    if bad.mean() > _EDGES:
        worst = np.unravel_index(np.argmax(off), off.shape)
        raise InputError(
            f"{what} is {slopes[worst]:.4g} where differences of function {worst[1]} give "
            f"{differences[worst]:.4g}: the derivative is not that of the function"
        )
