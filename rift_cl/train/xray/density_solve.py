"""Densities of X-ray splats by least squares, while Adam moves only what is not linear in them.

Line integrals are linear in densities and in densities times modes. Now and then these are solved
for from a draw of the views, beginning where they are (``rift_cl.train.xray.variable_projection``).
A density below zero is none: those that come out so are held at the least one, their modes at zero,
and the others are solved for once more. Since even that may end worse than it began, the change is
then halved until it does not.

All of it follows from the splats, the seed and the step, so that no checkpoint needs to know of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.splat.renderer import Renderer
from rift_cl.train.parameters import Parameters
from rift_cl.train.xray.additive import Additive, Floats
from rift_cl.train.xray.solve_settings import SolveSettings
from rift_cl.train.xray.variable_projection import Solution, mean_curvature, solve

# The least density, as a share of the mean one: logarithms want more than zero.
_LEAST = 1e-3
# How much of a change is tried, by halves, before it is given up for raising the loss.
_TRIES = 4
# Squared norms below this share of the mean one count as that: what is hardly seen hardly moves.
_HARDLY_SEEN = 1e-4
# No density is smaller, so that it has a logarithm.
_TINY = float(np.finfo(np.float32).tiny)


class Views(Protocol):
    """What is solved for; see ``rift_cl.train.trainer.Pictures``."""

    cameras: Any

    def target(self, number: int) -> Any:
        """(height, width, 1) device array."""

    def weights(self, number: int) -> Any:
        """(height, width) device array, how much each pixel counts; None where all do."""


@dataclass(frozen=True, eq=False)
class DensityProblem:
    """The best coefficients (N, K, 1) that have no density below the least.

    Args:
        operator: coefficients to pictures.
        targets: (V, height, width, 1) what they are to be.
        roots: (V, height, width, 1) square roots of how much each pixel counts; 1 where all do.
        free: (N, K, 1) whether a coefficient is solved for.
        ridge: weight of the squared coefficients.
        least: density, above 0.
    """

    operator: Additive
    targets: Floats
    roots: Floats | float
    free: NDArray[np.bool_]
    ridge: float
    least: float

    def loss(self, c: Floats) -> float:
        """What is to be small: weighted squares of the residual, and the ridge."""
        error = self._render(c) - self.roots * self.targets
        return float(np.vdot(error, error) + self.ridge * np.vdot(c, c))

    def solved(self, start: Floats, iterations: int) -> Floats:
        """Coefficients of no larger loss than these, which keep to the least density."""
        energies = self.operator.energies()
        energies = np.maximum(energies, max(_HARDLY_SEEN * energies.mean(), _TINY))
        diagonal = np.broadcast_to(energies[:, None, None], start.shape)
        first = self._solve(start, self.free, diagonal, iterations)
        c = self._held(first.coefficients)
        if c is first.coefficients:
            return c
        free = self.free & (c[:, :1] > self.least)
        c = self._held(self._solve(c, free, diagonal, iterations).coefficients)
        for _ in range(_TRIES):
            if self.loss(c) <= first.loss_before:
                return c
            c = (start + c) / 2
        return start

    def _solve(
        self, start: Floats, free: NDArray[np.bool_], diagonal: Floats, iterations: int
    ) -> Solution:
        return solve(
            self._render,
            lambda pictures: self.operator.adjoint(self.roots * pictures),
            self.roots * self.targets,
            ridge=self.ridge,
            iterations=iterations,
            start=start,
            diagonal=diagonal,
            free=free,
        )

    def _render(self, c: Floats) -> Floats:
        return np.asarray(self.roots * self.operator.render(c))

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
    start, get = _coefficients(parameters), parameters.device.get
    cameras = [pictures.cameras[number] for number in numbers]
    operator = Additive(renderer, cameras, parameters.drawn, modes=start.shape[1])
    targets = np.stack([get(pictures.target(k)).astype(float) for k in numbers])
    free = np.ones(start.shape, bool)
    if "shape_modes" in parameters.free:
        free[:, 1:, 0] = get(parameters.free["shape_modes"]) > 0
    problem = DensityProblem(
        operator,
        targets,
        _roots(parameters, pictures, numbers, targets.shape),
        free,
        ridge=settings.ridge * mean_curvature(operator.render, operator.shape),
        least=max(_LEAST * float(start[:, 0].mean()), _TINY),
    )
    _put(parameters, problem.solved(start, settings.iterations))


def _views(count: int, most: int, seed: tuple[int, ...]) -> NDArray[np.int64]:
    """All views, or as many of them as there may be."""
    return np.sort(np.random.default_rng(seed).permutation(count)[:most])


def _roots(
    parameters: Parameters, pictures: Views, numbers: NDArray[np.int64], shape: tuple[int, ...]
) -> Floats | float:
    weights = [pictures.weights(number) for number in numbers]
    if all(each is None for each in weights):
        return 1.0
    found = np.ones(shape)
    for row, each in zip(found, weights, strict=True):
        if each is not None:
            row[...] = np.sqrt(parameters.device.get(each).astype(float))[..., None]
    return found


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
