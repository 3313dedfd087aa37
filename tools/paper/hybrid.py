"""The hybrid that the paper names as future work: splats, and a network for what they leave over.

Four models learn the same views of the ornament in the same processor time: splats with lobes,
splats with lobes that reflect a light in common, splats with lobes whose rest one small network
decodes (``paper.decoded_rest``), and a small radiance field (``paper.small_field``). How many steps
each kind of splats gets follows from the time of its first ones.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from paper.coordinate_network import torch_is_missing
from paper.field_bias import draw_curves, field_fit, moments_table
from paper.fits import fit_settings
from paper.moments import start
from paper.plan import Plan
from paper.unseen_views import UnseenViews, field_moments, splat_moments
from rift_cl import Device
from rift_cl.report.html_page import Page
from rift_cl.train import Trainer

NAME = "hybrid"
TITLE = "A network for what splats leave over"
PLAIN, LIGHT, NETWORK, FIELD = "splats", "splats, light", "splats, network", "field"
_PRESET = "lobes"
# Steps of the fits that kernels are compiled by, and of those that are timed.
_WARM, _TIMED = 12, 60


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result, but for the speed of the machine."""
    return {**plan.size(), **plan.fits(), "preset": _PRESET, "views": max(plan.counts)}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Scores and spectra of every model; those with networks are left out without torch."""
    scene = _Scene(plan, device)
    runs = {run["model"]: run for run in kept.get("runs", [])}
    found: list[dict[str, Any]] = []
    result = {
        "frequency": scene.views.frequency.tolist(),
        "views": max(plan.counts),
        "runs": found,
    }
    models = [PLAIN, LIGHT] if torch_is_missing() else [PLAIN, LIGHT, NETWORK, FIELD]
    each = 0.0
    for model in models:
        if model not in runs:
            each = each or _seconds(scene, PLAIN)
            budget = found[0]["moments"][-1]["cpu_s"] if found else 0.0
            with _threads(model):
                runs[model] = {"model": model, "moments": list(_run(scene, model, each, budget))}
        found.append(runs[model])
        yield result


def _threads(model: str) -> AbstractContextManager[None]:
    """One thread for torch: those that wait beside the driver's count as processor time, too."""
    if model not in (NETWORK, FIELD):
        return nullcontext()
    from bench.torch_tiles import on_threads

    return on_threads(1)


class _Fit(NamedTuple):
    """A fit before its first step, and how it is drawn where its renderer alone does not do."""

    trainer: Trainer
    draw: Callable[..., Any] | None


class _Scene:
    """What is fitted, and photographs that no model sees.

    Args:
        plan: of the figures.
        device: where to work.
    """

    def __init__(self, plan: Plan, device: Device) -> None:
        self.plan, self.device = plan, device
        self.asked = fit_settings(plan, max(plan.counts), seed=plan.seeds[0], preset=_PRESET)
        trainer, self.pictures = start(self.asked, device)
        means = device.get(trainer.parameters.drawn.means)
        self.box = means.min(axis=0), means.max(axis=0)
        self.views = UnseenViews(device, self.asked.test[1:], self.pictures, 12 if plan.full else 1)

    def begun(self, model: str, steps: int) -> _Fit:
        """A fit of so many steps before its first one."""
        training = replace(self.asked.training, steps=steps)
        if model == LIGHT:
            environment = replace(training.environment, kind="shared")
            training = replace(training, environment=environment)
        trainer, _ = start(replace(self.asked, training=training), self.device)
        if model != NETWORK:
            return _Fit(trainer, None)
        import torch

        from paper.decoded_rest import DecodedTrainer, RestNetwork
        from paper.small_field import QUICK

        torch.manual_seed(self.plan.seeds[0])
        decoded = DecodedTrainer(trainer, RestNetwork(QUICK, self.box))
        return _Fit(decoded, decoded.picture)


def _run(scene: _Scene, model: str, each: float, budget: float) -> Iterator[dict[str, Any]]:
    """The moments of a model, in the time of the plan's steps of plain splats."""
    if model == FIELD:
        fit = field_fit(scene.plan, scene.pictures, scene.box, None, ramp=False)
        yield from field_moments(fit, budget, scene.views)
        return
    steps = scene.plan.steps
    if model != PLAIN:
        steps = max(1, round(steps * each / _seconds(scene, model)))
    begun = scene.begun(model, steps)
    yield from splat_moments(begun.trainer, scene.views, begun.draw)


def _seconds(scene: _Scene, model: str) -> float:
    """Processor seconds of a step of the first ones, once all kernels are there."""
    steps = scene.plan.steps
    warm = scene.begun(model, min(steps, _WARM)).trainer
    while warm.parameters.step < warm.settings.steps:
        warm.step()
    timed = scene.begun(model, steps).trainer
    scene.device.finish()
    began = time.process_time()
    while timed.parameters.step < min(steps, _TIMED):
        timed.step()
    scene.device.finish()
    return (time.process_time() - began) / timed.parameters.step


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the spectra, and the table."""
    page.paragraph(
        f"{result['views']} views of the ornament, and the processor time that splats with lobes "
        "took for all of them; power of the error over that of the photographs, by frequency."
    )
    for group in ("ring", "off the ring"):
        words = f"Relative error at the end of unseen photographs: {group}."
        series = {
            run["model"]: (
                result["frequency"],
                10 * np.log10(run["moments"][-1][group]["error"]),
            )
            for run in result["runs"]
        }
        draw_curves(page, series, "error / truth, dB", words)
    moments_table(page, result["runs"])
    page.paragraph(
        "Not claimed: that no network would help. This one is small and in plain torch; one seed, "
        "one scene."
    )
