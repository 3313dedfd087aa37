"""The embedded radiance scene fitted by ``rift fit``, with splats of several kinds.

The small ornament that comes with the package, every eighth view held out. Each kind gets as many
splats as the same number of parameters buys, and is fitted twice: with the Gaussians' number of
steps, and with as many as take the Gaussians' time. Fits take turns between their reports. The
trainer's settings are those of Gaussians; nothing is tuned for a kind.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bases.plan import Plan
from bases.statistics import distinct, paired, sentence, spread, values
from bench.table import Table
from rift_cl import Device
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.report.plot import curves
from rift_cl.sample import ornament
from rift_cl.train.trainer import REPORT_EVERY

NAME = "radiance"
TITLE = "The embedded radiance scene, by the trainer"
BASELINE = "Gaussian, SH 1"
_MODAL = {"basis": "hermite", "sh_degree": 1}
KINDS: Mapping[str, Mapping[str, Any]] = {
    BASELINE: {"sh_degree": 1},
    "Gaussian, SH 3": {"sh_degree": 3},
    "HG 1, SH 1": {**_MODAL, "order": 1},
    "HG 1 exp, SH 1": {**_MODAL, "order": 1, "activation": "exp"},
    "HG 1 colour, SH 1": {**_MODAL, "order": 0, "color_order": 1},
    "HG 2, SH 1": {**_MODAL, "order": 2},
    "Gaussian, LG 8": {"angular": "lg", "modes": 8},
    "Gaussian, HG 8": {"angular": "hg", "modes": 8},
    "Gaussian, SG 3": {"angular": "sg", "modes": 3},
    "Gaussian, ASG 2": {"angular": "asg", "modes": 2},
}
_EQUAL = ("steps", "time")
# Steps in which all orders have joined.
_WARM_UP = 10
# A clock runs between reports, and the first one begins it.
_LEAST_STEPS = 2 * REPORT_EVERY


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    names = list(KINDS)
    return {
        **plan.settings(),
        "kinds": plan.of(tiny=names[:3:2], quick=[*names[:4], names[5], names[6]], full=names),
        "parameters": plan.of(tiny=2000, quick=20_000, full=120_000),
        "steps": plan.of(tiny=[_LEAST_STEPS], quick=[200], full=[600, 4000]),
        "downscale": plan.of(tiny=4, quick=2, full=1),
    }


@dataclass
class _Running:
    """A fit, how long its steps have taken, its last step, and how many were timed."""

    kind: str
    fit: Fit
    wall: float = 0.0
    cpu: float = 0.0
    step: int = 0
    timed: int = 0


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Every seed and length, at equal steps and then at equal time."""
    asked = settings(plan)
    wanted = [(seed, steps) for steps in asked["steps"] for seed in plan.seeds]
    done = {(run["seed"], run["steps"]) for run in kept["runs"]}
    each = len(_EQUAL) * len(asked["kinds"])
    result = {"total": len(wanted) * each, "runs": list(kept["runs"])}
    if any(case not in done for case in wanted):
        # Kernels of every kind and order are compiled before a clock runs.
        _fitted(asked, dict.fromkeys(asked["kinds"], _WARM_UP), plan.seeds[0], plan.device)
    for seed, steps in wanted:
        if (seed, steps) not in done:
            even = dict.fromkeys(asked["kinds"], steps)
            first = _fitted(asked, even, seed, plan.device)
            per_step = {run["basis"]: run["wall"] / steps for run in first}
            shares = {k: per_step[BASELINE] / per_step[k] for k in even}
            lengths = {k: max(_LEAST_STEPS, round(steps * share)) for k, share in shares.items()}
            del lengths[BASELINE]
            second = _fitted(asked, lengths, seed, plan.device)
            base = next(run for run in first if run["basis"] == BASELINE)
            for equal, runs in (("steps", first), ("time", [base, *second])):
                result["runs"] += [{**run, "equal": equal, "steps": steps} for run in runs]
        yield result


def _fitted(
    asked: Mapping[str, Any], lengths: Mapping[str, int], seed: int, device: str | None
) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        running = [
            _Running(kind, Fit(_settings(asked, kind, steps, seed, Path(folder), device)))
            for kind, steps in lengths.items()
        ]
        turns = [(one, one.fit.run()) for one in running]
        while turns:
            turns = [(one, reports) for one, reports in turns if _advance(one, reports)]
        return [_record(one, seed) for one in running]


def _advance(one: _Running, reports: Iterator[Any]) -> bool:
    """On to the next report; the clock runs between two of steps, not while pictures are read."""
    wall, cpu = time.perf_counter(), time.process_time()
    report = next(reports, None)
    step = 0 if report is None or "views" in report.what else report.done
    if step > one.step > 0:
        one.wall += time.perf_counter() - wall
        one.cpu += time.process_time() - cpu
        one.timed += step - one.step
    one.step = step
    return report is not None


def _settings(
    asked: Mapping[str, Any], kind: str, steps: int, seed: int, folder: Path, device: str | None
) -> FitPhotosSettings:
    given: dict[str, Any] = {
        "capture": ornament(),
        # The tables of docs/bases.md are of these.
        "preset": "0.1",
        "out": folder / kind.replace(" ", "_").replace(",", ""),
        "steps": steps,
        "seed": seed,
        "downscale": asked["downscale"],
        "device": device,
        **KINDS[kind],
    }
    numbers = FitPhotosSettings.of(**given).training.numbers
    return FitPhotosSettings.of(**given, splats=asked["parameters"] // numbers)


def _record(one: _Running, seed: int) -> dict[str, Any]:
    per_step = one.wall / max(1, one.timed)
    (scores,) = one.fit.metrics["scores"].values()
    training = one.fit.settings.training
    return {
        "basis": one.kind,
        "seed": seed,
        "taken": training.steps,
        "splats": one.fit.metrics["splats"],
        "parameters": one.fit.metrics["splats"] * training.numbers,
        "per_splat": training.numbers,
        "wall": per_step * training.steps,
        "wall_ms": 1e3 * per_step,
        "cpu_ms": 1e3 * one.cpu / max(1, one.timed),
        "psnr": scores["fit_psnr"],
        "ssim": scores["fit_ssim"],
    }


def tables(result: dict[str, Any]) -> Iterator[Table]:
    """One table for every length and way of being equal."""
    heads = ("kind", "a splat", "splats", "steps", "PSNR, dB", "SSIM", "ms a step", "processor ms")
    runs = result["runs"]
    for steps in distinct(runs, "steps"):
        for equal in _EQUAL:
            mine = [run for run in runs if run["steps"] == steps and run["equal"] == equal]
            rows = [
                [
                    kind,
                    *(f"{np.mean(values(mine, what, basis=kind)):.0f}"
                      for what in ("per_splat", "splats", "taken")),
                    spread(values(mine, "psnr", basis=kind)),
                    spread(values(mine, "ssim", basis=kind), ".4f"),
                    *(spread(values(mine, what, basis=kind), ".1f")
                      for what in ("wall_ms", "cpu_ms")),
                ]
                for kind in distinct(mine, "basis")
            ]  # fmt: skip
            title = f"Held-out views, {steps} steps of {BASELINE}, equal {equal}"
            yield Table(title, heads, rows, ["All have the same number of parameters."])


def pictures(result: dict[str, Any]) -> dict[str, tuple[Any, str]]:
    """PSNR against time, both lengths and both ways."""
    runs, series = result["runs"], {}
    for kind in distinct(runs, "basis"):
        mine = [run for run in runs if run["basis"] == kind]
        points = sorted((run["wall"], run["psnr"]) for run in mine)
        series[kind] = tuple(zip(*points, strict=True))
    figure = curves(series, xlabel="seconds of a fit", ylabel="held-out PSNR, dB", log_x=True)
    return {"time": (figure, "Held-out PSNR against the wall time of a fit")}


def verdicts(result: dict[str, Any]) -> list[str]:
    """Every kind against Gaussians in harmonics of degree one."""
    runs, said = result["runs"], []
    for steps in distinct(runs, "steps"):
        for equal in _EQUAL:
            mine = [run for run in runs if run["steps"] == steps and run["equal"] == equal]
            for kind in distinct(mine, "basis"):
                if kind != BASELINE:
                    gain = paired(mine, kind, BASELINE, what="psnr", keys=("seed",))
                    where = f"equal parameters and {equal} ({steps} steps)"
                    said.append(sentence(kind, BASELINE, gain, "dB", where))
    return said
