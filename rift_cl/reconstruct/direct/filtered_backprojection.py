"""Reconstruction by integration: filtered and unfiltered backprojection.

With p_j the view at angle j and h the ramp, the image is
``f(x, y) = sum over j of w_j (p_j * h)(x cos a_j + y sin a_j)``, w_j the share of the half-circle
that view j stands for (Kak and Slaney, section 3.3). Without h the result is the image convolved
with 1 / r: low frequencies are counted once for every view, which is the bias that the RiFT paper
shows in its Figures 4 and 5.

A full turn whose axis is off the middle of the detector measures lines near it twice and those
beyond once: its rays are weighed so that every line counts once (``offset_axis``).

Where directions are few or lie unevenly, what a view stands for depends on frequency as well, and
each view gets a filter of its own (rift_cl/operators/filters/compensation.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Parallel, Vectors
from rift_cl.geometry.numbers import one_number
from rift_cl.geometry.seen_grid import scan_lengths
from rift_cl.operators.algebra import Scaled
from rift_cl.operators.composite import Composite
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.ramp_filters import (
    FilterLike,
    Gains,
    ViewFilter,
    as_filter,
    warn_of_doubt,
)
from rift_cl.operators.linear import Chunk
from rift_cl.operators.projector.parallel.parallel_projector import ParallelProjector
from rift_cl.operators.projector.projector import Projector
from rift_cl.reconstruct.direct.fdk import (
    FDK,
    amplitude,
    as_beam,
    backprojected_slabs,
    block_of,
    check_part,
    slices_of,
)
from rift_cl.reconstruct.direct.katsevich import Katsevich, cone_inversion
from rift_cl.reconstruct.direct.offset_axis import (
    OwnSideViews,
    is_offset,
    is_weighed,
    offset_weights,
    widened_scan,
)
from rift_cl.reconstruct.direct.ray_factors import RayFactors
from rift_cl.reconstruct.direct.view_weights import view_gains

Floats = NDArray[np.float64]


class FilteredBackprojection(Composite):
    """Filtered backprojection as an operator from sinograms to images.

    Args:
        A: the projector whose geometry to use. Of a full turn whose axis is off the middle of the
            detector, rays count so that every line does once.
        filter: a name (``ram-lak``, ``shepp-logan``, ``cosine``, ``hamming``, ``hann``,
            ``high-pass``), a filter, or a function of frequency.
        compensate: what each view stands for. ``uniform``: every view the same. ``voronoi``: half
            the gaps to its neighbours; in a half acquisition to those on the whole circle, as the
            opposite ones show another side. ``covered``: the same, but that a hole, such as the
            missing wedge, is nobody's (``view_weights``). None: as ``voronoi`` in a half
            acquisition, else as ``covered``. ``capped-voronoi``, ``pipe-menon`` and ``exact``
            depend on frequency, and are the ones for random, clustered and limited angles; on even
            angles they are the plain ramp.
        diameter: of the object, for these three, in the grid's unit of length; that of the
            circle in the grid that the detector sees if not given.

    Raises:
        InputError: a name is unknown, or the diameter no length.
    """

    def __init__(
        self,
        A: ParallelProjector,
        filter: FilterLike = "ram-lak",
        *,
        compensate: str | None = None,
        diameter: float | None = None,
    ) -> None:
        super().__init__(A.range, A.domain, A.device, A.dtype)
        self._given = A
        # Of an axis off the middle: weights, the wider detector's projector, and where it begins.
        self._rays: NDArray[Any] | None = None
        self._before = 0
        if is_weighed(A.scan):
            self._rays = offset_weights(A.scan).astype(self.dtype)
            wide, self._before = widened_scan(A.scan)
            A = A.of_scan(wide)
        self._A = A
        self._compensate, self._diameter = compensate, diameter
        size = object_diameter(A) if diameter is None else one_number(diameter)
        if not size > 0:
            raise InputError(f"diameter is {diameter!r}, wanted the object's, a positive length")
        chosen = as_filter(filter)
        warn_of_doubt(chosen, A.scan)
        self._filter = ViewFilter(
            A.scan,
            chosen,
            rows=A.range[1] if len(A.range) == 3 else None,
            gains=_scaled(_gains(self._given.scan, compensate, size), _unspread(A)),
            device=A.device,
            dtype=A.dtype,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        settled = partial(
            FilteredBackprojection, compensate=self._compensate, diameter=self._diameter
        )
        return settled, (self._given, self._filter.filter)

    def _facts(self) -> list[str]:
        compensate = [] if self._compensate is None else [f"compensate {self._compensate}"]
        offset = [] if self._rays is None else [f"axis at bin {self._given.scan.center:g}"]
        return [repr(self._filter.filter), *compensate, *offset, *self._given._facts()]

    @cached_property
    def _weighting(self) -> RayFactors:
        """Lays weighed rays onto the wider detector."""
        rays, bins = self._on_wider(self._rays), self._A.scan.bins
        return RayFactors(self.device, self.dtype, np.ones((1, bins)), rays[None], self._before)

    def _on_wider(self, narrow: Any) -> NDArray[Any]:
        """Bins of the detector on the wider one, 0 beside it."""
        after = self._A.scan.bins - self._before - narrow.shape[-1]
        return np.pad(narrow, [(0, 0)] * (narrow.ndim - 1) + [(self._before, after)])

    def _wide(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        return (*shape[:-1], self._A.scan.bins)

    def _apply(self, x: Any, out: Any) -> None:
        rays = x
        if self._rays is not None:
            rays = self.device.empty(self._wide(x.shape), self.dtype)
            self._weighting.widen(x, rays)
        filtered = self.device.empty(rays.shape, self.dtype)
        self._filter._apply(rays, filtered)
        self._A._apply_adjoint(filtered, out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        projected = self.device.empty(self._wide(out.shape), self.dtype)
        self._A._apply(y, projected)
        if self._rays is None:
            self._filter._apply_adjoint(projected, out)
            return
        rays = self.device.empty(projected.shape, self.dtype)
        self._filter._apply_adjoint(projected, rays)
        self._weighting.narrow(rays, out)

    def _apply_steps(self, x: NDArray[Any], y: NDArray[Any]) -> None:
        rays = x if self._rays is None else self._on_wider(x * self._rays)
        filtered = np.empty_like(rays)
        self._filter._apply_host(rays, filtered)
        self._A._apply_adjoint_host(filtered, y)

    def _apply_adjoint_steps(self, y: NDArray[Any], x: NDArray[Any]) -> None:
        projected = np.empty(self._wide(x.shape), self.dtype)
        self._A._apply_host(y, projected)
        if self._rays is None:
            self._filter._apply_adjoint_host(projected, x)
            return
        rays = np.empty_like(projected)
        self._filter._apply_adjoint_host(projected, rays)
        seen = slice(self._before, self._before + x.shape[-1])
        np.multiply(rays[..., seen], self._rays, out=x)

    @property
    def _sinograms(self) -> int:
        """Sinograms, as wide as the projector's, that a slice needs at the same time."""
        return 2 if self._rays is None else 3

    @property
    def scratch(self) -> int:
        """Weighed and filtered sinograms, besides what filter and projector need."""
        views = self.dtype.itemsize * math.prod(self._A.range)
        return (self._sinograms - 1) * views + self._filter.scratch + self._A.scratch

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        # The sinogram, the weighed one where there is one, and the filtered one.
        chunks = self._A.chunks(budget, sinograms=self._sinograms, fixed=self._filter.scratch)
        return [chunk.transposed for chunk in chunks]


def fbp(
    A: ParallelProjector | Projector,
    y: Any,
    filter: FilterLike = "ram-lak",
    compensate: str | None = None,
    *,
    diameter: float | None = None,
    out: Any = None,
) -> Any:
    """Reconstruct by filtered backprojection; of cones by that of Feldkamp, Davis and Kress.

    Args:
        A: the projector that describes grid and scan. Parallel views that cover less than half a
            turn are taken as they are: what lies between the first and the last is missing from
            the image. Those of a full turn whose axis is off the middle of the detector are weighed
            so that every line counts once, to the end of its longer side; where it is far off, the
            turn may have a hole of up to 15 degrees. A cone's source goes
            round a full turn or half a turn and the fan; the rotation axis may be near one side of
            the detector in a full turn (see ``FDK``). Or it goes along an even helix (see
            ``Katsevich``).
        y: sinogram (angles, bins) or projections (angles, rows, bins); line integrals in the
            image's unit times the grid's unit of length.
        filter: a name (``ram-lak``, ``shepp-logan``, ``cosine``, ``hamming``, ``hann``,
            ``high-pass``), a filter, or a function of frequency.
        compensate: what each view stands for, see ``FilteredBackprojection``; of a cone None,
            ``voronoi`` or ``uniform``.
        diameter: of the object, of parallel beams alone, see there.
        out: where to put the result.

    Returns:
        The image or volume, in the image's unit, on the side (host or device) where ``y`` is.

    Raises:
        InputError: ``y`` does not fit, is not finite, or a name is unknown; or the views of a fan
            or a cone do not allow it, and the sentence names the methods that take them.
    """
    return filtered_backprojection(A, filter, compensate, diameter=diameter)(y, out, name="y")


def filtered_backprojection(
    A: ParallelProjector | Projector,
    filter: FilterLike = "ram-lak",
    compensate: str | None = None,
    *,
    diameter: float | None = None,
) -> FilteredBackprojection | FDK | Katsevich:
    """The operator that ``fbp`` applies, chosen by the scan of ``A``; arguments are those of it."""
    if isinstance(A, ParallelProjector):
        return FilteredBackprojection(A, filter, compensate=compensate, diameter=diameter)
    _check_projector(A)
    if diameter is not None:
        raise InputError("diameter is given, and only filters of parallel beams depend on it")
    return cone_inversion(A, filter, compensate)


def backproject(A: ParallelProjector | Projector, y: Any, *, out: Any = None) -> Any:
    """Backproject without a filter, every view alike: the paper's unfiltered baseline.

    ``A``, ``y``, ``out`` and errors are those of ``fbp``. The result is the image convolved with
    1 / r, in the image's unit times a length, so that of attenuation it has no unit; compare it
    after an affine fit.
    """
    return unfiltered_backprojection(A)(y, out, name="y")


class Backprojection(Scaled):
    """Backprojection without a filter, an operator from projections to images."""

    def slabs(
        self,
        y: NDArray[Any],
        budget: int,
        z: tuple[int, int] | None = None,
        rows: tuple[int, int] | None = None,
    ) -> Iterator[NDArray[Any]]:
        """The volume in slabs of slices, as ``FDK.slabs``."""
        if rows is not None:
            given, y = y, np.zeros(self.domain, self.dtype)
            y[:, slice(*rows)] = given
        back = slices_of(self._inner.T, z).T * self._factor
        return backprojected_slabs(back, y, budget)

    @property
    def block(self) -> int:
        """Slices that slabs are not cut between."""
        return block_of(self._inner.T)

    def check_slabs(self, budget: int) -> None:
        """Refuse a budget in which ``slabs`` would find no room.

        Raises:
            ResourceLimitError: not even the smallest part fits.
        """
        check_part(self, budget)


def unfiltered_backprojection(A: ParallelProjector | Projector) -> Backprojection:
    """The operator that ``backproject`` applies, chosen by the scan of ``A``."""
    _check_projector(A)
    if isinstance(A, ParallelProjector):
        return Backprojection(A.T, np.pi / len(A.scan.angles) * _unspread(A))
    scan = A.scan
    if isinstance(scan, Vectors):
        # The median view stands for all.
        share = math.prod(scan_lengths(scan).pixel) / math.prod(A.grid.spacing)
    else:
        share = amplitude(A.grid, as_beam(scan))
    return Backprojection(A.T, np.pi / A.range[0] * share)


def _check_projector(A: Any) -> None:
    if not isinstance(A, (ParallelProjector, Projector)):
        raise InputError(f"A is a {type(A).__name__}, wanted a Projector first, then the sinogram")


def object_diameter(A: ParallelProjector) -> float:
    """Diameter of the circle in the grid that the detector sees, in the grid's unit of length."""
    edges = (n * d for n, d in zip(A.grid.shape[-2:], A.grid.spacing[-2:], strict=True))
    return min(*edges, A.scan.bins * A.scan.pitch)


def _gains(scan: Parallel, compensate: str | None, diameter: float) -> Floats | Compensation:
    """What each view stands for, as ``view_gains`` has it of the scan's directions.

    A view of a half acquisition shows what is on its own side of the axis. Where the one from the
    opposite side is missing it shows no more, so that it stands for its share of the whole circle.
    """
    own_side = is_offset(scan) or isinstance(scan, OwnSideViews)
    own_side = own_side and compensate not in COMPENSATIONS
    if not own_side:
        return view_gains(scan.angles, compensate, diameter)
    # Twice around for halves of angles is once around.
    return view_gains(scan.angles / 2, compensate or "voronoi", diameter)


def _scaled(gains: Floats | Compensation, factor: float) -> Gains:
    if isinstance(gains, Compensation):
        return lambda frequencies: factor * gains(frequencies)
    return factor * gains


def _unspread(A: ParallelProjector) -> float:
    # A.T spreads a bin over pixels with weights that add up to dx dy / pitch; the sum over
    # views that inverts the transform wants weights that add up to one.
    dy, dx = A.grid.spacing[-2:]
    return A.scan.pitch / (dx * dy)
