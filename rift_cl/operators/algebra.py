"""Operators made of operators: adjoints, multiples, sums, products."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import DeviceArray
from rift_cl.errors import DeviceError, DTypeError, InputError, ShapeError
from rift_cl.operators.composite import Composite
from rift_cl.operators.linear import Chunk, LinearOperator


class Adjoint(LinearOperator):
    """The adjoint of an operator."""

    def __init__(self, forward: LinearOperator) -> None:
        super().__init__(forward.range, forward.domain, forward.device, forward.dtype)
        self._forward = forward

    def __repr__(self) -> str:
        return f"{self._forward!r}.T"

    def __reduce__(self) -> tuple[Any, ...]:
        return getattr, (self._forward, "T")

    @property
    def T(self) -> LinearOperator:
        """The operator that this is the adjoint of."""
        return self._forward

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        self._forward._fill_adjoint(x, out)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        self._forward._fill(y, out)

    def _apply_host(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        self._forward._apply_adjoint_host(x, y)

    def _apply_adjoint_host(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        self._forward._apply_host(y, x)

    @property
    def scratch(self) -> int:
        """Bytes of device memory that the operator needs."""
        return self._forward.scratch

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        return self._forward.largest_scratch

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        return self._forward._adjoint_chunks(budget)

    def _adjoint_chunks(self, budget: int) -> Iterable[Chunk]:
        return self._forward._chunks(budget)


class Scaled(Composite):
    """A multiple of an operator."""

    def __init__(self, inner: LinearOperator, factor: float) -> None:
        super().__init__(inner.domain, inner.range, inner.device, inner.dtype)
        self.grid, self.scan = inner.grid, inner.scan
        self._inner = inner
        self._factor = _finite(factor, self.dtype)

    def __repr__(self) -> str:
        return f"({self._factor:g} * {self._inner!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._inner, self._factor)

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        self._inner._fill(x, out)
        axpby(self.device, 0.0, out, self._factor, out)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        self._inner._fill_adjoint(y, out)
        axpby(self.device, 0.0, out, self._factor, out)

    def _apply_steps(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        self._inner._apply_host(x, y)
        axpby(self.device, 0.0, y, self._factor, y)

    def _apply_adjoint_steps(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        self._inner._apply_adjoint_host(y, x)
        axpby(self.device, 0.0, x, self._factor, x)

    @property
    def scratch(self) -> int:
        """Bytes of device memory that the operator needs."""
        return self._inner.scratch

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        return self._inner.largest_scratch

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        return map(self._scaled, self._inner._chunks(budget))

    def _adjoint_chunks(self, budget: int) -> Iterable[Chunk]:
        return map(self._scaled, self._inner._adjoint_chunks(budget))

    def _scaled(self, chunk: Chunk) -> Chunk:
        part = chunk.operator
        return chunk if part is None else chunk._replace(operator=part * self._factor)


class Sum(Composite):
    """The sum of two operators between the same spaces."""

    def __init__(self, left: LinearOperator, right: LinearOperator) -> None:
        if (left.domain, left.range) != (right.domain, right.range):
            raise ShapeError(
                f"sum of operators {left.domain} -> {left.range} and {right.domain} -> "
                f"{right.range}: both must map between the same shapes"
            )
        check_one_kind(left, right)
        super().__init__(left.domain, left.range, left.device, left.dtype)
        self.grid = left.grid if left.grid == right.grid else None
        self.scan = left.scan if left.scan == right.scan else None
        self._terms = (left, right)

    def __repr__(self) -> str:
        left, right = self._terms
        return f"({left!r} + {right!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return Sum, self._terms

    @property
    def scratch(self) -> int:
        """Bytes of the second term's result, and of what the terms need."""
        other = self.dtype.itemsize * max(math.prod(self.domain), math.prod(self.range))
        return other + max(term.scratch for term in self._terms)

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        other = self.dtype.itemsize * max(math.prod(self.domain), math.prod(self.range))
        return max(other, *(term.largest_scratch for term in self._terms))

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        left, right = self._terms
        left._fill(x, out)
        other = self.device.empty(out.shape, self.dtype)
        right._fill(x, other)
        axpby(self.device, 1.0, other, 1.0, out)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        left, right = self._terms
        left._fill_adjoint(y, out)
        other = self.device.empty(out.shape, self.dtype)
        right._fill_adjoint(y, other)
        axpby(self.device, 1.0, other, 1.0, out)

    def _apply_steps(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        left, right = self._terms
        left._apply_host(x, y)
        other = np.empty(self.range, self.dtype)
        right._apply_host(x, other)
        axpby(self.device, 1.0, other, 1.0, y)

    def _apply_adjoint_steps(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        left, right = self._terms
        left._apply_adjoint_host(y, x)
        other = np.empty(self.domain, self.dtype)
        right._apply_adjoint_host(y, other)
        axpby(self.device, 1.0, other, 1.0, x)


class Product(Composite):
    """One operator after another."""

    def __init__(self, outer: LinearOperator, inner: LinearOperator) -> None:
        if outer.domain != inner.range:
            raise ShapeError(
                f"product of operators: the inner one gives {inner.range}, the outer one takes "
                f"{outer.domain}"
            )
        check_one_kind(outer, inner)
        super().__init__(inner.domain, outer.range, outer.device, outer.dtype)
        self.grid, self.scan = inner.grid, outer.scan
        self._outer, self._inner = outer, inner

    def __repr__(self) -> str:
        return f"({self._outer!r} @ {self._inner!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return Product, (self._outer, self._inner)

    @property
    def scratch(self) -> int:
        """Bytes of the inner operator's result, and of what the two operators need."""
        between = self.dtype.itemsize * math.prod(self._inner.range)
        return between + max(self._outer.scratch, self._inner.scratch)

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        between = self.dtype.itemsize * math.prod(self._inner.range)
        return max(between, self._outer.largest_scratch, self._inner.largest_scratch)

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        between = self.device.empty(self._inner.range, self.dtype)
        self._inner._fill(x, between)
        self._outer._fill(between, out)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        between = self.device.empty(self._inner.range, self.dtype)
        self._outer._fill_adjoint(y, between)
        self._inner._fill_adjoint(between, out)

    def _apply_steps(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        between = np.empty(self._inner.range, self.dtype)
        self._inner._apply_host(x, between)
        self._outer._apply_host(between, y)

    def _apply_adjoint_steps(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        between = np.empty(self._inner.range, self.dtype)
        self._outer._apply_adjoint_host(y, between)
        self._inner._apply_adjoint_host(between, x)


def _finite(factor: float, dtype: np.dtype[Any]) -> float:
    with np.errstate(over="ignore"):
        rounded = float(dtype.type(factor))
    if not math.isfinite(rounded):
        raise InputError(f"an operator cannot be multiplied by {factor}: it must fit a {dtype}")
    return rounded


def check_one_kind(first: LinearOperator, second: LinearOperator) -> None:
    """Check that two operators have one type and one device.

    Raises:
        DTypeError: one works in float32, the other in float64.
        DeviceError: they are on two devices.
    """
    if first.dtype != second.dtype:
        raise DTypeError(
            f"operators in {first.dtype} and {second.dtype} cannot be combined: make both with "
            "the same dtype"
        )
    if first.device is not second.device:
        raise DeviceError(
            f"operators on two devices, {first.device.name} and {second.device.name}, cannot be "
            "combined: make both on one Device"
        )
