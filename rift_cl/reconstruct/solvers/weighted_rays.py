"""A projector whose rays count by their weights: ``W^(1/2) A``.

Weighted least squares, ``sum of w (A x - y)^2``, are plain least squares on ``W^(1/2) A`` and
``W^(1/2) y``. Every solver thus takes weights without a line of its own: with w the inverse of a
ray's variance the noise of the weighted data is white, so that the residual, the noise it is
compared with and the spectrum a ramp looks at mean what they mean without weights.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.elementwise import copy, multiply
from rift_cl.cl.host_arrays import as_real_array, download, is_device_array
from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.operators.linear import LinearOperator

# Single precision's rounding of weights whose mean is one.
_ROUNDING = 1e-6


class WeightedRays(LinearOperator):
    """An operator whose samples are multiplied by the roots of their weights.

    Args:
        A: the operator.
        weights: of the samples, of shape ``A.range``, 0 or more; 0 where nothing was measured.

    Raises:
        ShapeError: there is not one weight for each sample.
        InputError: a weight is negative, NaN or infinite.
    """

    def __init__(self, A: LinearOperator, weights: Any) -> None:
        super().__init__(A.domain, A.range, A.device, A.dtype)
        self.grid, self.scan = A.grid, A.scan
        found = checked_weights(weights, A)
        self.inner, self.weights = A, found
        self.measured = int(np.count_nonzero(found))
        """Samples that count at all."""
        self._host_roots = np.sqrt(found).astype(A.dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.inner, self.weights)

    def _facts(self) -> list[str]:
        return [f"{self.measured} of {self.weights.size} samples of {self.inner!r}"]

    def weigh(self, y: Any) -> None:
        """Multiply data, on the device or on the host, by the roots of the weights, in place."""
        multiply(self.device, self._roots if is_device_array(y) else self._host_roots, y)

    @cached_property
    def _roots(self) -> DeviceArray:
        return self.device.array(self._host_roots, self.dtype)

    @property
    def scratch(self) -> int:
        """Scratch bytes: the operator's, square roots of the weights, and weighted data."""
        return self.inner.scratch + 2 * int(self._host_roots.nbytes)

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        return max(self.inner.largest_scratch, int(self._host_roots.nbytes))

    def _apply(self, x: Any, out: Any) -> None:
        self.inner._apply(x, out)
        self.weigh(out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        weighed = self.device.empty(y.shape, self.dtype)
        copy(self.device, y, weighed)
        self.weigh(weighed)
        self.inner._apply_adjoint(weighed, out)

    def _apply_host(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        self.inner._apply_host(x, y)
        self.weigh(y)

    def _apply_adjoint_host(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        weighed = y.copy()
        self.weigh(weighed)
        self.inner._apply_adjoint_host(weighed, x)


def checked_weights(weights: Any, A: LinearOperator) -> NDArray[np.float64]:
    """Weights of the samples of A, on the host.

    Raises:
        ShapeError: there is not one weight for each sample.
        InputError: a weight is negative, NaN or infinite.
    """
    host = download(A.device, weights) if is_device_array(weights) else weights
    found = as_real_array(host, name="weights").astype(np.float64)
    if found.shape != A.range:
        raise ShapeError(f"weights have shape {found.shape}, wanted the data's {A.range}")
    # A weight too small for the operator's type is none; one too large has no finite root's square.
    with np.errstate(over="ignore", under="ignore"):
        found = found.astype(A.dtype).astype(np.float64)
    if not np.isfinite(found).all():
        raise NonFiniteError(
            f"weights hold NaN or infinity, or numbers beyond {A.dtype}: give unmeasured samples 0"
        )
    if found.min(initial=0.0) < 0:
        raise InputError(f"weights hold {found.min():g}, wanted numbers of 0 or more")
    return found


def mean_weight(weights: NDArray[Any]) -> float:
    """The mean weight of the samples that count, 1 where it is that but for rounding.

    A prior times this number holds its own against data whose weights are of any size.
    """
    counted = weights[weights > 0]
    mean = float(np.mean(counted, dtype=np.float64)) if counted.size else 1.0
    return 1.0 if math.isclose(mean, 1, rel_tol=_ROUNDING) else mean


def masked_data(y: Any, weights: NDArray[np.float64]) -> Any:
    """Data on the host with 0 where the weight is 0: what lies there was never measured."""
    array = as_real_array(y, name="y")
    if array.shape != weights.shape:
        return y
    return np.where(weights > 0, array, array.dtype.type(0))
