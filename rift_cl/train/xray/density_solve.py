"""Densities of X-ray splats by least squares, while Adam moves only what is not linear in them.

Line integrals are linear in densities and in densities times modes, so that for every geometry
there is a best choice, which needs no steps of an optimizer. Its residual is orthogonal to what the
splats can show: the loss, as a function of the geometry alone, has the partial gradient at fixed
coefficients (variable projection, Golub and Pereyra 1973; the shortened gradient is Kaufman's,
1975). Every few steps the coefficients are solved for by ridge least squares from some of the
views, beginning where they are, so that a few conjugate gradients are enough.
A density below zero is none: those that come out so are held at the least one, their modes at zero,
and the others are solved for once more. Since even that may end worse than it began, the change is
then halved until it does not.

All of it follows from the splats, the seed and the step, so that no checkpoint needs to know of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import put
from rift_cl.cl.reductions import dot
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.conjugate_gradients import Cgls, mean_diagonal
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays
from rift_cl.splat.renderer import Renderer
from rift_cl.train.parameters import Parameters
from rift_cl.train.xray.additive import Additive, Floats
from rift_cl.train.xray.solve_settings import SolveSettings

# The least density, as a share of the mean one: logarithms want more than zero.
_LEAST = 1e-3
# How much of a change is tried, by halves, before it is given up for raising the loss.
_TRIES = 4
# Squared norms below this share of the mean one count as that: what is hardly seen hardly moves.
_HARDLY_SEEN = 1e-4
# No density is smaller, so that it has a logarithm.
_TINY = float(np.finfo(np.float32).tiny)


class Views(Protocol):
    """What is solved for; see ``rift_cl.train.TrainingViews``."""

    cameras: Any

    def target(self, number: int) -> Any:
        """(height, width, 1) device array."""

    def weights(self, number: int) -> Any:
        """(height, width) device array, how much each pixel counts; None where all do."""


@dataclass(frozen=True, eq=False)
class DensityProblem:
    """The best coefficients (N, K, 1) that have no density below the least.

    Args:
        operator: coefficients to pictures (V, height, width, 1), times the roots of how much each
            pixel counts if they do not count alike.
        targets: device array, what these are to be, times the same roots.
        energies: (N,) about the squared norm of the pictures of each splat's constant.
        free: (N, K, 1) whether a coefficient is solved for.
        ridge: weight of the squared coefficients.
        least: density, above 0.
    """

    operator: LinearOperator
    targets: Any
    energies: Floats
    free: NDArray[np.bool_]
    ridge: float
    least: float

    def loss(self, c: Floats) -> float:
        """What is to be small: weighted squares of the residual, and the ridge."""
        device = self.operator.device
        coefficients = device.array(c, np.float32)
        error = self.operator(coefficients)
        axpby(device, -1.0, self.targets, 1.0, error)
        squares = dot(device, error, error)
        return squares + self.ridge * dot(device, coefficients, coefficients)

    def solved(self, start: Floats, iterations: int) -> Floats:
        """Coefficients of no larger loss than these, which keep to the least density."""
        before, found = self._solve(start, self.free, iterations)
        c = self._held(found)
        if c is found:
            return c
        _, found = self._solve(c, self.free & (c[:, :1] > self.least), iterations)
        c = self._held(found)
        for _ in range(_TRIES):
            if self.loss(c) <= before:
                return c
            c = (start + c) / 2
        return start

    def _solve(
        self, start: Floats, free: NDArray[np.bool_], iterations: int
    ) -> tuple[float, Floats]:
        """The loss before, and better coefficients."""
        energies = np.maximum(self.energies, max(_HARDLY_SEEN * self.energies.mean(), _TINY))
        solver = Cgls(
            self.operator,
            self.targets,
            start=start,
            ridge=self.ridge,
            diagonal=np.broadcast_to(energies[:, None, None], start.shape),
            free=free,
        )
        before = solver.loss
        for _ in solver.run(iterations):
            pass
        found = self.operator.device.get(solver.image).astype(np.float64)
        # What is held keeps the digits that a device does not.
        return before, np.where(free, found, start)

    def _held(self, c: Floats) -> Floats:
        """No density below the least, and no modes there; ``c`` itself if all are above."""
        faint = c[:, 0, 0] < self.least
        if not faint.any():
            return c
        held = c.copy()
        held[faint] = 0
        held[faint, 0] = self.least
        return held


def solve_densities(
    parameters: Parameters,
    renderer: Renderer,
    pictures: Views,
    settings: SolveSettings,
    *,
    seed: int,
) -> None:
    """Put densities and modes of the shape in the place of those that splats have.

    Adam's moments of both are zero afterwards.

    Args:
        parameters: the splats, which have densities.
        renderer: in xray mode.
        pictures: line integrals.
        settings: how well to solve.
        seed: of the draw of views, with the step.

    Raises:
        NonFiniteError: the pictures, or what is drawn, hold NaN or infinity.
    """
    numbers = _views(len(pictures.cameras), settings.views, (seed, parameters.step, 0x501))
    start, device = _coefficients(parameters), parameters.device
    cameras = [pictures.cameras[number] for number in numbers]
    operator = Additive(renderer, cameras, parameters.drawn, modes=start.shape[1])
    targets = device.empty(operator.range)
    for place, number in enumerate(numbers):
        put(device, pictures.target(number), targets, place)
    free = np.ones(start.shape, bool)
    if "shape_modes" in parameters.free:
        free[:, 1:, 0] = device.get(parameters.free["shape_modes"]) > 0
    problem = DensityProblem(
        _weighted(operator, targets, [pictures.weights(number) for number in numbers]),
        targets,
        operator.energies(),
        free,
        ridge=settings.ridge * mean_diagonal(operator),
        least=max(_LEAST * float(start[:, 0].mean()), _TINY),
    )
    _put(parameters, problem.solved(start, settings.iterations))


def _views(count: int, most: int, seed: tuple[int, ...]) -> NDArray[np.int64]:
    """All views, or as many of them as there may be."""
    return np.sort(np.random.default_rng(seed).permutation(count)[:most])


def _weighted(operator: Additive, targets: Any, weights: Sequence[Any]) -> LinearOperator:
    """The operator whose pixels count by their weights, if there are any; so do the targets then.

    Args:
        operator: coefficients to V pictures.
        targets: device array of the pictures; multiplied in place.
        weights: (height, width) device array of each picture, or None where all pixels count.
    """
    if all(each is None for each in weights):
        return operator
    host = np.ones(operator.range)
    for row, each in zip(host, weights, strict=True):
        if each is not None:
            row[...] = operator.device.get(each)[..., None]
    weighted = WeightedRays(operator, host)
    weighted.weigh(targets)
    return weighted


def _coefficients(parameters: Parameters) -> Floats:
    """(N, K, 1): densities as they are drawn, and densities times modes."""
    get, raw = parameters.device.get, parameters.raw
    drawn = get(parameters.drawn.opacities).astype(np.float64)
    densities: Floats = np.maximum(drawn, _TINY)[:, None, None]
    if "shape_modes" not in raw:
        return densities
    modes = get(raw["shape_modes"]).astype(float)[..., None]
    return np.concatenate([densities, densities * modes], axis=1)


def _put(parameters: Parameters, c: Floats) -> None:
    device, raw = parameters.device, parameters.raw
    logarithms = np.log(c[:, 0, 0])
    if parameters.band is not None and parameters.drawn.scales is not None:
        # What the band's limit takes of a density when it is drawn, the wider splat has not lost.
        scales = device.get(parameters.drawn.scales).astype(float)
        logarithms += np.log(scales).sum(axis=1) - device.get(raw["log_scales"]).sum(axis=1)
    raw["logits"] = device.array(logarithms.astype(np.float32))
    if "shape_modes" in raw:
        modes = c[:, 1:, 0] / c[:, :1, 0]
        raw["shape_modes"] = device.array(np.ascontiguousarray(modes, np.float32))
    for name in (name for name in ("logits", "shape_modes") if name in raw):
        for moments in (parameters.first, parameters.second):
            moments[name] = device.zeros(raw[name].shape)
    parameters.redraw()
