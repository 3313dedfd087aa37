"""Beam hardening of one material: line integrals made proportional to thickness again.

A tube's soft rays are absorbed first, so that the line integral y of a polychromatic beam grows
less and less with thickness: uniform objects come out darker in the middle (cupping). Of one
material y is a function of thickness alone, and its inverse, fitted by a polynomial, undoes it
(G. T. Herman, Correction for beam hardening in computed tomography, Phys. Med. Biol. 24, 81, 1979).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import real_numbers
from rift_cl.reconstruct.preprocess.projection_array import as_projections

Floats = NDArray[np.float32]
# Places at which the polynomial is looked at for a fall, between 0 and the largest integral.
_PLACES = 1001
# Values that are corrected at a time, which bounds the copies.
_AT_A_TIME = 1 << 22


def linearised(projections: ArrayLike, coefficients: Sequence[float]) -> Floats:
    """Line integrals of one material, proportional to its thickness.

    Args:
        projections: line integrals (angle, row, bin) or (angle, bin), no unit.
        coefficients: (a1, a2, ...) of the polynomial ``a1 y + a2 y^2 + ...``; there is no constant,
            for air stays 0. Below 0, where there is noise alone, it is ``a1 y``.

    Returns:
        float32 of the same shape.

    Raises:
        InputError: the coefficients are no finite numbers, or the polynomial falls somewhere
            between 0 and the largest line integral, so that thicker would count for thinner.
    """
    values = as_projections(projections, name="linearised: projections")
    powers = checked_coefficients(coefficients)
    _check_rising(powers, float(values.max(initial=0.0)))
    result = np.empty(values.shape, np.float32)
    flat, filled = values.reshape(-1), result.reshape(-1)
    for start in range(0, flat.size, _AT_A_TIME):
        y = flat[start : start + _AT_A_TIME].astype(np.float64)
        raised = np.polynomial.polynomial.polyval(y, [0.0, *powers])
        filled[start : start + _AT_A_TIME] = np.where(y > 0, raised, powers[0] * y)
    return result


def checked_coefficients(coefficients: Sequence[float]) -> list[float]:
    """The coefficients of a linearisation.

    Raises:
        InputError: they are no finite numbers, or the first is not positive.
    """
    numbers = real_numbers(coefficients)
    if numbers is None or numbers.ndim != 1 or not numbers.size or not np.isfinite(numbers).all():
        raise InputError(
            f"linearised: coefficients are {coefficients!r}, wanted finite numbers a1, a2, ..."
        )
    if not numbers[0] > 0:
        raise InputError(f"linearised: a1 is {numbers[0]:g}, wanted a positive number")
    return [float(number) for number in numbers]


def _check_rising(powers: list[float], largest: float) -> None:
    y = np.linspace(0, largest, _PLACES)
    slope = np.polynomial.polynomial.polyval(y, [k * a for k, a in enumerate(powers, 1)])
    falling = np.flatnonzero(slope <= 0)
    if falling.size:
        raise InputError(
            f"linearised: the polynomial falls from y = {y[falling[0]]:.3g} on, and line integrals "
            f"reach {largest:.3g}: wanted one that rises over all of them"
        )
