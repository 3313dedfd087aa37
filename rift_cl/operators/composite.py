"""Operators made of others, whose steps need not be on the device at the same time."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from numpy.typing import NDArray

from rift_cl.errors import DeviceMemoryError, ResourceLimitError
from rift_cl.operators.linear import LinearOperator


class Composite(LinearOperator):
    """An operator that others are the steps of.

    Host arrays go through all steps on the device where it holds what lies between them. Otherwise
    they go through one step after the other and come back to the host in between, with the same
    bits: each step takes its work in parts where it can.
    """

    @abstractmethod
    def _apply_steps(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        """Write A x to ``y``, both on the host, step by step."""

    @abstractmethod
    def _apply_adjoint_steps(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        """Write A' y to ``x``, both on the host, step by step."""

    def _apply_host(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        try:
            super()._apply_host(x, y)
        except (ResourceLimitError, DeviceMemoryError):
            self._apply_steps(x, y)

    def _apply_adjoint_host(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        try:
            super()._apply_adjoint_host(y, x)
        except (ResourceLimitError, DeviceMemoryError):
            self._apply_adjoint_steps(y, x)
