"""Linear operators and their algebra: ``A(x)``, ``A.T(y)``, ``A @ B``, ``A + B``, ``2 * A``.

An operator maps arrays of shape ``domain`` to arrays of shape ``range``. NumPy in gives NumPy
out; a device array in gives a device array out, without a copy. The adjoint is an operator like
any other, ``A.T.T is A``, and solvers need to know nothing else.

Host arrays that are too large for the device are taken in pieces where the operator says how
(``_pieces``); the result is the same to the bit.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.memory import (
    as_device_array,
    as_host_array,
    check_output,
    download,
    is_device_array,
    share,
)
from rift_cl.errors import DeviceMemoryError, ResourceLimitError, ShapeError

Shape = tuple[int, ...]
# An index into an operator's domain and the index into its range that depends on it alone.
Piece = tuple[tuple[slice, ...], tuple[slice, ...]]
_HALVINGS = 6


class LinearOperator(ABC):
    """A linear map between arrays on one device.

    Args:
        domain: shape of what it takes.
        range: shape of what it gives.
        device: where it works.
    """

    def __init__(self, domain: Shape, range: Shape, device: Device) -> None:
        self.domain = domain
        self.range = range
        self.device = device

    @cached_property
    def T(self) -> LinearOperator:
        """The adjoint; made once, so that ``A.T is A.T`` and ``A.T.T is A``."""
        return Adjoint(self)

    def __call__(self, x: Any, out: Any = None) -> Any:
        """Apply the operator.

        Args:
            x: array of shape ``domain``; a device array, or anything NumPy takes for an array of
                real numbers.
            out: where to put the result, of the same kind as ``x``; a new array if not given.

        Returns:
            Array of shape ``range``, float32, on the side where ``x`` is.

        Raises:
            InputError: ``x`` or ``out`` has the wrong shape or type, or holds NaN or infinity.
            DeviceMemoryError: not even the smallest piece fits the device.
        """
        if is_device_array(x):
            x = as_device_array(self.device, x, self.domain, name="x")
            y = self.device.empty(self.range) if out is None else out
            self._apply(x, as_device_array(self.device, y, self.range, name="out"))
            return y
        host = as_host_array(x, self.domain, name="x", wants=type(self).__name__)
        y = np.empty(self.range, np.float32) if out is None else check_output(out, self.range)
        self._apply_host(host, y)
        return y

    def __matmul__(self, other: Any) -> Any:
        """``A @ B`` is the operator that applies B, then A; ``A @ x`` is ``A(x)``."""
        return Product(self, other) if isinstance(other, LinearOperator) else self(other)

    def __add__(self, other: LinearOperator) -> LinearOperator:
        """The operator x -> A x + B x."""
        return Sum(self, other)

    def __sub__(self, other: LinearOperator) -> LinearOperator:
        """The operator x -> A x - B x."""
        return Sum(self, -other)

    def __mul__(self, factor: float) -> LinearOperator:
        """The operator x -> factor * A x."""
        return Scaled(self, float(factor))

    __rmul__ = __mul__

    def __neg__(self) -> LinearOperator:
        """The operator x -> -A x."""
        return Scaled(self, -1.0)

    def _apply_host(self, x: NDArray[np.float32], y: NDArray[np.float32]) -> None:
        budget = self.device.budget
        pieces = self._pieces(budget)
        for halving in range(1, _HALVINGS + 2):
            try:
                for inside, outside in pieces:
                    self._apply_piece(x, y, inside, outside)
                return
            except DeviceMemoryError as failure:
                # The driver had less than it said: take smaller pieces while there are smaller.
                self.device.release()
                try:
                    pieces = self._pieces(budget >> halving)
                except ResourceLimitError:
                    raise failure from None
                if halving > _HALVINGS:
                    raise

    def _apply_piece(
        self,
        x: NDArray[np.float32],
        y: NDArray[np.float32],
        inside: tuple[slice, ...],
        outside: tuple[slice, ...],
    ) -> None:
        piece = np.ascontiguousarray(x[inside])
        part = y[outside]
        target = self.device.empty(part.shape)
        self._apply(share(self.device, piece), target)
        if part.flags.c_contiguous:
            download(self.device, target, part)
        else:
            part[...] = download(self.device, target)

    def _pieces(self, budget: int) -> Iterable[Piece]:
        """How to cut the work to fit a budget in bytes: in one, unless the operator knows how."""
        return [((), ())]

    @abstractmethod
    def _apply(self, x: Any, out: Any) -> None:
        """Fill ``out`` with the image of ``x``; device arrays, of a piece's shapes."""

    @abstractmethod
    def _apply_adjoint(self, y: Any, out: Any) -> None:
        """Fill ``out`` with the adjoint's image of ``y``; device arrays, of a piece's shapes."""


class Adjoint(LinearOperator):
    """The adjoint of an operator."""

    def __init__(self, forward: LinearOperator) -> None:
        super().__init__(forward.range, forward.domain, forward.device)
        self._forward = forward

    @property
    def T(self) -> LinearOperator:
        """The operator that this is the adjoint of."""
        return self._forward

    def _apply(self, x: Any, out: Any) -> None:
        self._forward._apply_adjoint(x, out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        self._forward._apply(y, out)

    def _pieces(self, budget: int) -> Iterable[Piece]:
        return [(inside, outside) for outside, inside in self._forward._pieces(budget)]


class Scaled(LinearOperator):
    """A multiple of an operator."""

    def __init__(self, inner: LinearOperator, factor: float) -> None:
        super().__init__(inner.domain, inner.range, inner.device)
        self._inner = inner
        self._factor = np.float32(factor)

    def _apply(self, x: Any, out: Any) -> None:
        self._inner._apply(x, out)
        out *= self._factor

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        self._inner._apply_adjoint(y, out)
        out *= self._factor

    def _pieces(self, budget: int) -> Iterable[Piece]:
        return self._inner._pieces(budget)


class Sum(LinearOperator):
    """The sum of two operators between the same spaces."""

    def __init__(self, left: LinearOperator, right: LinearOperator) -> None:
        if (left.domain, left.range) != (right.domain, right.range):
            raise ShapeError(
                f"sum of operators {left.domain} -> {left.range} and {right.domain} -> "
                f"{right.range}: both must map between the same shapes"
            )
        super().__init__(left.domain, left.range, left.device)
        self._terms = (left, right)

    def _apply(self, x: Any, out: Any) -> None:
        left, right = self._terms
        left._apply(x, out)
        other = self.device.empty(out.shape)
        right._apply(x, other)
        out += other

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        left, right = self._terms
        left._apply_adjoint(y, out)
        other = self.device.empty(out.shape)
        right._apply_adjoint(y, other)
        out += other


class Product(LinearOperator):
    """One operator after another."""

    def __init__(self, outer: LinearOperator, inner: LinearOperator) -> None:
        if outer.domain != inner.range:
            raise ShapeError(
                f"product of operators: the inner one gives {inner.range}, the outer one takes "
                f"{outer.domain}"
            )
        super().__init__(inner.domain, outer.range, outer.device)
        self._outer, self._inner = outer, inner

    def _apply(self, x: Any, out: Any) -> None:
        between = self.device.empty(self._inner.range)
        self._inner._apply(x, between)
        self._outer._apply(between, out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        between = self.device.empty(self._inner.range)
        self._outer._apply_adjoint(y, between)
        self._inner._apply_adjoint(between, out)


def dot_test(A: LinearOperator, seed: int = 0) -> float:
    """How far an operator and its adjoint are from being a matched pair.

    Args:
        A: the operator.
        seed: of the random arrays.

    Returns:
        The largest of ``|<Ax, y> - <x, A'y>| / (|Ax| |y|)`` over three pairs: white x with
        y = Ax, white with white, positive with positive. Inner products are taken in float64.
    """
    random = np.random.default_rng(seed)

    def white(shape: Shape) -> NDArray[np.float32]:
        return random.standard_normal(shape).astype(np.float32)

    x = white(A.domain)
    pairs = [(x, A(x)), (white(A.domain), white(A.range))]
    pairs.append((np.abs(white(A.domain)), np.abs(white(A.range))))
    return max(_mismatch(A, x, y) for x, y in pairs)


def _mismatch(A: LinearOperator, x: NDArray[Any], y: NDArray[Any]) -> float:
    image, back = A(x).ravel().astype(np.float64), A.T(y).ravel().astype(np.float64)
    x, y = x.ravel().astype(np.float64), y.ravel().astype(np.float64)
    scale = float(np.linalg.norm(image) * np.linalg.norm(y))
    difference = abs(float(image @ y) - float(x @ back))
    return difference / scale if scale > 0 else difference
