"""The methods of ``rift reconstruct``: from the projections of a slab to its slices.

Formulas take a slab at once. Methods that take steps go through it slice by slice: each slice then
has its own steps, so that no result depends on how much memory there was for a slab.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_input import SliceInput
from rift_cl.commands.reconstruct.slice_window import Window, cut_evenly
from rift_cl.geometry import Fan, Grid, Parallel, at_axis
from rift_cl.io.volumes.layout import PART
from rift_cl.operators import (
    FastProjector,
    LinearOperator,
    ParallelProjector,
    Projector,
    cheapest_projector,
)
from rift_cl.operators.projector.fan.fan_slices_projector import FanSlicesProjector
from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector
from rift_cl.progress import Report
from rift_cl.reconstruct import (
    Cgls,
    Pdhg,
    Sirt,
    backproject,
    fbp,
    poisson_weights,
    variation_weight,
)
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights
from rift_cl.reconstruct.solvers.disc_prior import find_disc, material_lengths
from rift_cl.reconstruct.solvers.few_levels import FewLevels
from rift_cl.reconstruct.solvers.measured_rays import MeasuredRays
from rift_cl.reconstruct.solvers.ordered_subsets import OrderedSubsets
from rift_cl.reconstruct.solvers.solver import Solver
from rift_cl.reconstruct.solvers.tv_problem import VariationSolver

Floats = NDArray[np.float32]
AnyProjector = ParallelProjector | Projector
# Projectors that take arrays of a slice in parts where they must, as solvers do.
_IN_PARTS = PhaseProjector, FanSlicesProjector
# Images and sinograms, float32, that each slice of a slab needs on host and device at a time: a
# formula's are counts, line integrals, two temporaries and the filtered ones. The next slab is read
# and the last one written at the same time: an image and two sinograms more.
_OF_A_SLICE = {"fbp": (3, 8), "backproject": (3, 8)}
_OF_A_SOLVED_SLICE = (2, 6)
# Those of the state of a method that takes steps, which one slice of a slab has at a time.
_OF_THE_STATE = {"sirt": (11, 5), "cgls": (8, 5), "tv": (11, 4), "levels": (14, 6)}
# Directions that no view looks along, in one piece, from which on angles count as limited.
_LIMITED = np.pi / 6
# Copies of what is read before it is binned.
_READ = 2
# Slices between two reports of progress; of those that take steps, each of which is reported.
_SLAB, _ITERATIVE_SLAB = PART, 4
# Steps that are timed, after a first one that builds the kernels.
_TIMED_STEPS = 3
# The weight of the total variation for levels, as a share of what would level small features.
_VARIATION = 0.1


@dataclass
class Inversion:
    """A method at work on the slices of one scan.

    Args:
        settings: the method and its options.
        source: the scan; located.
        device: where to work.
        residuals: root mean square of the residual after each step, by detector row.
        weights: of the total variation, by detector row.
    """

    settings: ReconstructSettings
    source: SliceInput
    device: Device
    residuals: dict[int, list[float]] = field(default_factory=dict)
    weights: dict[int, float] = field(default_factory=dict)
    _projectors: dict[int, AnyProjector] = field(default_factory=dict)

    @property
    def window(self) -> Window:
        """Where the slices lie."""
        return Window.of(self.settings, self.source)

    @property
    def need(self) -> int:
        """Bytes that a slice takes, on host and device together, besides the projector's own."""
        return self._need(self.projector(1))

    def fixed(self, slices: int = 1) -> int:
        """Bytes that a slab needs besides those of its slices: of the projector and of a state."""
        return self._fixed(self.projector(slices))

    def _need(self, A: AnyProjector) -> int:
        arrays = _OF_A_SLICE.get(self.settings.method, _OF_A_SOLVED_SLICE)
        # What is binned is read as it is.
        fine = (self.settings.binning**2 - 1) * _READ * self._sinogram(A)
        return self._bytes(A, *arrays) + 4 * fine

    def _fixed(self, A: AnyProjector) -> int:
        return A.scratch + self._bytes(A, *_OF_THE_STATE.get(self.settings.method, (0, 0)))

    def _bytes(self, A: AnyProjector, images: int, sinograms: int) -> int:
        """Of so many images and sinograms."""
        image = int(np.prod(A.grid.shape[-2:]))
        return 4 * (images * image + sinograms * self._sinogram(A))

    def _sinogram(self, A: AnyProjector) -> int:
        """Samples of a slice's sinogram, before and after views were combined and padded."""
        views, bins = self.source.scan.shape[0], self.source.scan.shape[2]
        return max(A.range[0], views) * max(A.range[-1], bins)

    def projector(self, slices: int) -> AnyProjector:
        """The projector of a number of slices, kept for the next slab of the same size."""
        count = 0 if self.settings.iterative else slices
        if count not in self._projectors:
            self._projectors[count] = self._projector(slices)
        return self._projectors[count]

    @property
    def projection(self) -> dict[str, Any]:
        """The setting that decides the projector, which costs and memory may have decided."""
        A: Any = self.projector(1)
        return {"error": A.error} if isinstance(A, FastProjector) else {"footprint": A.footprint}

    def check_memory(self) -> None:
        """Make sure that a slice fits the budget, before the axis is known.

        Raises:
            ResourceLimitError: it does not.
        """
        self._fitting(1, self._projector(1))

    def slabs(self, runs: list[slice]) -> list[slice]:
        """Cut runs of slices into slabs that fit the budget.

        Raises:
            ResourceLimitError: not even one slice does.
        """
        A = self.projector(1)
        cut = []
        for run in runs:
            most = _ITERATIVE_SLAB if self.settings.iterative else _SLAB
            # Halves, quarters, ... of a part, which end where the part does.
            while len(self._fitting(min(most, run.stop - run.start), A)) > 1:
                most //= 2
            cut += cut_evenly(run, most)
        return cut

    def _fitting(self, count: int, A: AnyProjector) -> list[slice]:
        """Chunks of so many slices; arrays of a slice are taken in parts where that can be."""
        array = 4 * max(int(np.prod(A.grid.shape[-2:])), A.range[0] * A.range[-1])
        if isinstance(A, _IN_PARTS):
            array = 0
        return plan_chunks(
            count,
            self._need(A),
            self._fixed(A),
            self.device.budget,
            what="slice",
            array=array,
            largest=self.device.traits.allocation,
        )

    def slices(self, first: int, projections: Floats) -> Generator[Report, None, Floats]:
        """Reconstruct a slab; a report after every step of every slice.

        Args:
            first: detector row of the first slice, for ``residuals``.
            projections: (angle, row, bin) as ``SliceInput.read`` gives them.

        Returns:
            (row, y, x), attenuation per unit of length.
        """
        if not self.settings.iterative:
            return self._formula(projections)
        _, part = self.window.around(self._width())
        slab = np.empty((projections.shape[1], *self.window.shape), np.float32)
        for row in range(projections.shape[1]):
            solver, level = self._solver(np.ascontiguousarray(projections[:, row]))
            curve = self.residuals.setdefault(first + row, [])
            if isinstance(solver, VariationSolver):
                self.weights[first + row] = solver.weight
            for report in solver.run(self.settings.most_steps):
                curve.append(report.values["residual"])
                yield Report(report.done, self.settings.most_steps, "steps", report.values)
            slab[row] = level * self.device.get(solver.image)[part]
        return slab

    def figures(self) -> dict[str, float]:
        """What came out of the steps, over all slices."""
        curves = [curve for _, curve in sorted(self.residuals.items()) if curve]
        if not curves:
            return {}
        found = [self.weights[row] for row in sorted(self.weights)]
        return {
            **({"weight": float(np.mean(found))} if found else {}),
            "steps": float(np.mean([len(curve) for curve in curves])),
            "residual": float(np.sqrt(np.mean([curve[-1] ** 2 for curve in curves]))),
        }

    def seconds(self, projections: Floats) -> float:
        """How long a slice takes, from a first one or from its first steps."""
        if not self.settings.iterative:
            # Twice: the first time builds the kernels.
            for _ in range(2):
                begin = time.perf_counter()
                self._formula(projections)
            return time.perf_counter() - begin
        solver, _ = self._solver(np.ascontiguousarray(projections[:, 0]))
        moments = [time.perf_counter() for _ in solver.run(1 + _TIMED_STEPS)]
        each = (moments[-1] - moments[0]) / max(len(moments) - 1, 1)
        # Steps that end early in the slices that are done do so in the others.
        return each * self.figures().get("steps", self.settings.most_steps)

    def _formula(self, projections: Floats) -> Floats:
        prepared, _ = self.source.for_formula(projections)
        A = self.projector(projections.shape[1])
        settings = self.settings
        rays = prepared.reshape(A.range)
        if settings.method == "backproject":
            slab = backproject(A, rays)
        else:
            slab = fbp(A, rays, settings.view_filter(), settings.compensate)
        return np.asarray(slab).reshape(-1, *A.domain[-2:])

    def _solver(self, sinogram: Floats) -> tuple[Solver, float]:
        """The method at its beginning, and the attenuation that its image is in units of."""
        settings = self.settings
        if settings.method == "levels":
            return self._few_levels(sinogram)
        A, options = self._seen_rays(sinogram)
        return least_squares(settings, A, sinogram, **options), 1.0

    def _few_levels(self, sinogram: Floats) -> tuple[Solver, float]:
        """One material in a disc of it: lengths of material are solved for, from 0 to 1."""
        A, scan, seen = self.projector(1), self.source.geometry, self.source.seen
        assert isinstance(scan, Parallel)
        disc = find_disc(sinogram, scan, seen=seen)
        material = material_lengths(sinogram, scan, disc, seen=seen)
        lengths = np.asarray(material.lengths, np.float32)
        weight = self.settings.weight
        solver = FewLevels(
            A,
            lengths,
            levels_weight(lengths) if weight is None else weight,
            support=disc.coverage(A.grid),
            weights=None if seen is None else seen.astype(np.float32),
            direction_weights=_direction_weights(scan.angles),
        )
        return solver, material.attenuation

    def _seen_rays(self, sinogram: Floats) -> tuple[LinearOperator, dict[str, Any]]:
        """The projector of the rays that were measured, and the solver's weights of them."""
        whole, seen = self.projector(1), self.source.seen
        if self.settings.weights is None:
            return (whole if seen is None else MeasuredRays(whole, seen)), {}
        weights = poisson_weights(sinogram).weights
        if seen is not None:
            weights[~seen] = 0
        return whole, {"weights": weights}

    def _projector(self, slices: int) -> AnyProjector:
        settings, device = self.settings, self.device
        if settings.iterative:
            grid, scan = self.window.around(self._width())[0], self.source.geometry
        else:
            grid, scan = self.window.grid(slices), self.source.formula_geometry()
        if isinstance(scan, Fan):
            return self._fan_projector(grid, scan)
        if settings.error is not None:
            # A whole lobe of the bins' spectrum, as cheapest_projector takes for solvers.
            lobes: Any = 1 if settings.iterative else "image"
            return FastProjector(grid, scan, settings.error, lobes=lobes, device=device)
        return cheapest_projector(
            grid,
            scan,
            iterative=settings.iterative,
            footprint=settings.footprint,
            device=device,
        )

    def _fan_projector(self, grid: Grid, scan: Fan) -> Projector:
        """The projector of a fan; of a detector of one row, that of a single slice."""
        if self.source.scan.shape[1] == 1:
            grid = Grid(grid.shape[-2:], grid.spacing[-2:], grid.center[-2:])
        footprint = self.settings.footprint
        options = {} if footprint is None else {"footprint": footprint}
        return Projector(grid, scan, device=self.device, **options)

    def _width(self) -> float:
        """What the rays meet: twice the way from the axis to the farther end of the detector."""
        scan = at_axis(self.source.geometry)
        reach = max(scan.center + 0.5, scan.bins - 0.5 - scan.center) + self.source.pad
        return float(2 * reach * scan.pitch)


def least_squares(
    settings: ReconstructSettings, A: LinearOperator, data: Floats, **options: Any
) -> Solver:
    """The solver of ``sirt``, ``cgls`` or ``tv`` at its beginning.

    Args:
        settings: the method and its options.
        A: the projector.
        data: line integrals.
        **options: further arguments of the solver, such as the weights of the rays.
    """
    options["noise"] = settings.noise
    if settings.method == "sirt" and settings.subsets not in (None, 1):
        subsets, nonnegative = settings.subsets, settings.nonnegative
        return OrderedSubsets(A, data, subsets, nonnegative=nonnegative, **options)
    options["precondition"] = settings.precondition
    if settings.method == "cgls":
        return Cgls(A, data, **options)
    options["nonnegative"] = settings.nonnegative
    if settings.method == "sirt":
        return Sirt(A, data, **options)
    weight = settings.weight
    if weight is None:
        weight = variation_weight(A, data, weights=options.get("weights"))
    return Pdhg(A, data, weight, **options)


def _direction_weights(angles: NDArray[np.float64]) -> DirectionWeights | None:
    """Less weight along directions that no view looks across; None where views go all round."""
    directions = np.sort(np.mod(angles, np.pi))
    gap = np.diff(directions, append=directions[0] + np.pi).max()
    return DirectionWeights.of(angles) if gap > _LIMITED else None


def levels_weight(sinogram: Floats) -> float:
    """A weight of the total variation for ``levels``, in the solver's unit.

    A disc of radius R and value u adds ``2 pi R u`` to the variation and, lowered by d,
    ``views * 4/3 * 2 R * (d R)^2`` or so to the data term: the weight that lowers features of a
    given number of bins by a given share goes with u, the views and the distance of bins. The
    greatest line integrals over half of the detector's width stand for u.
    """
    views, bins = sinogram.shape[0], sinogram.shape[-1]
    strong = float(np.percentile(np.abs(sinogram), 99))
    return float(_VARIATION * views * strong / (bins / 2))
