"""Fits scored on their way: after how many steps and seconds held-out photographs reach a score.

Seconds are those of the fit alone: of reading the photographs, placing the first splats and taking
steps. Scoring stops both clocks.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from rift_cl.metrics import psnr

# Scores in dB that are waited for.
GOALS = (30.0, 35.0, 40.0, 43.0)


@dataclass(frozen=True)
class FitCase:
    """What is fitted, the same for all who take part.

    Args:
        capture: with poses; every eighth photograph is held out.
        steps: of the fit.
        splats: most of them.
        every: steps between two scores.
        views: held-out photographs that are scored, evenly spaced.
        downscale: whole factor by which photographs are made smaller.
        seed: of the fit.
        preset: of ``rift fit photos``, where the version that fits knows it; None for its defaults.
    """

    capture: Path
    steps: int
    splats: int
    every: int
    views: int
    downscale: int
    seed: int
    preset: str | None = None

    @property
    def name(self) -> str:
        """How tables call it."""
        path = self.capture.resolve()
        path = path.parent if path.is_file() else path
        return f"{path.parent.name}/{path.name}, {self.splats} splats, {self.steps} steps"

    def job(self, device: str | None) -> Any:
        """The fit as the command would make it, by the version of the package that is there."""
        settings = import_module("rift_cl.commands.fit_photos.settings").FitPhotosSettings
        known = self.preset in getattr(settings, "presets", ())
        begun = settings.of(
            self.capture,
            Path("rift-bench-quality"),
            steps=self.steps,
            splats=self.splats,
            downscale=self.downscale,
            seed=self.seed,
            device=device,
            **({"preset": self.preset} if known else {}),
        )
        return import_module("rift_cl.commands.fit_photos.job").Fit(begun)


@dataclass(frozen=True)
class Moment:
    """A fit after some of its steps.

    Args:
        step: how many.
        cpu_s: processor seconds of all threads since the fit began.
        wall_s: seconds by the clock since then.
        psnr: mean over the scored photographs, dB.
    """

    step: int
    cpu_s: float
    wall_s: float
    psnr: float


@dataclass
class Clock:
    """Processor and wall time of what it ran, and of nothing else."""

    cpu_s: float = 0.0
    wall_s: float = 0.0

    def run(self, work: Callable[[], Any]) -> Any:
        """Do something while the clock goes."""
        cpu, wall = time.process_time(), time.perf_counter()
        found = work()
        self.cpu_s += time.process_time() - cpu
        self.wall_s += time.perf_counter() - wall
        return found


def moments(
    case: FitCase, device: str | None, turn: Callable[[], AbstractContextManager[Any]]
) -> Iterator[Moment]:
    """Fit, and score now and then.

    Args:
        case: what is fitted.
        device: selector of the device.
        turn: what holds while the version of the package works.

    Yields:
        What the first step gave, then each ``case.every`` steps, and the last.
    """
    clock = Clock()
    with turn():
        job, pictures, trainer = clock.run(lambda: _begun(case, device))
        unseen = scored_pictures(case, job, pictures)
        step = 0
        while step < case.steps:
            ahead = 1 if step == 0 else min(case.every - step % case.every, case.steps - step)
            clock.run(lambda ahead=ahead: _steps(trainer, ahead))
            step += ahead
            score = score_splats(trainer.renderer, trainer.parameters.drawn, unseen)
            yield Moment(step, clock.cpu_s, clock.wall_s, score)


def _begun(case: FitCase, device: str | None) -> tuple[Any, Any, Any]:
    """The fit, its photographs and its trainer before the first step."""
    job = case.job(device)
    pictures = job._pictures(job.training_views)
    trainer = job._trainer(job.source, pictures)
    for number in range(len(job.training_views)):
        if not pictures.keep(number):
            break
    job.device.finish()
    return job, pictures, trainer


def _steps(trainer: Any, count: int) -> None:
    for _ in range(count):
        trainer.step()
    trainer.device.finish()


def scored_pictures(case: FitCase, job: Any, like: Any) -> Any:
    """Held-out photographs of a fit, evenly spaced, over the background of those trained on."""
    views = job.test_views
    places = np.linspace(0, len(views) - 1, min(case.views, len(views))).round().astype(int)
    return job._pictures(tuple(views[place] for place in places.tolist()), like)


def score_splats(renderer: Any, splats: Any, unseen: Any) -> float:
    """Mean PSNR in dB of photographs, in display light.

    Args:
        renderer: that draws.
        splats: on its device.
        unseen: the photographs, as ``CapturePictures``.
    """
    behind = unseen.behind
    scores = []
    for number, camera in enumerate(unseen.cameras):
        frame = renderer.forward(splats, camera, background=renderer.device.array(behind))
        image = unseen.shown(renderer.device.get(frame.image))
        truth = unseen.shown(unseen.over(number, behind))
        scores.append(float(psnr(image, truth)))
    return float(np.mean(scores))


def record_of(who: str, found: Sequence[Moment]) -> dict[str, Any]:
    """A fit as JSON: all its moments, and the first at which each of ``GOALS`` was reached."""
    return {
        "who": who,
        "goals": [{"psnr": goal, **_reached(found, goal)} for goal in GOALS],
        "moments": [asdict(moment) for moment in found],
    }


def _reached(found: Sequence[Moment], goal: float) -> dict[str, Any]:
    first = next((moment for moment in found if moment.psnr >= goal), None)
    names = ("step", "cpu_s", "wall_s")
    return {name: None if first is None else getattr(first, name) for name in names}
