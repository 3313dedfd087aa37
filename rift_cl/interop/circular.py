"""Places of source and detector as the simplest scan that has these rays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Cone, Vectors
from rift_cl.geometry.numbers import one_number, real_numbers

Floats = NDArray[np.float64]
# Bins by which source or detector may be off a circle that is one all the same.
_CIRCULAR = 1e-4


def circular(vectors: Vectors) -> Cone | Vectors:
    """The cone that vectors are those of; themselves where there is none."""
    try:
        return Cone.of_vectors(vectors, tolerance=_CIRCULAR)
    except InputError:
        return vectors


def shifted(cone: Cone, along: float) -> Cone | Vectors:
    """A cone whose source and detector stand beside where they would, in the direction of bins.

    Args:
        cone: the cone.
        along: by how much, in its unit of length; positive along growing bins.
    """
    if not along:
        return cone
    straight = cone.vectors()
    step = along / cone.pitch[1] * straight.across
    source, middle = straight.source + step, straight.middle + step
    return Vectors(source, middle, straight.across, straight.down, cone.rows, cone.bins)


def places(scan: Cone | Vectors) -> Vectors:
    """Source and detector of every view."""
    return scan.vectors() if isinstance(scan, Cone) else scan


def number_of(package: str, name: str, value: Any) -> float:
    """A finite number of another package's.

    Raises:
        InputError: it is none.
    """
    number = one_number(value)
    if not np.isfinite(number):
        raise InputError(f"{package}: {name} is {value!r}, wanted a finite number")
    return number


def numbers_of(package: str, name: str, value: Any, *, shape: tuple[int | None, ...]) -> Floats:
    """Finite numbers of another package's; None in a shape is any length.

    Raises:
        InputError: they are none.
        ShapeError: they have another shape.
    """
    numbers = real_numbers(value)
    if numbers is None or not np.isfinite(numbers).all():
        raise InputError(f"{package}: {name} holds something else than finite numbers")
    fits = numbers.ndim == len(shape) and all(
        wanted in (None, n) for n, wanted in zip(numbers.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise ShapeError(f"{package}: {name} has shape {numbers.shape}, wanted ({wanted})")
    return numbers
