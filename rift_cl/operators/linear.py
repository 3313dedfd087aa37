"""Linear operators and their algebra: ``A(x)``, ``A.T(y)``, ``A @ B``, ``A + B``, ``2 * A``.

An operator maps arrays of shape ``domain`` to arrays of shape ``range``, both of type ``dtype``.
NumPy in gives NumPy out; a device array in gives a device array out, without a copy; a torch
tensor or a JAX array, or a batch of them, gives another one, which passes gradients on. The adjoint
is an operator like any other, ``A.T.T is A``, and solvers need nothing else.

Operators do not change once they are made. They are pickled and copied as the arguments that make
them again, the device as its selector, so that no device memory travels and the copy gives the
same bits.

Host arrays that are too large for the device are processed in chunks, which an operator defines by
``_chunks``; the result is the same to the bit, unless a single sum has to be cut.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import cached_property, partial
from importlib import import_module
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import format_bytes, plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.elementwise import put_inside, with_own_buffer
from rift_cl.cl.host_arrays import (
    as_device_array,
    as_host_array,
    check_apart,
    check_output,
    download,
    finish_for_others,
    is_device_array,
    is_jax_array,
    is_tensor,
    share,
)
from rift_cl.cl.real_type import real_type
from rift_cl.errors import DeviceMemoryError, InputError, ResourceLimitError, check_type
from rift_cl.geometry import Grid, Scan

Shape = tuple[int, ...]
_HALVINGS = 6
# What applies an operator to arrays of torch and of JAX; loaded when the first one comes, by its
# name, since an operator knows nothing of either.
_BRIDGES = {"torch tensor": "rift_cl.interop.linear_torch", "JAX array": "rift_cl.interop.jax"}


class Chunk(NamedTuple):
    """A part of an operator's work.

    Args:
        inside: index into its domain.
        outside: index into its range. Chunks with the same one follow each other, and their results
            are added.
        operator: what maps the one part to the other; None for the whole operator, which does so
            where the two depend on each other alone.
    """

    inside: tuple[slice, ...]
    outside: tuple[slice, ...]
    operator: LinearOperator | None = None

    @property
    def transposed(self) -> Chunk:
        """The same part of the adjoint's work."""
        from rift_cl.operators.algebra import Adjoint

        # Not its ``T``, which would keep a part and its arrays in a circle of references.
        operator = None if self.operator is None else Adjoint(self.operator)
        return Chunk(self.outside, self.inside, operator)


class LinearOperator(ABC):
    """A linear map between arrays on one device.

    ``grid`` describes its domain and ``scan`` its range; either is None where it is not known.

    Args:
        domain: shape of the input.
        range: shape of the output.
        device: the device that it runs on.
        dtype: type of input and output, float32 or float64.

    Raises:
        DeviceError: ``dtype`` is float64 and the device has none.
    """

    grid: Grid | None = None
    scan: Scan | None = None
    # NumPy's arrays leave ``array * A`` and ``array @ A`` to the operator, which refuses them,
    # instead of making an array of operators.
    __array_ufunc__ = None

    def __init__(
        self, domain: Shape, range: Shape, device: Device, dtype: DTypeLike = np.float32
    ) -> None:
        check_type(type(self).__name__, "device", device, Device)
        self.domain = domain
        self.range = range
        self.device = device
        self.dtype = real_type(device, dtype)

    def __repr__(self) -> str:
        facts = [*self._facts(), str(self.dtype), f"device {self.device.selector}"]
        return f"<{type(self).__name__} {self.domain} -> {self.range}: {', '.join(facts)}>"

    def _facts(self) -> list[str]:
        """What its repr says of it besides shapes, type and device."""
        return []

    def __array__(self, *args: Any, **kwargs: Any) -> NDArray[Any]:
        """Refuse to be an array, of which ``np.dot(A, x)`` would make an array of operators.

        Raises:
            InputError: always; A is applied as ``A @ x``.
        """
        raise InputError(
            f"{type(self).__name__} is an operator and no array of numbers: write A @ x or A(x), "
            "not np.dot(A, x)"
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of its matrix: number of samples in its range, and in its domain."""
        return math.prod(self.range), math.prod(self.domain)

    @cached_property
    def T(self) -> LinearOperator:
        """The adjoint; made once, so that ``A.T is A.T`` and ``A.T.T is A``."""
        from rift_cl.operators.algebra import Adjoint

        return Adjoint(self)

    @property
    def H(self) -> LinearOperator:
        """The conjugate transpose, which is ``T``, since operators are real."""
        return self.T

    @overload
    def __call__(
        self, x: NDArray[Any], out: NDArray[Any] | None = None, *, name: str = "x"
    ) -> NDArray[Any]: ...

    @overload
    def __call__(
        self, x: DeviceArray, out: DeviceArray | None = None, *, name: str = "x"
    ) -> DeviceArray: ...

    @overload
    def __call__(self, x: Any, out: Any = None, *, name: str = "x") -> Any: ...

    def __call__(self, x: Any, out: Any = None, *, name: str = "x") -> Any:
        """Apply the operator.

        Args:
            x: array of shape ``domain``; a device array, or anything NumPy takes for an array of
                real numbers; or a torch tensor or JAX array of shape (..., *domain) and type
                ``dtype``.
            out: where to put the result, of the same kind as ``x`` and with memory of its own; a
                new array if not given. Not for torch and JAX. Device arrays that begin inside
                another's buffer, such as ``stack[1]``, cost a copy on the device, as ``x`` too.
                With a device array of another queue than ``device.queue``, as ``x`` or ``out``,
                the call waits for that queue before, and for its own work after.
            name: the caller's name for ``x``, for error messages.

        Returns:
            Array of shape ``range`` and type ``dtype``, of the same kind as ``x``.

        Raises:
            InputError: ``x`` or ``out`` has the wrong shape or type, or an ``x`` on the host
                holds NaN or infinity; device arrays are not searched for these.
            DeviceMemoryError: not even the smallest chunk fits the device.
        """
        kind = "torch tensor" if is_tensor(x) else "JAX array" if is_jax_array(x) else None
        if kind is not None:
            if out is not None:
                raise InputError(f"out is given and {name} is a {kind}: use what is returned")
            return import_module(_BRIDGES[kind]).apply(self, x, name=name)
        if is_device_array(x):
            allowed = partial(as_device_array, self.device, dtype=self.dtype, inside=True)
            x = allowed(x, self.domain, name=name)
            if out is not None:
                out = allowed(out, self.range, name="out")
                check_apart(x, out, name=name)
            y = self.device.empty(self.range, self.dtype) if out is None or out.offset else out
            self._fill(with_own_buffer(self.device, x), y)
            if out is not None and y is not out:
                put_inside(self.device, y, out)
            finish_for_others(self.device, x, out)
            return y if out is None else out
        host = as_host_array(x, self.domain, name=name, wants="the operator", dtype=self.dtype)
        y = _empty(self.range, self.dtype) if out is None else out
        y = check_output(y, self.range, self.dtype)
        check_apart(host, y, name=name)
        self._apply_host(host, y)
        return y

    @overload
    def __matmul__(self, other: LinearOperator) -> LinearOperator: ...

    @overload
    def __matmul__(self, other: NDArray[Any]) -> NDArray[Any]: ...

    @overload
    def __matmul__(self, other: DeviceArray) -> DeviceArray: ...

    @overload
    def __matmul__(self, other: Any) -> Any: ...

    def __matmul__(self, other: Any) -> Any:
        """``A @ B`` is the operator that applies B, then A; ``A @ x`` is ``A(x)``."""
        from rift_cl.operators.algebra import Product

        return Product(self, other) if isinstance(other, LinearOperator) else self(other)

    def __rmatmul__(self, x: Any) -> LinearOperator:
        """Refuse ``x @ A``, in which x would be a row.

        Raises:
            InputError: always; the adjoint is ``A.T(x)``.
        """
        raise InputError(
            f"x @ A, with x a {type(x).__name__} before the operator, is not defined: write A.T(x) "
            "for its adjoint, or A(x)"
        )

    def __add__(self, other: LinearOperator) -> LinearOperator:
        """The operator x -> A x + B x."""
        from rift_cl.operators.algebra import Sum

        return Sum(self, other) if isinstance(other, LinearOperator) else NotImplemented

    def __radd__(self, other: object) -> LinearOperator:
        """The operator itself for 0 + A, with which ``sum([A, B])`` begins."""
        return self if isinstance(other, int) and other == 0 else NotImplemented

    def __sub__(self, other: LinearOperator) -> LinearOperator:
        """The operator x -> A x - B x."""
        return self + (-other) if isinstance(other, LinearOperator) else NotImplemented

    def __mul__(self, factor: Any) -> LinearOperator:
        """The operator x -> factor * A x.

        Raises:
            InputError: the factor is no finite real number: an array, to which the operator was
                probably meant to be applied, another operator, a complex number, or a number of
                torch or JAX, whose gradient an operator does not pass on.
        """
        from rift_cl.operators.algebra import Scaled

        factor = _number_of(factor)
        if isinstance(factor, (int, float, np.integer, np.floating)):
            return Scaled(self, float(factor))
        if isinstance(factor, LinearOperator):
            raise InputError(
                "A * B of two operators is not defined: write A @ B to apply B, then A"
            )
        if (is_tensor(factor) or is_jax_array(factor)) and not factor.shape:
            raise InputError(
                f"an operator can be multiplied by a number of Python only, and was given a "
                f"{type(factor).__name__}: write float(factor) * A where no gradient is to pass "
                "to the factor, or factor * A(x), through which one passes"
            )
        if hasattr(factor, "shape") or isinstance(factor, (list, tuple)):
            raise InputError(
                "an operator can be multiplied by a number only, and was given an array: to apply "
                "the operator A to an array x write A(x) or A @ x"
            )
        if isinstance(factor, complex):
            raise InputError(f"an operator is real and cannot be multiplied by {factor}")
        return NotImplemented

    __rmul__ = __mul__

    def __truediv__(self, divisor: Any) -> LinearOperator:
        """The operator x -> A x / divisor.

        Raises:
            InputError: the divisor is 0, or no finite real number.
        """
        divisor = _number_of(divisor)
        if isinstance(divisor, (int, float, np.integer, np.floating)) and divisor == 0:
            raise InputError("an operator cannot be divided by 0")
        if isinstance(divisor, (int, float, np.integer, np.floating)):
            return self * (1 / float(divisor))
        return NotImplemented

    def __neg__(self) -> LinearOperator:
        """The operator x -> -A x."""
        return self * -1.0

    def _apply_host(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        """Write A x to ``y``, both on the host, in chunks of the operator's work."""
        budget = self.device.budget
        lack: DeviceMemoryError | None = None
        for halving in range(_HALVINGS + 1):
            try:
                before = None
                for chunk in self._chunks(budget >> halving):
                    self._apply_chunk(x, y, chunk, add=chunk.outside == before)
                    before = chunk.outside
                return
            except DeviceMemoryError as failure:
                # The driver had less memory than it reported: retry with smaller chunks.
                if halving == _HALVINGS:
                    raise
                lack = failure
                # Kernels that still run may read the host's memory: wait for them first.
                self.device.finish()
                self.device.release()
            except ResourceLimitError:
                if lack is not None:
                    raise lack from None
                raise

    def _apply_adjoint_host(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        """Write A' y to ``x``, both on the host, in chunks of the adjoint's work."""
        LinearOperator._apply_host(self.T, y, x)

    def _apply_chunk(self, x: NDArray[Any], y: NDArray[Any], chunk: Chunk, *, add: bool) -> None:
        operator = chunk.operator or self
        given = np.ascontiguousarray(x[chunk.inside])
        part = y[chunk.outside]
        target = self.device.empty(part.shape, self.dtype)
        operator._fill(share(self.device, given), target)
        if add:
            part += download(self.device, target)
        elif part.flags.c_contiguous:
            download(self.device, target, part)
        else:
            part[...] = download(self.device, target)

    @property
    def scratch(self) -> int:
        """Bytes of device memory needed besides the input and the output."""
        return 0

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        return 0

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        """Chunks that fit a budget in bytes; one for the whole unless a subclass overrides it."""
        sizes = [self.dtype.itemsize * math.prod(shape) for shape in (self.domain, self.range)]
        plan_chunks(
            1,
            sum(sizes),
            self.scratch,
            budget,
            what=f"{type(self).__name__} application",
            array=max(*sizes, self.largest_scratch),
            largest=self.device.traits.allocation,
        )
        return [Chunk((), ())]

    def _adjoint_chunks(self, budget: int) -> Iterable[Chunk]:
        """Chunks of the adjoint's work."""
        return [chunk.transposed for chunk in self._chunks(budget)]

    def _fill(self, x: DeviceArray, out: DeviceArray) -> None:
        """``_apply``, which must write into ``out``."""
        # As an own operator may be written that is used to SciPy or PyLops.
        found: object = self._apply(x, out)
        self._check_nothing(found, "_apply")

    def _fill_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        """``_apply_adjoint``, which must write into ``out``."""
        found: object = self._apply_adjoint(y, out)
        self._check_nothing(found, "_apply_adjoint")

    def _check_nothing(self, returned: object, method: str) -> None:
        if returned is not None:
            raise InputError(
                f"{type(self).__name__}.{method} returned a {type(returned).__name__}, which "
                "nobody reads: let it write the result into its second argument, or make the "
                "operator of two functions of NumPy arrays (rift_cl.HostOperator)"
            )

    @abstractmethod
    def _apply(self, x: DeviceArray, out: DeviceArray, /) -> None:
        """Write A x to ``out``; device arrays with the shapes of a chunk."""

    @abstractmethod
    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray, /) -> None:
        """Write A' y to ``out``; device arrays with the shapes of a chunk."""


def _number_of(value: Any) -> Any:
    """The number that a NumPy array without axes holds; anything else as it is."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def _empty(shape: Shape, dtype: np.dtype[Any]) -> NDArray[Any]:
    """An array for a result.

    Raises:
        ResourceLimitError: the host has no memory for it.
    """
    try:
        return np.empty(shape, dtype)
    except MemoryError as error:
        raise ResourceLimitError(
            f"the result of shape {shape} takes {format_bytes(math.prod(shape) * dtype.itemsize)}, "
            "which the host has not: make the problem smaller, or give a file in memory "
            "(np.memmap) as out"
        ) from error
