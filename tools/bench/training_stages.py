"""Where the time of a step of training goes, on the device and on the host.

Kernels are timed one by one, with a wait after each launch, over passes that look at every view
once, so that passes can be compared. What the host does is measured in steps that nobody disturbs:
its own processor time, and each wait for the device.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any
from unittest import mock

import numpy as np

from bench.costs import CoverageError
from bench.operations import each_launch
from bench.timing import summary, timed
from bench.training_case import VIEWS, TrainingCase
from bench.waits import Wait, each_wait
from rift_cl.train import (
    Homogenisation,
    LearningRates,
    McmcSettings,
    Parameters,
    Trainer,
    TrainingViews,
)
from rift_cl.train.strategy.mcmc import relocate

_STAGES = {
    "project and shade": ("splat_project", "splat_shade", "light_lobes", "light_shade"),
    "tile lists": ("tile_", "radix_", "scan_"),
    "raster": ("splat_pack", "splat_raster_cpu", "splat_raster_gpu"),
    "exposure": ("expose", "expose_grad", "expose_moments"),
    "loss": ("ssim_map", "loss_grad", "sum_columns"),
    "homogenisation": ("fft_", "keep_norm", "axpby"),
    "raster gradient": (
        "splat_raster_grad_cpu",
        "splat_raster_grad_gpu",
        "slot_",
        "splat_sum_slots",
    ),
    "projection gradient": ("splat_project_grad",),
    "shading gradient and Adam": ("splat_shade_grad", "light_shade_grad", "light_grad", "adam"),
    "Adam and activation": ("splat_update", "splat_activate"),
    "random walk": ("splat_noise",),
}
DECODING, UPLOAD = "decoding of the picture", "upload"
# Share of the splats that have faded when the price of a relocation is taken.
_FADED, _FADED_LOGIT = 0.05, -7.0
# Fits of more than splats, whose waits are looked at as well.
_REFINED = LearningRates(pose_reach=1e-3)


def stage_of(kernel: str) -> str:
    """The stage that a kernel belongs to.

    Raises:
        CoverageError: to none: a new kernel has to be given one here.
    """
    for stage, names in _STAGES.items():
        if any(
            kernel == name or (name.endswith("_") and kernel.startswith(name)) for name in names
        ):
            return stage
    raise CoverageError(f"kernel {kernel} belongs to no stage of training: name one in {__file__}")


@dataclass
class Stages:
    """Seconds of one way to train, one number for each pass; launches in one pass.

    Args:
        launches: by kernel.
        kernels: by kernel.
        host: decoding and uploads.
        total: the whole pass.
    """

    launches: Counter[str] = field(default_factory=Counter)
    kernels: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    host: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    total: list[float] = field(default_factory=list)

    def record(self) -> dict[str, Any]:
        """The JSON record, of one step on average: stages with their kernels, and the rest."""
        names = [*_STAGES, DECODING, UPLOAD]
        rows = [
            *((stage_of(kernel), kernel, times) for kernel, times in self.kernels.items()),
            *((stage, None, times) for stage, times in self.host.items()),
        ]
        rows.sort(key=lambda row: names.index(row[0]))
        rest = np.array(self.total) - np.sum([times for _, _, times in rows], axis=0)
        rows.append(("the rest", None, rest.tolist()))
        whole = sum(min(times) for _, _, times in rows)
        return {
            "total": summary(_per_step(self.total)),
            "rows": [
                {
                    "stage": stage,
                    "kernel": kernel,
                    "launches": self.launches[kernel] / VIEWS if kernel else None,
                    **summary(_per_step(times)),
                    "share": min(times) / whole,
                }
                for stage, kernel, times in rows
            ],
        }


def ways(case: TrainingCase) -> dict[str, Trainer]:
    """The ways to train whose stages are measured: the plain one, and homogenised."""
    homogenised = replace(case.settings, homogenisation=Homogenisation(0.5))
    return {"plain": case.trainer(), "homogenised": case.trainer(homogenised)}


def stages(trainer: Trainer, *, passes: int) -> dict[str, Any]:
    """The record of a number of passes with a wait after each launch, after one without."""
    found = Stages()
    _pass(trainer)
    for _ in range(passes):
        with _each_part(trainer) as log:
            found.total.append(timed(lambda: _pass(trainer))[0])
        launched = [name for name, _ in log if name not in (DECODING, UPLOAD)]
        found.launches = Counter(launched)
        for part in dict.fromkeys(name for name, _ in log):
            seconds = sum(time for name, time in log if name == part)
            where = found.kernels if part in found.launches else found.host
            where[part].append(seconds)
    return found.record()


@contextmanager
def _each_part(trainer: Trainer) -> Iterator[list[tuple[str, float]]]:
    """Time kernels, uploads and the decoding of pictures: (name, seconds) each."""
    device, pictures = trainer.device, trainer.pictures
    sent = device.array
    with each_launch(device) as log:

        def array(host: Any) -> Any:
            seconds, result = timed(lambda: sent(host))
            log.append((UPLOAD, seconds))
            return result

        timing = _Decoding(pictures, log)
        with (
            mock.patch.object(device, "array", array),
            mock.patch.object(trainer, "pictures", timing),
        ):
            yield log


class _Decoding:
    """Pictures whose decoding is timed, uploads and waits left out."""

    def __init__(self, pictures: TrainingViews, log: list[tuple[str, float]]) -> None:
        self._pictures, self._log = pictures, log

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._pictures, name)
        return self._timed(found) if callable(found) else found

    def _timed(self, run: Callable[[int], Any]) -> Callable[[int], Any]:
        def call(number: int) -> Any:
            before = len(self._log)
            seconds, result = timed(lambda: run(number))
            sent = sum(time for _, time in self._log[before:])
            self._log.append((DECODING, seconds - sent))
            return result

        return call


def host_work(case: TrainingCase, *, passes: int) -> dict[str, Any]:
    """What the host does in a step that nobody disturbs: its processor time, and its waits.

    Waits are those of plain steps, and for what poses and exposures ask when they are fitted too.
    """
    refined = case.trainer(
        replace(case.settings, learning_rates=_REFINED, refine_poses=True, refine_exposures=True)
    )
    plain = case.trainer()
    _pass(plain)
    busy, whole = [], []
    for _ in range(passes):
        before = time.thread_time()
        whole.append(timed(lambda: _pass(plain))[0])
        busy.append(time.thread_time() - before)
    _pass(refined)
    return {
        "step": summary(_per_step(whole)),
        "host": summary(_per_step(busy)),
        "waits": {"plain": _waits(plain), "poses and exposures": _waits(refined)},
    }


def relocation_price(case: TrainingCase, *, passes: int) -> dict[str, Any]:
    """What a relocation takes on the host where a share of the splats has faded, and of a step."""
    settings, faded = McmcSettings(), int(_FADED * len(case.raw["means"]))
    logits = case.raw["logits"].copy()
    logits[:faded] = _FADED_LOGIT
    parameters = Parameters.of(case.device, {**case.raw, "logits": logits})

    def run() -> None:
        relocate(parameters, min_opacity=settings.min_opacity, most=case.count, seed=0, growth=0.0)
        case.device.finish()

    run()
    times = [timed(run)[0] for _ in range(passes)]
    return {"faded": faded, "every": settings.every, **summary(times)}


def _pass(trainer: Trainer) -> None:
    for _ in range(VIEWS):
        trainer.step()
    trainer.device.finish()


def _waits(trainer: Trainer) -> list[dict[str, Any]]:
    """The waits of one pass, by place, without that at its end."""
    with each_wait() as log:
        for _ in range(VIEWS):
            trainer.step()
    trainer.device.finish()
    by_place: Mapping[tuple[str, str, str], list[Wait]] = defaultdict(list)
    for wait in log:
        by_place[wait.kind, wait.place, wait.function].append(wait)
    return [
        {
            "kind": kind,
            "place": place,
            "function": function,
            "per_step": len(found) / VIEWS,
            "bytes": found[-1].bytes,
            "seconds": sum(wait.seconds for wait in found) / VIEWS,
        }
        for (kind, place, function), found in by_place.items()
    ]


def _per_step(seconds: Sequence[float]) -> list[float]:
    return [value / VIEWS for value in seconds]
