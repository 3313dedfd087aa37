"""An operator that NumPy, or another package, computes on the host.

Solvers, sums and products take it like any other; device arrays come to the host and go back.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from operator import index
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.cl.elementwise import copy
from rift_cl.cl.host_arrays import as_host_array, download, upload
from rift_cl.errors import InputError, ShapeError
from rift_cl.operators.linear import LinearOperator, Shape

# In what NumPy says to who writes into an array that may only be read.
_READ_ONLY = "read-only"

Function = Callable[[NDArray[Any]], Any]


class HostOperator(LinearOperator):
    """A linear map that two functions of NumPy arrays compute.

    Args:
        forward: takes an array of shape ``domain``, which it may not write into, gives one of
            shape ``range``, or its numbers in C order along one axis.
        adjoint: the other way; ``rift_cl.dot_test`` says whether it is the adjoint.
        domain: shape of the input.
        range: shape of the output.
        dtype: float32 or float64, of both.
        device: whose arrays it takes as well; the default one if not given.

    Raises:
        DTypeError: ``dtype`` is neither of the two.
        ShapeError: ``domain`` or ``range`` is no shape, or a function gave another shape, when it
            was applied.
        InputError: a function wrote into its argument, when it was applied.
    """

    def __init__(
        self,
        forward: Function,
        adjoint: Function,
        domain: Shape,
        range: Shape,
        *,
        dtype: DTypeLike = np.float32,
        device: Device | None = None,
    ) -> None:
        shapes = (_shape("domain", domain), _shape("range", range))
        super().__init__(*shapes, device or default_device(), dtype)
        self._forward, self._backward = forward, adjoint

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (
            self._forward, self._backward, self.domain, self.range, self.dtype, self.device
        )  # fmt: skip

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        self._on_host(self._forward, x, out)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        self._on_host(self._backward, y, out)

    def _apply_host(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        y[...] = self._computed(self._forward, x, self.range)

    def _apply_adjoint_host(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        x[...] = self._computed(self._backward, y, self.domain)

    def _on_host(self, function: Function, given: DeviceArray, out: DeviceArray) -> None:
        found = self._computed(function, download(self.device, given), out.shape)
        copy(self.device, upload(self.device, found), out)

    def _computed(self, function: Function, given: NDArray[Any], shape: Shape) -> NDArray[Any]:
        # What comes is the caller's own array where it has the right type already.
        view = given.view()
        view.flags.writeable = False
        try:
            found = np.asarray(function(view))
        except ValueError as error:
            if _READ_ONLY not in str(error):
                raise
            raise InputError(
                "a function of a HostOperator writes into its argument, which is the array that "
                "the operator was applied to: let it begin with x = x.copy()"
            ) from error
        if found.shape == (math.prod(shape),):
            found = found.reshape(shape)
        return as_host_array(found, shape, name="result", wants="the operator", dtype=self.dtype)


def _shape(name: str, given: Any) -> Shape:
    try:
        shape = tuple(map(index, given))
    except TypeError as error:
        raise ShapeError(
            f"HostOperator: {name} is {given!r}, wanted a shape, such as (8,) or (64, 64)"
        ) from error
    return shape


def _remade(
    forward: Function,
    adjoint: Function,
    domain: Shape,
    range: Shape,
    dtype: DTypeLike,
    device: Device,
) -> HostOperator:
    return HostOperator(forward, adjoint, domain, range, dtype=dtype, device=device)
