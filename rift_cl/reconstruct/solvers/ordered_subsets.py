"""Ordered subsets: SIRT that corrects the image after every few views (OS-SART).

    x <- x + relaxation * C A_s' R_s (y_s - A_s x)      for one subset s of the views after another,

R_s one over the sums of A_s's rows (Andersen and Kak, Ultrason. Imaging 6, 1984; Hudson and Larkin,
IEEE Trans. Med. Imaging 13, 1994). A pass over all subsets costs what one step of SIRT does and
comes about as far as so many steps as there are subsets, at first. C is one over the largest of the
subsets' sums of columns, pixel by pixel: one C for all keeps every subset's step a descent in the
same metric, also for pixels that few views see.

With weights W of the rays they take the place of R, and C is one over the largest of the subsets'
``A_s' W_s A_s 1`` (Erdogan and Fessler, Phys. Med. Biol. 44, 1999). On data that contradict
themselves passes end in a small cycle instead of at the minimum, the smaller the fewer subsets;
then some passes with fewer subsets, or a smaller relaxation, come closer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import clip_negative, copy, multiply
from rift_cl.cl.passing_parts import runs
from rift_cl.cl.reductions import dot
from rift_cl.errors import InputError, NonFiniteError, checked_flag
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.data_term import DataTerm
from rift_cl.reconstruct.solvers.simultaneous_iteration import (
    check_converges,
    inverse_sums,
    residual_bound,
)
from rift_cl.reconstruct.solvers.solver import Solver, SolverState
from rift_cl.reconstruct.solvers.view_subsets import Views, restricted, view_subsets


@dataclass
class _Subset:
    """Some views of the problem.

    Args:
        views: which.
        A: the operator for these alone.
        y: their data.
        rays: one over the sums of rows; None with weights.
        residual: A x - y, when it was last looked at.
    """

    views: Views
    A: LinearOperator
    y: Any
    rays: Any
    residual: Any


class OrderedSubsets(Solver):
    """Ordered subsets that have begun; a step is a pass over all views.

    The residual that is reported is the one met in passing: that of each subset just before its
    correction, which is a little larger than that of the image at the end of the pass.

    Args:
        A: a linear operator without negative weights, whose range has views along its first axis;
            a ``Projector`` is divided at no extra cost.
        y: the data, of shape ``A.range``.
        subsets: how many the views are divided into. 10 is a good number for 100 views and more;
            a subset should keep 5 views or more unless relaxation is small.
        start: image to begin from; zero if not given.
        nonnegative: whether to keep the image >= 0.
        relaxation: length of a step, between 0 and 2.
        noise: standard deviation of the noise of a sample of y: the run ends once the residual is
            down to it.
        weights: how much each sample counts, of the shape of y; see ``sirt``.

    Raises:
        InputError: an argument does not fit, or holds NaN or infinity.
    """

    arrays = 4, 5
    _now: SolverState

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        subsets: int = 10,
        *,
        start: Any = None,
        nonnegative: bool = False,
        relaxation: float = 1.0,
        noise: float | None = None,
        weights: Any = None,
    ) -> None:
        if not 0 < one_number(relaxation) < 2:
            raise InputError(f"relaxation is {relaxation!r}, wanted a number between 0 and 2")
        self._nonnegative = checked_flag("sirt", "nonnegative", nonnegative)
        data = DataTerm(A, y, None, noise, self.arrays, weights)
        super().__init__(data, noise)
        count, most = one_number(subsets), A.range[0]
        if not (1 <= count <= most and count.is_integer()):
            raise InputError(
                f"subsets is {subsets!r}, wanted a whole number from 1 to the {most} views"
            )
        self._length = float(relaxation)
        whole = data.home.host(data.y)
        chosen = view_subsets(data.A, int(count))
        self._subsets = [self._subset(views, whole, weights is None) for views in chosen]
        self._pixels = self._inverse_columns(weights is None)
        image = data.start(start)
        if self._nonnegative:
            clip_negative(data.device, image)
        self._now = SolverState(image, data.data(), 0, 0.0)
        self._change = data.image()
        self._measured(image, self._now.residual)
        self._now.rms = data.rms(self._now.residual)
        self._most = residual_bound(data, self._now.rms)

    def _subset(self, views: Views, whole: NDArray[Any], unweighted: bool) -> _Subset:
        data = self.data
        part = restricted(data.A, views)
        y = data.home.array(whole[views])
        rays = inverse_sums(part, data.home) if unweighted else None
        return _Subset(views, part, y, rays, data.home.empty(part.range))

    def _inverse_columns(self, unweighted: bool) -> Any:
        """One over the largest of the subsets' sums of columns; 0 where nothing is seen."""
        home = self.data.home
        least: Any = None
        for part in self._subsets:
            sums = inverse_sums(part.A.T if unweighted else part.A.T @ part.A, home)
            found = home.host(sums).reshape(-1)
            least = found if least is None else least
            for run in runs(found.size):
                one, kept = found[run], least[run]
                np.copyto(kept, one, where=(one > 0) & ((kept == 0) | (one < kept)))
        least = least.reshape(self.data.A.domain)
        return home.array(least) if home.on_device else least

    def _advance(self) -> None:
        now, data, device = self._now, self.data, self.data.device
        squares = 0.0
        for part in self._subsets:
            self._look(part, now.image)
            squares += dot(device, part.residual, part.residual)
            if part.rays is not None:
                multiply(device, part.rays, part.residual)
            part.A.T(part.residual, out=self._change)
            multiply(device, self._pixels, self._change)
            axpby(device, -self._length, self._change, 1.0, now.image)
            if self._nonnegative:
                clip_negative(device, now.image)
        if not math.isfinite(squares):
            raise NonFiniteError(
                f"the residual has left the range of {data.dtype}: scale y to values near 1"
            )
        now.rms = math.sqrt(squares / data.samples)
        now.step += 1
        check_converges(now, self._most, "A")

    def _look(self, part: _Subset, image: Any) -> None:
        part.A(image, out=part.residual)
        axpby(self.data.device, -1.0, part.y, 1.0, part.residual)

    def _measured(self, image: Any, out: Any) -> None:
        """``out`` = A image - y, all views in their order."""
        home = self.data.home
        whole = np.empty(out.shape, out.dtype) if home.on_device else out
        for part in self._subsets:
            self._look(part, image)
            whole[part.views] = home.host(part.residual)
        if home.on_device:
            copy(self.data.device, home.array(whole), out)

    def state(self) -> dict[str, NDArray[Any]]:
        """The solver's state as host arrays; computing it projects all views once."""
        self._measured(self._now.image, self._now.residual)
        return super().state()
