"""What every angular basis offers, and the parts that all of them share.

A colour is sum_k B_k(d; geometry) coeff_k with d a unit vector: linear in the coefficients, and
for lobes not in the geometry, which says where a splat's lobe points and how wide it is. B_0 is
the same constant for every kind, so that the first coefficient means the same everywhere.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import pi, sqrt
from typing import Any, Literal, NamedTuple, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import DTypeError, ShapeError

Floats = NDArray[np.float64]
# B_0 of every kind: the harmonic of degree 0.
CONSTANT = 1 / sqrt(4 * pi)


class Slopes(NamedTuple):
    """All functions with their derivatives; leading axes are those of the directions.

    Args:
        values: (..., L) B_k.
        by_geometry: (..., L, G) derivatives by the geometry.
        by_directions: (..., L, 3) derivatives by the directions as they were given.
    """

    values: Floats
    by_geometry: Floats
    by_directions: Floats


class AngularGradients(NamedTuple):
    """A sum of functions with its derivatives, for C channels.

    Args:
        value: (..., C) sums.
        by_coeff: (..., L) derivatives of each channel by its own coefficients: the functions.
        by_geometry: (..., G, C) derivatives by the geometry.
        by_directions: (..., 3, C) derivatives by the directions as they were given.
    """

    value: Floats
    by_coeff: Floats
    by_geometry: Floats
    by_directions: Floats


class AngularBasis(Protocol):
    """Functions of the direction; see ``AngularFunctions`` for what the methods do."""

    @property
    def name(self) -> str:
        """``sh``, ``hg``, ``lg``, ``sg`` or ``asg``."""

    @property
    def n_linear(self) -> int:
        """L, the number of functions and of coefficients to a channel."""

    @property
    def n_geometry(self) -> int:
        """G, the numbers of geometry that a splat has."""

    def functions(self, geometry: ArrayLike | None, directions: ArrayLike) -> Floats:
        """All functions (..., L)."""

    def slopes(self, geometry: ArrayLike | None, directions: ArrayLike) -> Slopes:
        """All functions with their derivatives."""

    @overload
    def evaluate(
        self,
        coeff: ArrayLike,
        geometry: ArrayLike | None,
        directions: ArrayLike,
        grad: Literal[False] = False,
    ) -> Floats: ...
    @overload
    def evaluate(
        self,
        coeff: ArrayLike,
        geometry: ArrayLike | None,
        directions: ArrayLike,
        grad: Literal[True],
    ) -> AngularGradients: ...
    def evaluate(
        self,
        coeff: ArrayLike,
        geometry: ArrayLike | None,
        directions: ArrayLike,
        grad: bool = False,
    ) -> Floats | AngularGradients:
        """The sum of functions times coefficients."""

    def start_geometry(self, axes: ArrayLike) -> Floats:
        """A geometry (..., G) to begin with, about these axes."""


class AngularFunctions(ABC):
    """The sums that every basis forms in the same way; a kind gives its ``slopes``."""

    name: str
    n_linear: int
    n_geometry: int

    @abstractmethod
    def slopes(self, geometry: ArrayLike | None, directions: ArrayLike) -> Slopes:
        """All functions with their derivatives.

        Args:
            geometry: (..., G); anything where G is 0.
            directions: (..., 3) vectors of any length, whose leading axes are broadcast against
                those of the geometry; one of no length is taken for (0, 0, 1).

        Returns:
            The functions; NaN where a direction or the geometry is not finite, or where a
            quaternion or an axis has no direction.

        Raises:
            ShapeError: the last axis is not of G or of 3 numbers.
            DTypeError: the numbers are not real.
        """

    @abstractmethod
    def start_geometry(self, axes: ArrayLike) -> Floats:
        """A geometry (..., G) to begin with.

        Args:
            axes: (..., 3) vectors of any length that the lobes shall point along, as a viewing
                direction does: from the camera into the scene.

        Raises:
            ShapeError: the last axis is not of 3 numbers.
            DTypeError: the numbers are not real.
        """

    def functions(self, geometry: ArrayLike | None, directions: ArrayLike) -> Floats:
        """All functions (..., L); see ``slopes``."""
        return self.slopes(geometry, directions).values

    @overload
    def evaluate(
        self,
        coeff: ArrayLike,
        geometry: ArrayLike | None,
        directions: ArrayLike,
        grad: Literal[False] = False,
    ) -> Floats: ...
    @overload
    def evaluate(
        self,
        coeff: ArrayLike,
        geometry: ArrayLike | None,
        directions: ArrayLike,
        grad: Literal[True],
    ) -> AngularGradients: ...
    def evaluate(
        self,
        coeff: ArrayLike,
        geometry: ArrayLike | None,
        directions: ArrayLike,
        grad: bool = False,
    ) -> Floats | AngularGradients:
        """The sum over k of B_k times coefficient k.

        Args:
            coeff: (..., L, C) for C channels; leading axes are broadcast.
            geometry: as in ``slopes``.
            directions: as in ``slopes``.
            grad: give the derivatives as well.

        Returns:
            (..., C), or an ``AngularGradients`` with ``grad``.

        Raises:
            ShapeError: there are not L coefficients, or as in ``slopes``.
            DTypeError: the numbers are not real.
        """
        linear = real_array(coeff, f"{type(self).__name__}: coeff")
        if linear.ndim < 2 or linear.shape[-2] != self.n_linear:
            raise ShapeError(
                f"{type(self).__name__}: coeff has shape {linear.shape}, wanted "
                f"(..., {self.n_linear}, C)"
            )
        if not grad:
            return np.asarray(
                np.einsum("...k,...kc->...c", self.functions(geometry, directions), linear)
            )
        values, by_geometry, by_directions = self.slopes(geometry, directions)
        return AngularGradients(
            np.einsum("...k,...kc->...c", values, linear),
            values,
            np.einsum("...kg,...kc->...gc", by_geometry, linear),
            np.einsum("...ki,...kc->...ic", by_directions, linear),
        )


def real_array(values: Any, what: str) -> Floats:
    """Real numbers as float64.

    Raises:
        DTypeError: they are none.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise DTypeError(f"{what} has type {array.dtype}, wanted real numbers")
    return array.astype(np.float64)


def last_axis(values: Any, count: int, what: str) -> Floats:
    """Real numbers whose last axis has this length.

    Raises:
        ShapeError: it has not.
        DTypeError: they are not real.
    """
    array = real_array(values, what)
    if array.ndim < 1 or array.shape[-1] != count:
        raise ShapeError(f"{what} has shape {array.shape}, wanted (..., {count})")
    return array
