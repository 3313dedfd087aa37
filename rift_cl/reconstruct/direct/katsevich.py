"""Filtered backprojection of cones whose source goes along a helix, by Katsevich's method.

    f(x) = 1 / 2 pi  integral over a of  g(a, u, v) / D(a, x),

between the two views whose sources a chord through x joins, where g are the filtered views (see
``helix_filter``), (u, v) the place at which x is seen and D its depth. It is exact: data of a
helix, unlike those of a circle, determine the volume (Tuy's condition), and densities do not fall
off with the cone's angle. Views are backprojected by the projector's adjoint with one factor of
the depth less than that of line integrals; the window of Tam and Danielsson, which is the same in
every view, stands for the bounds of the integral.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.elementwise import copy
from rift_cl.cl.host_arrays import download
from rift_cl.errors import InputError
from rift_cl.geometry import Cone
from rift_cl.operators.filters.ramp_filters import FilterLike, as_filter
from rift_cl.operators.linear import LinearOperator
from rift_cl.operators.projector.cone.slab_projector import SlabProjector
from rift_cl.operators.projector.projector import Projector
from rift_cl.reconstruct.direct.fdk import (
    FDK,
    amplitude,
    as_beam,
    backprojected_slabs,
    check_part,
    rises,
)
from rift_cl.reconstruct.direct.helix_filter import Helix, HelixFilter, complete_depth
from rift_cl.reconstruct.direct.redundancy import ITERATE


class Katsevich(LinearOperator):
    """Filtered backprojection of a helical cone, from projections to a volume.

    Args:
        A: the projector whose grid and scan to use: a ``Cone`` with evenly spaced views and heights
            that rise or fall evenly with them, in any order, flat or curved, or ``Vectors`` that
            are one. The object must not leave the detector sideways.
        filter: ``ram-lak``, ``shepp-logan``, ``cosine``, ``hamming`` or ``hann``, or a ``Ramp``:
            the window along the detector's rows.

    Views are filtered on the host. Of the rows those in the window count, as many as the source
    rises by in half a turn and some; fewer than three are too few to read between, and slices
    ripple. Slices near the ends of the helix, of which views are missing,
    come out incomplete; ``slices`` says which are not.

    Raises:
        InputError: the scan is no even helix, the detector has too few rows for its rise, no slice
            is complete, or the filter is another one; the sentence says what takes it.
    """

    method = "Method of Katsevich for a helix"

    def __init__(self, A: Projector, filter: FilterLike = "ram-lak") -> None:
        super().__init__(A.range, A.domain, A.device, A.dtype)
        self._given, self.filter = A, as_filter(filter)
        scan = as_beam(A.scan)
        if not isinstance(scan, Cone):
            raise InputError(f"scan is {scan!r:.60}, wanted a helical Cone; {ITERATE}")
        helix = _helix(scan)
        radius = max(n * d / 2 for n, d in zip(A.grid.shape[1:], A.grid.spacing[1:], strict=True))
        half_fan = float(np.abs(scan.fan_angles()).max())
        half_fan = min(half_fan, math.asin(min(radius / scan.source_to_axis, 1.0)))
        _check_rows(scan, helix, half_fan)
        between = replace(
            scan,
            angles=(helix.angles[1:] + helix.angles[:-1]) / 2,
            heights=(helix.heights[1:] + helix.heights[:-1]) / 2,
        )
        depth = complete_depth(radius, scan, helix)
        low, high = np.sort(between.heights[[0, -1]])
        z = A.grid.coordinates(0)
        inside = np.searchsorted(z, low + depth), np.searchsorted(z, high - depth, side="right")
        self.slices: tuple[int, int] = int(inside[0]), int(inside[1])
        """First slice of which all views are there, and the one after the last."""
        first, stop = self.slices
        if stop <= first:
            raise InputError(
                f"scan: heights range over {np.ptp(scan.heights):.3g}, and no slice of the grid is "
                f"{depth:.3g} within them, where a helix determines it; {ITERATE}"
            )
        turns = (helix.angles[-1] - helix.angles[0]) / (2 * np.pi)
        self.sentence = (
            f"{turns:.3g} turns, a rise of {2 * np.pi * helix.rise:.4g} each; slices {first} to "
            f"{stop - 1} of {A.domain[0]} have all their views"
        )
        """What was read from the scan, for a reader."""
        self._filter = HelixFilter(scan, helix, self.filter, half_fan)
        self._gain = amplitude(A.grid, scan)
        self._A = SlabProjector(A.grid, between, "point", A.device, A.dtype, depth_power=1)

    def __reduce__(self) -> tuple[Any, ...]:
        return Katsevich, (self._given, self.filter)

    def _facts(self) -> list[str]:
        return [repr(self.filter), self.sentence, *self._given._facts()]

    def _apply(self, x: Any, out: Any) -> None:
        filtered = self._filter(download(self.device, x), self._gain)
        self._A._apply_adjoint(self.device.array(filtered, self.dtype), out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        rays = self.device.empty(self._A.range, self.dtype)
        self._A._apply(y, rays)
        views = self._filter.adjoint(download(self.device, rays), self._gain)
        copy(self.device, self.device.array(views, self.dtype), out)

    def _apply_host(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        self._A._apply_adjoint_host(self._filter(x, self._gain), y)

    def _apply_adjoint_host(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        rays = np.empty(self._A.range, self.dtype)
        self._A._apply_host(y, rays)
        x[...] = self._filter.adjoint(rays, self._gain)

    def slabs(
        self,
        y: NDArray[Any],
        budget: int,
        z: tuple[int, int] | None = None,
        rows: tuple[int, int] | None = None,
    ) -> Iterator[NDArray[Any]]:
        """The volume in slabs of slices, as ``FDK.slabs``; curves of the filter need all rows."""
        assert rows is None or rows == (0, self.domain[1])
        back = self._A if z is None else self._A.of_slices(slice(*z))
        return backprojected_slabs(back.T, self._filter(y, self._gain), budget)

    @property
    def block(self) -> int:
        """Slices that slabs are not cut between."""
        return self._A.block

    def check_slabs(self, budget: int) -> None:
        """Refuse a budget in which ``slabs`` would find no room.

        Raises:
            ResourceLimitError: not even the smallest part fits.
        """
        check_part(self._A.T, budget)

    @property
    def scratch(self) -> int:
        """Filtered projections, and what the projector needs."""
        return self.dtype.itemsize * math.prod(self._A.range) + self._A.scratch

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        filtered = self.dtype.itemsize * math.prod(self._A.range)
        return max(filtered, self._A.largest_scratch)


def cone_inversion(
    A: Projector, filter: FilterLike = "ram-lak", compensate: str | None = None
) -> FDK | Katsevich:
    """Filtered backprojection of rays from a point, by the method that the source's path asks for.

    Arguments and errors are those of ``FDK`` and ``Katsevich``.

    Raises:
        InputError: ``compensate`` is given and the views are those of a helix.
    """
    try:
        helical = rises(as_beam(A.scan))
    except InputError:
        helical = False
    if not helical:
        return FDK(A, filter, compensate=compensate)
    if compensate is not None:
        raise InputError(f"compensate is {compensate!r}, and views of a helix are at even steps")
    return Katsevich(A, filter)


def _helix(scan: Cone) -> Helix:
    try:
        return Helix.of(scan)
    except InputError as failure:
        raise InputError(
            f"scan: heights range over {np.ptp(scan.heights):.3g}; filtered backprojection wants a "
            f"circle or an even helix, but {failure}; {ITERATE}"
        ) from None


def _check_rows(scan: Cone, helix: Helix, half_fan: float) -> None:
    """Refuse a rise that takes the source too far between the views of a point."""
    stretch = (np.pi / 2 + half_fan) / math.cos(half_fan) ** (1 if scan.curved else 2)
    rows = min(scan.center[0], scan.rows - 1 - scan.center[0]) + 0.5
    most = rows * scan.pitch[0] / scan.magnification / stretch
    if abs(helix.rise) > most:
        raise InputError(
            f"scan: heights rise by {2 * np.pi * abs(helix.rise):.4g} in a turn, and the rows of "
            f"the detector reach far enough for {2 * np.pi * most:.4g}; {ITERATE}"
        )
