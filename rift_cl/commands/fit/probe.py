"""What a fit will take, from a few of its steps: what ``rift fit --dry-run`` says.

Steps are taken as at the beginning of the fit and as at its end, where the splats are many, all
harmonics and modes have joined, and each splat is smaller for its number. Between the two, and
beyond the number of splats that is tried, time is taken to grow evenly with their number. Nothing
is written, and the fit itself begins as if nothing had been tried.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from statistics import median

import numpy as np

from rift_cl.splat.bands import FrameMemory
from rift_cl.train.parameters import Parameters
from rift_cl.train.trainer import Trainer

# Steps that are taken before the clock runs, in which kernels are built, and those that are timed.
_WARM, _TIMED = 2, 5
# Most splats that are tried.
TRIED = 20_000
# Views whose tile lists are counted.
_VIEWS = 4


@dataclass(frozen=True)
class Probe:
    """Times and sizes of a few steps.

    Args:
        counts: splats at the beginning, and of the steps that are like the last.
        seconds: of a step with so many.
        entries: (splat, tile) pairs of a frame for each splat, of the later steps.
    """

    counts: tuple[int, int]
    seconds: tuple[float, float]
    entries: float

    def step(self, splats: int) -> float:
        """Seconds of one step with a number of splats."""
        (few, many), (quick, slow) = self.counts, self.seconds
        if many <= few:
            return slow * max(1.0, splats / many)
        return quick + max(slow - quick, 0.0) * (splats - few) / (many - few)

    def steps(self, ahead: Iterable[tuple[int, int]]) -> float:
        """Seconds of steps with changing numbers of splats; see ``Strategy.forecast``."""
        return sum(steps * self.step(count) for steps, count in ahead)

    def lists(self, frame: FrameMemory, tile: int) -> int:
        """Bytes of a frame's tile lists, by tile edge in pixels."""
        return frame.lists(round(self.entries * frame.splats), -(-frame.pixels // tile**2))


def probed(trainer: Trainer, most: int, clock: Callable[[], float] = time.perf_counter) -> Probe:
    """Take a few steps of a fit that has not begun; the trainer is of no use afterwards.

    Args:
        trainer: before its first step.
        most: splats that the fit will have in the end.
        clock: seconds.
    """
    first, late = len(trainer.parameters), _late(trainer, most)
    many = len(late.parameters)
    each, slow = _entries(late) / many, _seconds(late, clock)
    if first >= many:
        return Probe((many, many), (slow, slow), each)
    return Probe((first, many), (_seconds(trainer, clock), slow), each)


def time_words(seconds: float) -> str:
    """A time in words; steps change their pace as splats find their sizes, and so it is rough."""
    return f"about {float(f'{seconds:.2g}'):g} s, give or take a half, from a few steps"


def _late(trainer: Trainer, most: int) -> Trainer:
    """A fit of the same pictures that stands before its last steps."""
    settings, early = trainer.settings, trainer.parameters
    few, many = len(early), max(1, min(most, TRIED))
    raw, _, _ = early.host()
    raw = {
        name: np.ascontiguousarray(values[np.arange(many) % few]) for name, values in raw.items()
    }
    # As many splats more fill the same space.
    raw["log_scales"] -= np.float32(np.log(max(many / few, 1.0)) / 3)
    parameters = Parameters.of(
        trainer.device,
        raw,
        step=max(settings.steps - _WARM - _TIMED - 1, 0),
        density=early.density,
        amplitude=early.amplitude,
        environment=early.environment,
    )
    if settings.angular.kind == "sh":
        while int(np.sqrt(parameters.raw["sh"].shape[1])) - 1 < settings.degree:
            parameters.add_degree()
    return trainer.alike(parameters)


def _seconds(trainer: Trainer, clock: Callable[[], float]) -> float:
    """Of one step: the median, since other programs only ever make one longer."""
    times = []
    for number in range(_WARM + _TIMED):
        begin = clock()
        trainer.step()
        trainer.device.finish()
        if number >= _WARM:
            times.append(clock() - begin)
    return median(times)


def _entries(trainer: Trainer) -> int:
    """(splat, tile) pairs of the fullest of a few frames."""
    pictures, found = trainer.pictures, 0
    for step in range(min(_VIEWS, len(pictures.cameras))):
        number = trainer.view_at(step)
        pictures.begin(step)
        frame = trainer.renderer.forward(
            trainer.parameters.drawn,
            trainer.camera(number),
            background=pictures.background(number),
        )
        found = max(found, frame.lists.n_entries if frame.lists is not None else 0)
    return found
