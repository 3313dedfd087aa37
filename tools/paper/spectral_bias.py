"""Spectral bias: what a ramp on the residual's frequencies changes, in scores and in spectra."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from paper.fits import FIXED, OFF_PATH, fit_settings, fitted
from paper.moments import watched
from paper.plan import Plan
from rift_cl import Device
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_png

NAME = "spectral_bias"
TITLE = "Spectral bias: fits with and without homogenisation"
EXPONENTS = (0.0, 0.5)

_SCORES = {
    "ring PSNR": (FIXED, "fit_psnr"),
    "foreground": (FIXED, "fit_psnr_foreground"),
    "SSIM": (FIXED, "fit_ssim"),
    "off PSNR": (OFF_PATH, "fit_psnr"),
    "off foreground": (OFF_PATH, "fit_psnr_foreground"),
    "off SSIM": (OFF_PATH, "fit_ssim"),
}
# What a run is of.
_OF = ("count", "noise", "exponent", "seed")
_XLABEL = "spatial frequency, cycles per pixel"


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {**plan.size(), **plan.fits()}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The scores at every number of views, then spectra during the training with the most."""
    most = max(plan.counts)
    earlier = {_key(run): run for run in kept.get("spectra", []) + kept.get("scores", [])}
    scores: list[dict[str, Any]] = []
    for count, noise in itertools.product(plan.counts, plan.noises):
        for exponent, seed in _runs(plan):
            run = earlier.get(("scores", count, noise, exponent, seed))
            scores.append(run or _scores(plan, count, noise, exponent, seed))
            yield {"spectra": [], "scores": scores}
    spectra: list[dict[str, Any]] = []
    for exponent, seed in _runs(plan):
        run = earlier.get(("spectra", most, 0.0, exponent, seed))
        spectra.append(run or _spectra(plan, most, exponent, seed, device))
        yield {"spectra": spectra, "scores": scores}


def _runs(plan: Plan) -> list[tuple[float, int]]:
    return [(exponent, seed) for exponent in EXPONENTS for seed in plan.seeds]


def _key(run: dict[str, Any]) -> tuple[Any, ...]:
    kind = "spectra" if "moments" in run else "scores"
    return kind, run["count"], run.get("noise", 0.0), run["exponent"], run["seed"]


def _spectra(plan: Plan, count: int, exponent: float, seed: int, device: Device) -> dict[str, Any]:
    print(f"{count} views, ramp {exponent:g}, seed {seed}, watched ...", file=sys.stderr)
    asked = fit_settings(plan, count, exponent=exponent, seed=seed)
    found = watched(asked, asked.test[1], device)
    return {"count": count, "noise": 0.0, "exponent": exponent, "seed": seed, **found}


def _scores(plan: Plan, count: int, noise: float, exponent: float, seed: int) -> dict[str, Any]:
    fit = fitted(plan, count, exponent=exponent, seed=seed, noise=noise)
    named = {name: fit.scores(group).get(key) for name, (group, key) in _SCORES.items()}
    return {"count": count, "noise": noise, "exponent": exponent, "seed": seed, **named}


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the tables and the spectra."""
    if result["scores"]:
        _show_scores(page, result["scores"])
    if result["spectra"]:
        _show_spectra(page, result["spectra"])


def _show_spectra(page: Page, runs: Sequence[dict[str, Any]]) -> None:
    first = runs[0]
    page.paragraph(
        f"Fits to {first['count']} views of the ring, looked at while they are trained, by "
        f"{first['pictures']} pictures of the ring that they never see. Drawn is the power of the "
        "error over that of the true pictures, by spatial frequency: 0 dB where nothing is "
        "learned. Where a curve falls first, the fit learns first; spectral bias is that low "
        "frequencies do. Noise of the pictures and the splats' own width add to the right end."
    )
    errors = {exponent: _mean_errors(runs, exponent) for exponent in EXPONENTS}
    for exponent, moments in errors.items():
        if moments:
            words = f"exponent {exponent:g} of the ramp" if exponent else "without the ramp"
            _draw(page, first, moments, "error / truth, dB", f"Relative error, {words}.")
    plain, ramp = (errors[exponent] for exponent in EXPONENTS)
    if ramp:
        gains = {step: ramp[step] - plain[step] for step in ramp}
        words = "Error with the ramp over that without: below 0 dB the ramp is nearer the truth."
        _draw(page, first, gains, "with / without, dB", words)
    _draw_power(page, runs)
    cells = [
        (run["exponent"], run["seed"], *(moment["psnr"] for moment in run["moments"]))
        for run in runs
    ]
    steps = [f"step {moment['step']}" for moment in first["moments"]]
    page.table(("ramp", "seed", *steps), cells, caption="Mean PSNR of these pictures, dB.")


def _mean_errors(runs: Sequence[dict[str, Any]], exponent: float) -> dict[int, Any]:
    """By step, the relative error in dB against the frequency, a mean over the seeds."""
    same = [run for run in runs if run["exponent"] == exponent]
    if not same:
        return {}
    errors = np.mean([[m["error"] for m in run["moments"]] for run in same], axis=0)
    steps = [moment["step"] for moment in same[0]["moments"]]
    return {step: 10 * np.log10(error) for step, error in zip(steps, errors, strict=True)}


def _draw(
    page: Page, first: dict[str, Any], lines: dict[int, Any], label: str, caption: str
) -> None:
    series = {f"step {step}": (first["frequency"], values) for step, values in lines.items()}
    figure = curves(series, xlabel=_XLABEL, ylabel=label, log_x=True)
    page.figure(figure_png(figure), caption=caption, alt=caption)


def _draw_power(page: Page, runs: Sequence[dict[str, Any]]) -> None:
    """The power of the pictures at the end, over the truth's."""
    series = {}
    for exponent in EXPONENTS:
        last = [run["moments"][-1]["power"] for run in runs if run["exponent"] == exponent]
        if last:
            series[f"ramp {exponent:g}"] = (runs[0]["frequency"], np.mean(last, axis=0))
    words = "Power of the drawn pictures over the truth's after all steps: below 1 they are blurred"
    figure = curves(series, xlabel=_XLABEL, ylabel="power / truth", log_x=True)
    page.figure(figure_png(figure), caption=f"{words}.", alt=words)


def _show_scores(page: Page, runs: Sequence[dict[str, Any]]) -> None:
    cells = [(*(run[key] for key in _OF), *(run[name] for name in _SCORES)) for run in runs]
    caption = (
        "Mean scores of the fixed test sets, PSNR in dB: every 8th view of the ring, and views "
        "off it. The fits of one seed begin with the same splats and see the same order of views."
    )
    page.table(("views", "noise", "ramp", "seed", *_SCORES), cells, caption=caption)
    cases = dict.fromkeys((run["count"], run["noise"]) for run in runs)
    gains = [_gain(*case, runs) for case in cases]
    page.table(
        ("views", "noise", "seeds", *_SCORES),
        [row for row in gains if row is not None],
        caption="What the ramp adds to each score, a mean over the seeds.",
    )


def _gain(count: int, noise: float, runs: Sequence[dict[str, Any]]) -> tuple[Any, ...] | None:
    """The mean difference of the scores, over the seeds that have both fits."""
    same = [run for run in runs if (run["count"], run["noise"]) == (count, noise)]
    found = {(run["exponent"], run["seed"]): run for run in same}
    seeds = [s for e, s in found if e == EXPONENTS[1] and (EXPONENTS[0], s) in found]
    if not seeds:
        return None
    pairs = [(found[EXPONENTS[0], seed], found[EXPONENTS[1], seed]) for seed in seeds]
    means = [
        None if pairs[0][0][name] is None else float(np.mean([b[name] - a[name] for a, b in pairs]))
        for name in _SCORES
    ]
    return count, noise, len(seeds), *means
