"""The data term that every solver shares: how far A x is from y, and in which measure.

    |F^(1/2) (A x - y)|^2 / 2,    gradient A' F (A x - y),

F the weight of the residual, or the identity. Rays with weights of their own make A and y
``W^(1/2) A`` and ``W^(1/2) y`` beforehand (see ``weighted_rays``). Everything is on the device;
what comes back to the host are scalars. Arrays that the device does not hold stay on the host
instead, where the method allows it: A takes its parts from there, and so does the arithmetic, to
the same bits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import AnyArray
from rift_cl.cl.budget import host_budget, plan_chunks
from rift_cl.cl.elementwise import copy
from rift_cl.cl.host_arrays import as_device_array, as_host_array, download, is_device_array
from rift_cl.cl.reductions import dot, norm
from rift_cl.errors import InputError, NonFiniteError, ResourceLimitError
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.residual_weight import Precondition, residual_weight
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays, masked_data

# Rounds of the search for the largest eigenvalue, what is added to its answer, which comes from
# below, and the share of it that is rounding.
_ROUNDS, _MARGIN, _ROUNDING = 12, 1.05, 1e-6
_INSTEAD = "cgls and sirt, without weights, take data on the host in parts, and so does fbp"


class DataTerm:
    """A, y and the weight of the residual.

    Args:
        A: the operator.
        y: the data, of shape ``A.range``, on the host or on A's device.
        precondition: see ``residual_weight``.
        noise: standard deviation of the noise of a sample of y, if known.
        arrays: of the shape of x and of the shape of y that the method keeps on the device.
        weights: of the samples of y, their relative inverse variances; None: all alike.
        in_parts: whether the method's arrays may be on the host. Rays with weights are not then,
            nor are data that the caller has on the device.

    Raises:
        InputError: A is no operator, or y, ``precondition``, ``noise`` or ``weights`` cannot be
            used.
        ResourceLimitError: they do not fit the device's budget.
    """

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        precondition: Precondition,
        noise: float | None,
        arrays: tuple[int, int] = (1, 2),
        weights: Any = None,
        *,
        in_parts: bool = False,
    ) -> None:
        if not isinstance(A, LinearOperator):
            raise InputError(
                f"A is a {type(A).__name__}, wanted a LinearOperator such as a Projector"
            )
        if noise is not None and not one_number(noise) >= 0:
            raise InputError(f"noise is {noise!r}, wanted a standard deviation, 0 or more")
        self.A, self.device, self.dtype = A, A.device, A.dtype
        in_parts = in_parts and weights is None and not is_device_array(y)
        self.on_host = self._stays(arrays, in_parts)
        """Whether the arrays are on the host, since the device does not hold them."""
        self.samples = max(math.prod(A.range), 1)
        """Samples of y that count."""
        self.y = self.data()
        if weights is None:
            copy(self.device, self.taken(y, A.range, name="y"), self.y)
        else:
            self._weigh_rays(y, weights)
        self.weight = residual_weight(self.A, self.y, precondition, noise)
        self.unit_gain = self.weight is None or isinstance(precondition, str)
        """Whether F keeps the size of white noise; not known of an operator of the caller's."""

    def _stays(self, arrays: tuple[int, int], in_parts: bool) -> bool:
        """Whether the method's arrays stay on the host.

        Raises:
            ResourceLimitError: the device does not hold them, and the host cannot.
        """
        A = self.A
        images, sinograms = (math.prod(shape) for shape in (A.domain, A.range))
        each = self.dtype.itemsize * (arrays[0] * images + arrays[1] * sinograms)
        try:
            plan_chunks(
                1,
                each,
                A.scratch,
                self.device.budget,
                what="solver",
                array=self.dtype.itemsize * max(images, sinograms),
                largest=self.device.traits.allocation,
                instead=_INSTEAD,
            )
        except ResourceLimitError:
            if not in_parts or each > host_budget():
                raise
            return True
        return False

    def _weigh_rays(self, y: Any, weights: Any) -> None:
        """Make A and y those of the weighted problem."""
        weighted = WeightedRays(self.A, weights)
        if weighted.measured == 0:
            raise InputError("weights are 0 everywhere: at least one sample must count")
        given = y if is_device_array(y) else masked_data(y, weighted.weights)
        copy(self.device, self.taken(given, self.A.range, name="y"), self.y)
        weighted.weigh(self.y)
        self.A, self.samples = weighted, weighted.measured

    def taken(self, x: Any, shape: tuple[int, ...], *, name: str) -> Any:
        """An array that a caller gave, checked, where the method's arrays are.

        Raises:
            InputError: its shape or type is wrong, or it holds NaN or infinity.
        """
        if not is_device_array(x):
            host = as_host_array(x, shape, name=name, wants="the operator", dtype=self.dtype)
            return host if self.on_host else self.device.array(host, self.dtype)
        x = as_device_array(self.device, x, shape, name=name, dtype=self.dtype)
        if not math.isfinite(norm(self.device, x)):
            raise NonFiniteError(
                f"{name} holds NaN or infinity, or values whose squares do not fit {self.dtype}: "
                "replace them, or scale it down"
            )
        return x

    def image(self) -> Any:
        """A new array of the shape of x, its contents not set."""
        return self.empty(self.A.domain)

    def data(self) -> Any:
        """A new array of the shape of y, its contents not set."""
        return self.empty(self.A.range)

    def empty(self, shape: tuple[int, ...]) -> Any:
        """A new array where the method's arrays are, its contents not set."""
        make = np.empty if self.on_host else self.device.empty
        return make(shape, self.dtype)

    def array(self, host: NDArray[Any]) -> AnyArray:
        """A copy of a host array where the method's arrays are."""
        return host.astype(self.dtype) if self.on_host else self.device.array(host, self.dtype)

    def start(self, start: Any) -> Any:
        """The image to begin from, a new array: zero if None was given."""
        if start is None:
            return self.array(np.zeros(self.A.domain, self.dtype))
        if self.on_host and is_device_array(start):
            start = download(self.device, start)
        image = self.image()
        copy(self.device, self.taken(start, self.A.domain, name="start"), image)
        return image

    def residual(self, x: Any, out: Any) -> None:
        """``out`` = A x - y."""
        self.A(x, out=out)
        axpby(self.device, -1.0, self.y, 1.0, out)

    def weigh(self, r: Any, out: Any) -> None:
        """``out`` = F r."""
        if self.weight is None:
            copy(self.device, r, out)
        else:
            self.weight(r, out=out)

    def gradient(self, weighted: Any, out: Any) -> None:
        """``out`` = A' z for a weighted residual z."""
        self.A.T(weighted, out=out)

    def rms(self, r: Any) -> float:
        """The root mean square of a residual over the samples that count, in the unit of y.

        It is comparable to the noise; with weights, to that of a sample of weight 1.

        Raises:
            NonFiniteError: the residual is not finite any more.
        """
        length = norm(self.device, r)
        if not math.isfinite(length):
            raise NonFiniteError(
                f"the residual has left the range of {self.dtype}: scale y to values near 1"
            )
        return length / math.sqrt(self.samples)

    def weighted_rms(self, r: Any, weighted: Any) -> float:
        """The root mean square of F^(1/2) r, for a residual r and F r."""
        return math.sqrt(max(dot(self.device, r, weighted), 0.0) / self.samples)

    def norm_squared(self) -> float:
        """The largest eigenvalue of A' F A, from a little above; 0 if there is none.

        By Lanczos' refinement of the power iteration (J. Res. Natl. Bur. Stand. 45, 1950), which
        finds it in a few rounds even where many are nearly as large, as under a ramp. It begins
        with an image that a seed fixes, so that the answer is the same every time.
        """
        device, random = self.device, np.random.default_rng(0)
        image = self.array(1 + random.random(self.A.domain))
        before, product = self.array(np.zeros(self.A.domain)), self.image()
        seen, weighted = self.data(), self.data()
        diagonal: list[float] = []
        beside = [norm(device, image)]
        axpby(device, 0.0, image, 1 / beside[0], image)
        for _ in range(min(_ROUNDS, image.size)):
            self.A(image, out=seen)
            self.weigh(seen, weighted)
            diagonal.append(dot(device, seen, weighted))
            self.gradient(weighted, product)
            axpby(device, -diagonal[-1], image, 1.0, product)
            if len(diagonal) > 1:
                axpby(device, -beside[-1], before, 1.0, product)
            beside.append(norm(device, product))
            if not beside[-1] > _ROUNDING * max(diagonal):
                break
            axpby(device, 0.0, product, 1 / beside[-1], product)
            image, before, product = product, image, before
        matrix = np.diag(diagonal) + np.diag(beside[1:-1], 1) + np.diag(beside[1:-1], -1)
        return _MARGIN * max(float(np.linalg.eigvalsh(matrix)[-1]), 0.0)
