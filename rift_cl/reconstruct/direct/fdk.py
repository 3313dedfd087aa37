"""Filtered backprojection of rays from a point: fans, and cones by Feldkamp, Davis and Kress.

With A the line integrals, C the cosine of the angle at which a ray meets the detector and h the
ramp at the pitch that bins have at the axis, the method of Feldkamp, Davis and Kress (Practical
cone-beam algorithm, J. Opt. Soc. Am. A 1, 612, 1984) is

    f = k A' C h C w y,        k = (R / S)^2 p_u p_v / dV,

R and S the distances of the source from axis and detector, p the pitches, dV the volume of a voxel:
A' spreads a ray by ``dV |d| S / (D^2 p_u p_v)``, d the way from the source to the bin and D the
depth of the voxel, and ``|d| C = S``, so that their weight R^2 / D^2 is that of the adjoint. In a
fan, whose slices are apart, A' has 1 / D alone: the projector is then asked for the other one, and
k is R p_u / (S dA).

A detector on an arc about the source has the ramp ``(gamma / sin gamma)^2 h`` between fan angles,
and before it the cosine of the fan angle as well (Kak and Slaney, Principles of Computerized
Tomographic Imaging, section 3.4.1). ``w`` counts every line once (``redundancy``). In the plane of
the source's orbit the result is exact; away from it the orbit does not know all (Tuy's condition),
and densities fall off.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import cut_evenly, plan_chunks
from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Fan, Grid, Scan, Vectors, at_axis
from rift_cl.operators.composite import Composite
from rift_cl.operators.filters.ramp_filters import (
    Filter,
    FilterLike,
    Finer,
    ViewFilter,
    as_filter,
    warn_of_doubt,
)
from rift_cl.operators.linear import Chunk, LinearOperator
from rift_cl.operators.projector.cone.rectification import Rectification
from rift_cl.operators.projector.projector import Projector
from rift_cl.operators.projector.volume_in_parts import VolumeInParts
from rift_cl.reconstruct.direct.padding import wider
from rift_cl.reconstruct.direct.ray_factors import RayFactors
from rift_cl.reconstruct.direct.redundancy import ITERATE, redundancy
from rift_cl.reconstruct.direct.upright_views import upright_cone

Floats = NDArray[np.float64]

# Heights that vary by less than this share of the source's distance are one orbit.
_LEVEL = 1e-6
# Bins that a cubic spline is read from (kernels/cone/upright_read.cl).
_FEWEST_BINS = 4


class FDK(Composite):
    """Filtered backprojection of a cone or a fan, from projections to a volume or an image.

    Args:
        A: the projector whose grid and scan to use. The detectors of ``Vectors`` may be tilted,
            rolled and shifted in every view, as long as the source goes round the axis, x = y = 0,
            on a circle.
        filter: along the detector's rows, as ``fbp`` takes it.
        compensate: what each view stands for: None, ``voronoi`` or ``uniform``, see ``redundancy``.

    Raises:
        InputError: the scan is not circular, or does not see enough; the sentence says what does.
    """

    method = "Method of Feldkamp, Davis and Kress (FDK)"

    def __init__(
        self, A: Projector, filter: FilterLike = "ram-lak", *, compensate: str | None = None
    ) -> None:
        super().__init__(A.range, A.domain, A.device, A.dtype)
        self._given, self._compensate, self.filter = A, compensate, as_filter(filter)
        scan, reading = _circle(A)
        warn_of_doubt(self.filter, at_axis(scan))
        counted = redundancy(scan, compensate)
        before, after = counted.missing
        wide = wider(scan, before, after)
        self._A = _backprojector(A, wide)
        self.sentence: str = counted.sentence
        """What was chosen for the scan's span and detector, for a reader."""
        filter_of_rows = ViewFilter(
            at_axis(wide),
            self._row_filter(wide, finer=scan.bins // self.domain[-1]),
            rows=self._A.range[1] if len(self._A.range) == 3 else None,
            gains=counted.views * amplitude(A.grid, wide),
            device=A.device,
            dtype=A.dtype,
        )
        into, out_of = _cosines(wide)
        rays = np.pad(counted.rays, [(0, 0), (before, after)])
        self._weighting = _Weighting(
            filter_of_rows,
            RayFactors(A.device, A.dtype, into, rays, before),
            RayFactors(A.device, A.dtype, out_of, np.ones((1, wide.bins))),
            self.domain,
            reading,
        )

    def _row_filter(self, scan: Fan | Cone, finer: int) -> Filter:
        if not scan.curved:
            return self.filter if finer == 1 else Finer(self.filter, finer)
        return _OnArc(self.filter, at_axis(scan).pitch / scan.source_to_axis)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(FDK, compensate=self._compensate), (self._given, self.filter)

    def _facts(self) -> list[str]:
        return [repr(self.filter), self.sentence, *self._given._facts()]

    def _apply(self, x: Any, out: Any) -> None:
        filtered = self.device.empty(self._weighting.range, self.dtype)
        self._weighting._apply(x, filtered)
        self._A._apply_adjoint(filtered, out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        rays = self.device.empty(self._weighting.range, self.dtype)
        self._A._apply(y, rays)
        self._weighting._apply_adjoint(rays, out)

    def _apply_steps(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        filtered = np.empty(self._weighting.range, self.dtype)
        self._weighting._apply_host(x, filtered)
        self._A._apply_adjoint_host(filtered, y)

    def _apply_adjoint_steps(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        rays = np.empty(self._weighting.range, self.dtype)
        self._A._apply_host(y, rays)
        self._weighting._apply_adjoint_host(rays, x)

    def slabs(
        self,
        y: NDArray[Any],
        budget: int,
        z: tuple[int, int] | None = None,
        rows: tuple[int, int] | None = None,
    ) -> Iterator[NDArray[Any]]:
        """The volume in slabs of slices, from the first on, with the bits of the whole.

        Args:
            y: projections on the host, as the operator takes them; of ``rows`` alone.
            budget: bytes of the device to work in, besides arrays on the host: those of the
                filtered projections and of a slab.
            z: the first slice that is wanted and the one after the last, either at an end or a
                multiple of ``block``; all if not given.
            rows: the first detector row that ``y`` has and the one after the last, all that these
                slices are seen in; of tilted detectors all. All if not given.

        Raises:
            ResourceLimitError: not even the smallest part fits.
        """
        weighting, run = self._weighting, slice(*(rows or (0, self.domain[-2])))
        filtered = np.zeros(weighting.range, self.dtype)
        part = weighting if rows is None else weighting.of_rows(run)
        seen = filtered if rows is None else filtered[:, run]
        for chunk in part._chunks(budget):
            part._apply_chunk(y, seen, chunk, add=False)
        yield from backprojected_slabs(slices_of(self._A, z).T, filtered, budget)

    @property
    def block(self) -> int:
        """Slices that slabs are not cut between."""
        return block_of(self._A)

    def check_slabs(self, budget: int) -> None:
        """Refuse a budget in which ``slabs`` would find no room.

        Raises:
            ResourceLimitError: not even the smallest part fits.
        """
        for operator in (self._weighting, self._A.T):
            check_part(operator, budget)

    @property
    def scratch(self) -> int:
        """Filtered projections, and what the steps need."""
        filtered = self.dtype.itemsize * math.prod(self._weighting.range)
        return filtered + self._weighting.records + max(self._weighting.scratch, self._A.scratch)

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array among these."""
        filtered = self.dtype.itemsize * math.prod(self._weighting.range)
        return max(filtered, self._weighting.largest_scratch, self._A.largest_scratch)


def check_part(operator: LinearOperator, budget: int) -> None:
    """Refuse a budget in which not even the smallest part of an operator's work finds room.

    Raises:
        ResourceLimitError: it does not.
    """
    next(iter(operator._chunks(budget)))


def slices_of(A: LinearOperator, z: tuple[int, int] | None) -> LinearOperator:
    """The projector of some slices of a volume; the whole one if none are named."""
    if z is None:
        return A
    assert isinstance(A, VolumeInParts)
    return A.of_slices(slice(*z))


def block_of(A: LinearOperator) -> int:
    """Slices of a projector's volume that are not cut between."""
    assert isinstance(A, VolumeInParts)
    return A.block


def backprojected_slabs(
    back: LinearOperator, filtered: NDArray[Any], budget: int
) -> Iterator[NDArray[Any]]:
    """A backprojection in slabs of slices, from the first on, with the bits of the whole.

    Args:
        back: the adjoint of a projector.
        filtered: what it is applied to, on the host.
        budget: bytes of the device to work in.
    """
    slab, place, add = np.empty(0, back.dtype), None, False
    for chunk in back._chunks(budget):
        if chunk.outside != place:
            if place is not None:
                yield slab
            place = chunk.outside
            first, stop, _ = (place[0] if place else slice(None)).indices(back.range[0])
            slab = np.empty((stop - first, *back.range[1:]), back.dtype)
            add = False
        back._apply_chunk(filtered, slab, chunk._replace(outside=()), add=add)
        add = True
    yield slab


class _Weighting(LinearOperator):
    """All that is done to projections before they are backprojected, to each view by itself.

    Args:
        filter: of the rows.
        into: factors before it, onto the detector that it is as wide as.
        out_of: factors after it.
        domain: shape of the projections.
        reading: what upright detectors read of tilted ones, where these are.
    """

    def __init__(
        self,
        filter: ViewFilter,
        into: RayFactors,
        out_of: RayFactors,
        domain: tuple[int, ...],
        reading: Rectification | None,
    ) -> None:
        super().__init__(domain, filter.range, filter.device, filter.dtype)
        self._filter, self._into, self._out_of, self._reading = filter, into, out_of, reading
        self._upright = domain if reading is None else (domain[0], *reading.shape)

    def _apply(self, x: Any, out: Any) -> None:
        if self._reading is not None:
            tilted, x = x, self.device.empty(self._upright, self.dtype)
            self._reading.read(tilted, x, 0, len(x))
        rays = self.device.empty(self.range, self.dtype)
        self._into.widen(x, rays)
        self._filter._apply(rays, out)
        self._out_of.widen(out, out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        rays = self.device.empty(self.range, self.dtype)
        self._out_of.widen(y, rays)
        filtered = self.device.empty(self.range, self.dtype)
        self._filter._apply_adjoint(rays, filtered)
        if self._reading is None:
            self._into.narrow(filtered, out)
            return
        upright = self.device.empty(self._upright, self.dtype)
        self._into.narrow(filtered, upright)
        self._reading.spread(upright, out, 0, len(out))

    @property
    def records(self) -> int:
        """Bytes of the factors."""
        return self._into.nbytes + self._out_of.nbytes

    @property
    def scratch(self) -> int:
        """Weighted and filtered projections, upright ones with their splines, and the filter's."""
        given, upright, rays = map(math.prod, (self.domain, self._upright, self.range))
        numbers = 2 * rays + (upright + 2 * given if self._reading is not None else 0)
        return self.dtype.itemsize * numbers + self._filter.scratch

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array that the filter needs."""
        return self._filter.largest_scratch

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        """Runs of views.

        Raises:
            ResourceLimitError: not even one view fits.
        """
        views, largest = self.domain[0], self.device.traits.allocation

        def needs(count: int) -> tuple[int, int]:
            run = self._of_views(slice(0, count))
            sizes = [self.dtype.itemsize * math.prod(s) for s in (run.domain, run.range)]
            array = max(*sizes, run.largest_scratch)
            return sum(sizes) + run.scratch + run.records, array

        def fits(count: int) -> bool:
            need, array = needs(count)
            return need <= budget and array <= largest

        most = bisect_left(range(1, views + 1), True, key=lambda count: not fits(count))
        if most == views:
            return [Chunk((), ())]
        need, array = needs(max(most, 1))
        what = "view with its weights and its filter"
        plan_chunks(1, need, 0, budget, what=what, array=array, largest=largest)
        runs = cut_evenly(views, most)
        return (Chunk((run,), (run,), self._of_views(run)) for run in runs)

    def of_rows(self, run: slice) -> _Weighting:
        """That of some rows of every view, with the numbers of the whole.

        Tilted detectors, whose upright rows are read from several, have all.
        """
        (views, rows, bins), (first, stop, _) = self.domain, run.indices(self.domain[1])
        assert self._reading is None or stop - first == rows
        return _Weighting(
            self._filter.of_rows(stop - first),
            self._into.of_rows(run),
            self._out_of.of_rows(run),
            (views, stop - first, bins),
            self._reading,
        )

    def _of_views(self, run: slice) -> _Weighting:
        """That of some views."""
        reading = None if self._reading is None else self._reading.of_views(run)
        return _Weighting(
            self._filter.of_views(run),
            self._into.of_views(run),
            self._out_of.of_views(run),
            (run.stop - run.start, *self.domain[1:]),
            reading,
        )


@dataclass(frozen=True)
class _OnArc:
    """A filter between fan angles: ``(gamma / sin gamma)^2`` times that between lengths.

    Args:
        filter: between lengths at the axis.
        step: fan angle between bins, in radians.
    """

    filter: Filter
    step: float

    def taps(self, bins: int, pitch: float) -> Floats:
        """Convolution kernel h[-(bins-1)] .. h[bins-1], in 1 / length^2."""
        gamma = np.arange(1 - bins, bins) * self.step
        taps: Floats = self.filter.taps(bins, pitch) / np.sinc(gamma / np.pi) ** 2
        return taps


def as_beam(scan: Scan | None) -> Fan | Cone:
    """The fan or the cone that a scan is, on a circle or not.

    Raises:
        InputError: it is none; the sentence names the methods that take it.
    """
    if isinstance(scan, (Fan, Cone)):
        return scan
    if not isinstance(scan, Vectors):
        raise InputError(f"scan is {scan!r:.60}, wanted a Fan, a Cone, or Vectors that are one")
    try:
        return Cone.of_vectors(scan)
    except InputError as failure:
        raise InputError(
            f"filtered backprojection wants a circular scan; {failure}; {ITERATE}"
        ) from None


def rises(scan: Fan | Cone) -> bool:
    """Whether the source leaves the plane of one orbit."""
    return isinstance(scan, Cone) and bool(np.ptp(scan.heights) > _LEVEL * scan.source_to_axis)


def amplitude(grid: Grid, scan: Fan | Cone) -> float:
    """k, which makes the adjoint's weights those of the inversion, and about 1 at the axis."""
    if isinstance(scan, Fan):
        return scan.pitch / scan.magnification / math.prod(grid.spacing[-2:])
    return math.prod(scan.pitch) / scan.magnification**2 / math.prod(grid.spacing)


def _circle(A: Projector) -> tuple[Fan | Cone, Rectification | None]:
    """The circular scan that a projector's is, and how its upright views are read if any are not.

    Raises:
        InputError: the source leaves a circle; the sentence names the methods that take it.
    """
    try:
        beam = as_beam(A.scan)
    except InputError:
        if isinstance(A.scan, Vectors):
            return _untilted(A, A.scan)
        raise
    if isinstance(beam, Cone) and rises(beam):
        raise InputError(
            f"scan: heights range over {np.ptp(beam.heights):.3g}, a helix or steps, and FDK wants "
            f"a circle; Katsevich takes an even helix, {ITERATE}"
        )
    return beam, None


def _untilted(A: Projector, scan: Vectors) -> tuple[Cone, Rectification]:
    if scan.bins < _FEWEST_BINS:
        raise InputError(
            f"scan: tilted detectors of {scan.bins} bins cannot be read as upright ones, which "
            f"takes {_FEWEST_BINS}; {ITERATE}"
        )
    try:
        cone, forms = upright_cone(scan)
    except InputError as failure:
        raise InputError(
            f"filtered backprojection wants a circular scan; {failure}; {ITERATE}"
        ) from None
    upright, shape = (cone.rows, cone.bins), (scan.rows, scan.bins)
    views = np.arange(scan.views, dtype=np.int32)
    return cone, Rectification(A.device, upright, shape, views, forms, A.dtype, spline=True)


def _backprojector(A: Projector, scan: Fan | Cone) -> Projector:
    """The projector whose adjoint has the weights of the inversion."""
    given: Any = {"device": A.device, "dtype": A.dtype}
    if isinstance(scan, Fan):
        return type(A)(A.grid, scan, A.footprint, depth_power=2, **given)
    # An integral's value stands for its ray: read at a voxel's centre it stays as sharp as it is.
    return Projector(A.grid, scan, "point", **given)


def _cosines(scan: Fan | Cone) -> tuple[Floats, Floats]:
    """Factors of pixels before and after the filter, (rows, bins), or (1, bins) of a fan."""
    v: Floats = np.zeros((1, 1))
    if isinstance(scan, Cone):
        v = (np.arange(scan.rows, dtype=np.float64) - scan.center[0])[:, None] * scan.pitch[0]
    gamma = scan.fan_angles()
    # In the orbit's plane a bin stands S / cos gamma away, or S where it is on an arc.
    reach = scan.source_to_detector / (np.ones_like(gamma) if scan.curved else np.cos(gamma))
    after: Floats = scan.source_to_detector / np.hypot(reach, v)
    return (after * np.cos(gamma) if scan.curved else after), after
