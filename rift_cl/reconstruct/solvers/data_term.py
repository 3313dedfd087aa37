"""The data term that every solver shares: how far A x is from y, and in which measure.

    |F^(1/2) (A x - y)|^2 / 2,    gradient A' F (A x - y),

F the weight of the residual, or the identity. Rays with weights of their own make A and y
``W^(1/2) A`` and ``W^(1/2) y`` beforehand (see ``weighted_rays``). Everything is on the device, and
what comes back to the host are scalars; where it does not fit it is kept beside the device, and A
and all arithmetic are applied in parts (``array_home``).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array_home import ArrayHome
from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.elementwise import copy
from rift_cl.cl.host_arrays import as_device_array, as_host_array, download, is_device_array
from rift_cl.cl.reductions import dot, norm
from rift_cl.errors import InputError, NonFiniteError, ResourceLimitError
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.residual_weight import Precondition, residual_weight
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays, masked_data, mean_weight

# Rounds of the search for the largest eigenvalue, what is added to its answer, which comes from
# below, and the share of it that is rounding.
_ROUNDS, _MARGIN, _ROUNDING = 12, 1.05, 1e-6


class DataTerm:
    """A, y and the weight of the residual.

    Args:
        A: the operator.
        y: the data, of shape ``A.range``, on the host or on A's device.
        precondition: see ``residual_weight``.
        noise: standard deviation of the noise of a sample of y, if known.
        arrays: of the shape of x and of the shape of y that the method keeps on the device.
        weights: of the samples of y, their relative inverse variances; None: all alike.

    Raises:
        InputError: A is no operator, or y, ``precondition``, ``noise`` or ``weights`` cannot be
            used.
        ResourceLimitError: they do not fit the device's budget, and y is on the device or there is
            no room for them beside it.
    """

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        precondition: Precondition,
        noise: float | None,
        arrays: tuple[int, int] = (1, 2),
        weights: Any = None,
    ) -> None:
        if not isinstance(A, LinearOperator):
            raise InputError(
                f"A is a {type(A).__name__}, wanted a LinearOperator such as a Projector"
            )
        if noise is not None and not one_number(noise) >= 0:
            raise InputError(f"noise is {noise!r}, wanted a standard deviation, 0 or more")
        self.A, self.device, self.dtype = A, A.device, A.dtype
        self.home = _home(A, arrays, on_device=is_device_array(y))
        """Where arrays are kept."""
        self.samples = max(math.prod(A.range), 1)
        """Samples of y that count."""
        self.mean_weight = 1.0
        """Mean of the weights of the samples that count, which leaves the unit of the data open."""
        self.y = self.data()
        if weights is None:
            copy(self.device, self.given(y, A.range, name="y"), self.y)
        else:
            self._weigh_rays(y, weights)
        self.weight = residual_weight(self.A, self.y, precondition, noise)
        self.unit_gain = self.weight is None or isinstance(precondition, str)
        """Whether F keeps the size of white noise; not known of an operator of the caller's."""

    def _weigh_rays(self, y: Any, weights: Any) -> None:
        """Make A and y those of the weighted problem."""
        weighted = WeightedRays(self.A, weights)
        if weighted.measured == 0:
            raise InputError("weights are 0 everywhere: at least one sample must count")
        given = y if is_device_array(y) else masked_data(y, weighted.weights)
        copy(self.device, self.given(given, self.A.range, name="y"), self.y)
        weighted.weigh(self.y)
        self.A, self.samples = weighted, weighted.measured
        self.mean_weight = mean_weight(weighted.weights)

    def given(self, x: Any, shape: tuple[int, ...], *, name: str) -> Any:
        """An array that a caller gave, checked, on the side where arrays are kept.

        Raises:
            InputError: its shape or type is wrong, or it holds NaN or infinity.
        """
        if not is_device_array(x):
            host = as_host_array(x, shape, name=name, wants="the operator", dtype=self.dtype)
            return self.device.array(host, self.dtype) if self.home.on_device else host
        x = as_device_array(self.device, x, shape, name=name, dtype=self.dtype)
        if not math.isfinite(norm(self.device, x)):
            raise NonFiniteError(
                f"{name} holds NaN or infinity, or values whose squares do not fit {self.dtype}: "
                "replace them, or scale it down"
            )
        return x if self.home.on_device else download(self.device, x)

    def image(self) -> Any:
        """A new array of the shape of x, its contents not set."""
        return self.home.empty(self.A.domain)

    def data(self) -> Any:
        """A new array of the shape of y, its contents not set."""
        return self.home.empty(self.A.range)

    def start(self, start: Any) -> Any:
        """The image to begin from, a new array: zero if None was given."""
        if start is None:
            return self.home.zeros(self.A.domain)
        image = self.image()
        copy(self.device, self.given(start, self.A.domain, name="start"), image)
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
        image = self.home.made(self.A.domain, lambda shape: 1 + random.random(shape))
        before, product = self.home.zeros(self.A.domain), self.image()
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


def _home(A: LinearOperator, arrays: tuple[int, int], *, on_device: bool) -> ArrayHome:
    """The device, where it has room for so many images and sinograms; else a place beside it.

    Raises:
        ResourceLimitError: they have no room, or they are to be on the device and do not fit.
    """
    images, sinograms = (math.prod(shape) for shape in (A.domain, A.range))
    each = A.dtype.itemsize * (arrays[0] * images + arrays[1] * sinograms)
    try:
        plan_chunks(
            1,
            each,
            A.scratch,
            A.device.budget,
            what="solver",
            array=max(A.dtype.itemsize * max(images, sinograms), A.largest_scratch),
            largest=A.device.traits.allocation,
            instead="give y on the host, and arrays that do not fit are kept there",
        )
    except ResourceLimitError:
        if on_device:
            raise
        return ArrayHome(A.device, A.dtype, beside=each)
    return ArrayHome(A.device, A.dtype)
