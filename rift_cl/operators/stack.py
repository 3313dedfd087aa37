"""Operators of one domain on top of each other: ``[A; B] x = [A x; B x]``.

What a solver of least squares wants for a penalty of one's own, or for two scans of one object:
``|A x - y|^2 + |w G x|^2`` is ``|vstack(A, w * G) x - [y; 0]|^2``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.elementwise import put_run, take_run
from rift_cl.errors import InputError, ShapeError, check_type
from rift_cl.operators.algebra import check_one_kind
from rift_cl.operators.composite import Composite
from rift_cl.operators.linear import LinearOperator, Shape


def vstack(*operators: LinearOperator | Sequence[LinearOperator]) -> Stack:
    """Stack operators of one domain; ``vstack(A.T, B.T).T`` puts two of one range side by side.

    Args:
        *operators: two or more, of one domain, type and device; or one sequence of them, as
            ``numpy.vstack`` and ``scipy.sparse.vstack`` take.

    Returns:
        The operator from their domain to all results behind each other: along the first axis where
        they agree in all others, as two scans of one detector do, and flat otherwise, in the order
        of ``numpy.concatenate([a.ravel(), b.ravel()])``.

    Raises:
        InputError: there are fewer than two.
        ShapeError: their domains differ.
        DTypeError: their types differ.
        DeviceError: they are on two devices.
    """
    match operators:
        case [list() | tuple() as together]:
            return Stack(*together)
    return Stack(*operators)  # type: ignore[arg-type]  # what is none, Stack names


class Stack(Composite):
    """Operators on top of each other; see ``vstack``."""

    def __init__(self, *operators: LinearOperator) -> None:
        for number, operator in enumerate(operators):
            check_type("vstack", f"operator {number}", operator, LinearOperator)
        if len(operators) < 2:
            raise InputError(f"vstack: {len(operators)} operators, wanted two or more")
        first = operators[0]
        for other in operators[1:]:
            if other.domain != first.domain:
                raise ShapeError(
                    f"vstack of operators on {first.domain} and {other.domain}: all must take the "
                    "same shape"
                )
            check_one_kind(first, other)
        super().__init__(first.domain, _range(operators), first.device, first.dtype)
        self.grid = first.grid
        self.operators = operators
        ends = np.cumsum([math.prod(operator.range) for operator in operators])
        self._firsts = [0, *(int(end) for end in ends[:-1])]

    def __repr__(self) -> str:
        return f"vstack({', '.join(map(repr, self.operators))})"

    def __reduce__(self) -> tuple[Any, ...]:
        return Stack, self.operators

    @property
    def scratch(self) -> int:
        """Bytes of a part of the range, of another image, and of what the operators need."""
        each = [self._bytes(operator.range) + operator.scratch for operator in self.operators]
        return self._bytes(self.domain) + max(each)

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        parts = [self._bytes(operator.range) for operator in self.operators]
        inner = [operator.largest_scratch for operator in self.operators]
        return max(self._bytes(self.domain), *parts, *inner)

    def _bytes(self, shape: Shape) -> int:
        return self.dtype.itemsize * math.prod(shape)

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        for operator, first in zip(self.operators, self._firsts, strict=True):
            part = self.device.empty(operator.range, self.dtype)
            operator._fill(x, part)
            put_run(self.device, part, out, first)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        image = out
        for operator, first in zip(self.operators, self._firsts, strict=True):
            part = self.device.empty(operator.range, self.dtype)
            take_run(self.device, y, first, part)
            operator._fill_adjoint(part, image)
            if first:
                axpby(self.device, 1.0, image, 1.0, out)
            else:
                image = self.device.empty(self.domain, self.dtype)

    def _apply_steps(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        for operator, part in self._parts(y):
            operator._apply_host(x, part)

    def _apply_adjoint_steps(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        image = x
        for operator, part in self._parts(y):
            operator._apply_adjoint_host(part, image)
            if image is x:
                image = np.empty_like(x)
            else:
                axpby(self.device, 1.0, image, 1.0, x)

    def _parts(self, y: NDArray[Any]) -> list[tuple[LinearOperator, NDArray[Any]]]:
        """Every operator with its part of the results, a view in C order."""
        flat = y.reshape(-1)
        return [
            (operator, flat[first : first + math.prod(operator.range)].reshape(operator.range))
            for operator, first in zip(self.operators, self._firsts, strict=True)
        ]


def _range(operators: tuple[LinearOperator, ...]) -> Shape:
    ranges = [operator.range for operator in operators]
    if len({shape[1:] for shape in ranges}) == 1:
        return (sum(shape[0] for shape in ranges), *ranges[0][1:])
    return (sum(map(math.prod, ranges)),)
