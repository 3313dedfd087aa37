"""Subsets of a scan's views: which views go together, in which order, and A for them alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.elementwise import copy
from rift_cl.cl.host_arrays import download
from rift_cl.geometry import Parallel, at_axis
from rift_cl.operators.linear import LinearOperator
from rift_cl.operators.projector.parallel.fast_projector import FastProjector
from rift_cl.operators.projector.projector import Projector
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays

Views = NDArray[np.intp]


def view_subsets(A: LinearOperator, count: int) -> list[Views]:
    """Divide the views of A into subsets that are spread over all directions, in a good order.

    Every subset takes each ``count``-th view in the order of directions, and subsets follow one
    another bit-reversed, so that each looks from between those just used (Hudson and Larkin, IEEE
    Trans. Med. Imaging 13, 1994; Guan and Gordon, Phys. Med. Biol. 39, 1994).

    Args:
        A: the operator; views are the first axis of its range, in the order of its scan's angles.
        count: of subsets, at most that of the views.

    Returns:
        The views of every subset, ascending.
    """
    views = A.range[0]
    order = np.arange(views)
    if A.scan is not None and A.scan.views == views:
        # Opposite views of parallel rays are alike; those from a point are not.
        turn = np.pi if isinstance(A.scan, Parallel) else 2 * np.pi
        order = np.argsort(np.mod(at_axis(A.scan).angles, turn), kind="stable")
    bits = max(count - 1, 0).bit_length()
    firsts = sorted(range(count), key=lambda k: f"{k:0{bits}b}"[::-1])
    return [np.sort(order[first::count]) for first in firsts]


def restricted(A: LinearOperator, views: Views) -> LinearOperator:
    """A followed by the choice of some of its views.

    A projector becomes one of these views, at the price of these views; ``FastProjector`` still
    transforms the whole image. Any other operator is applied whole and the rest thrown away, which
    is right, and as dear as all views.
    """
    if isinstance(A, WeightedRays):
        return WeightedRays(restricted(A.inner, views), A.weights[views])
    if isinstance(A, Projector) and A.scan is not None:
        scan = A.scan.subset(views)
        part: LinearOperator = Projector(A.grid, scan, A.footprint, device=A.device, dtype=A.dtype)
        return part
    if type(A) is FastProjector:
        return FastProjector(A.grid, A.scan.subset(views), A.error, lobes=A.lobes, device=A.device)
    return ChosenViews(A, views)


class ChosenViews(LinearOperator):
    """An operator of which only some views are wanted.

    Args:
        A: the operator, whose range has views along its first axis.
        views: the views, ascending.
    """

    def __init__(self, A: LinearOperator, views: Views) -> None:
        super().__init__(A.domain, (len(views), *A.range[1:]), A.device, A.dtype)
        self.grid = A.grid
        self._A, self._views = A, views

    def __reduce__(self) -> tuple[Any, ...]:
        return ChosenViews, (self._A, self._views)

    def _facts(self) -> list[str]:
        return [f"{len(self._views)} of {self._A.range[0]} views of {self._A!r}"]

    @property
    def scratch(self) -> int:
        """The operator's, and data of all views."""
        return self._A.scratch + self.dtype.itemsize * int(np.prod(self._A.range))

    def _apply(self, x: Any, out: Any) -> None:
        whole = self.device.empty(self._A.range, self.dtype)
        self._A._apply(x, whole)
        chosen = download(self.device, whole)[self._views]
        copy(self.device, self.device.array(chosen, self.dtype), out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        whole = np.zeros(self._A.range, self.dtype)
        whole[self._views] = download(self.device, y)
        self._A._apply_adjoint(self.device.array(whole, self.dtype), out)
