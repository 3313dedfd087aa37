"""A fit of additive splats: geometry by Adam, all coefficients by ridge least squares inside it.

Each step places the splats, solves for the coefficients by a few conjugate gradients from the last
ones (``rift_cl.reconstruct.Cgls``) or exactly (``bases.exact``), and moves means,
rotations and scales along the gradient at those coefficients. Bases differ in nothing but their
modes and the number of splats that a budget buys: they start from the first of the same places, at
a size that fills the gaps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bases.additive import Floats, Geometry, Placed
from bases.exact import solved
from bases.mode_sets import ModeSet, seen_gram
from rift_cl.geometry import Camera
from rift_cl.reconstruct import Cgls, mean_diagonal
from rift_cl.splat import Renderer
from rift_cl.train.per_view.host_adam import HostAdam

# Steps of means in widths of the first splats, of quaternions, of logarithms of scales.
RATES = (0.08, 0.03, 0.04)
# After so many steps rates have fallen to a half; as one over one plus their share.
HALF_LIFE = 120.0
RIDGE = 1e-5
# How many times the conjugate gradients of a later step the first one takes.
FIRST = 3
# In place of a number of conjugate gradients.
EXACT = 0


@dataclass(frozen=True, eq=False)
class Task:
    """What is fitted, whatever the basis.

    Args:
        renderer: draws.
        cameras: the views.
        targets: (V, height, width, C) what they see.
        free: (10,) 1 for numbers of ``Geometry.flat`` that move, 0 for the others.
        start: N to the geometry that N splats begin with.
        smallest: least scale.
        largest: largest scale.
        score: PSNR in dB of a geometry, its coefficients and the residual.
        screens: projections of a round splat by which modes are made orthonormal.
        power: of a splat's volume that the squared norm of its pictures goes by.
        stack: slices that have nothing to do with each other, a row of the pictures each.
    """

    renderer: Renderer
    cameras: Sequence[Camera]
    targets: Floats
    free: Floats
    start: Callable[[int], Geometry]
    smallest: float
    largest: float
    score: Callable[[Geometry, ModeSet, Floats, Floats], dict[str, float]]
    screens: Sequence[Floats]
    power: float
    stack: int = 1


@dataclass(eq=False)
class AdditiveFit:
    """A fit in progress.

    Args:
        task: what is fitted.
        modes: of the basis.
        splats: how many.
        solve: conjugate gradients of each step; the first one takes three times as many. ``EXACT``
            solves the normal equations.
    """

    task: Task
    modes: ModeSet
    splats: int
    solve: int = 4
    steps: int = 0
    wall: float = 0.0
    cpu: float = 0.0
    history: list[dict[str, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Place the splats."""
        self._solved = self.modes.even(seen_gram(self.modes.order, self.task.screens))
        start = self.task.start(self.splats)
        self._numbers = start.flat()
        width = float(np.exp(start.log_scales[:, 0]).mean())
        self._rates = np.repeat(np.array(RATES) * (width, 1, 1), (3, 4, 3)) * self.task.free
        self._adam = HostAdam((1, *self._numbers.shape))
        self._c = np.zeros((self.splats, self.modes.count, self.task.targets.shape[-1]))
        self._ridge = 0.0
        self.pairs = 0.0
        # Kernels are compiled before a clock runs; what they find is forgotten.
        self._residual, _ = self._passes(1)
        self._c[...] = 0

    @property
    def geometry(self) -> Geometry:
        """Where the splats are."""
        return Geometry.of_flat(self._numbers)

    def step(self) -> None:
        """Solve, then move; the clocks of this fit run."""
        wall, cpu = time.perf_counter(), time.process_time()
        first = self.steps == 0
        self._residual, gradient = self._passes(FIRST * self.solve if first else self.solve)
        self.steps += 1
        slower = 1 / (1 + self.steps / HALF_LIFE)
        moved = self._numbers - self._adam.step(0, gradient, slower * self._rates)
        limits = np.log([self.task.smallest, self.task.largest])
        free = self.task.free[7:] > 0
        moved[:, 7:][:, free] = moved[:, 7:][:, free].clip(*limits)
        self._placed_numbers, self._numbers = self._numbers, Geometry.of_flat(moved).flat()
        self.wall += time.perf_counter() - wall
        self.cpu += time.process_time() - cpu

    def _passes(self, iterations: int) -> tuple[Floats, Floats]:
        task = self.task
        channels = task.targets.shape[-1]
        placed = Placed(task.renderer, task.cameras, self._solved, self.geometry, channels)
        if not self._ridge:
            self._ridge = RIDGE * mean_diagonal(placed)
        residual = self._solve(placed, iterations)
        self.pairs = placed.pairs_per_pixel()
        return residual, placed.geometry_gradient(self._c, -residual)

    def _solve(self, placed: Placed, iterations: int) -> Floats:
        """Put better coefficients in the place of these; their residual."""
        task = self.task
        if self.solve == EXACT:
            self._c = solved(placed, task.targets, self._ridge, task.stack)
            return task.targets - placed.render(self._c)
        solver = Cgls(
            placed,
            task.targets,
            ridge=self._ridge,
            start=self._c,
            diagonal=self._diagonal(),
        )
        for _ in solver.run(iterations):
            pass
        get = placed.device.get
        self._c = get(solver.image).astype(np.float64)
        return -get(solver.residual).astype(np.float64)

    def _diagonal(self) -> Floats:
        """How strongly coefficients show, by the size of their splats."""
        sizes = self._numbers[:, 7:][:, self.task.free[7:] > 0].sum(axis=1)
        shares = np.exp(self.task.power * (sizes - sizes.mean()))
        return np.broadcast_to(shares[:, None, None], self._c.shape).copy()

    def score(self) -> None:
        """Note where the fit stands, off the clock."""
        placed = Geometry.of_flat(self._placed_numbers)
        scores = self.task.score(placed, self._solved, self._c, self._residual)
        self.history.append({"step": self.steps, "wall": self.wall, "cpu": self.cpu, **scores})


def psnr(error: Floats, peak: float = 1.0) -> float:
    """In dB, of errors against a peak."""
    return float(10 * np.log10(peak**2 / np.mean(np.square(error))))


def race(fits: Sequence[AdditiveFit], marks: Sequence[int]) -> None:
    """Run fits step by step in turns, and score all of them after these steps."""
    for step in range(1, max(marks) + 1):
        for fit in fits:
            fit.step()
        if step in marks:
            for fit in fits:
                fit.score()


def at_time(history: Sequence[dict[str, float]], seconds: float, clock: str, what: str) -> float:
    """A figure of a fit by the time it had run so long, between its scores by interpolation.

    A fit that was done by then counts with what it had.
    """
    times = [0.0, *(mark[clock] for mark in history)]
    values = [history[0][what], *(mark[what] for mark in history)]
    return float(np.interp(seconds, times, values))


def record(fit: AdditiveFit, **keys: Any) -> dict[str, Any]:
    """A finished fit as JSON."""
    channels = fit.task.targets.shape[-1]
    return {
        "basis": fit.modes.name,
        **keys,
        "solve": fit.solve,
        "splats": fit.splats,
        "parameters": fit.splats * fit.modes.parameters(channels),
        "per_splat": fit.modes.parameters(channels),
        "wall_ms": 1e3 * fit.wall / fit.steps,
        "cpu_ms": 1e3 * fit.cpu / fit.steps,
        "pairs": fit.pairs,
        "history": fit.history,
    }
