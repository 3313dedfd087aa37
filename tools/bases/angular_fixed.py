"""Lobes in bases without any geometry of their own, as a drop-in for rows of spherical harmonics.

The chart's axis is the surface's normal, one width serves all lobes (the best of a few), and only
the linear coefficients are fitted: no number is spent on axes or widths. Each set of modes comes
with a constant, and fills the same count as harmonics do. The error is the mean over all lobes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from bases.lobe_families import Floats, hermite_columns, laguerre_columns
from bases.lobe_fits import ridge_least_squares
from bases.lobes import LOBES, Hemisphere, lobe_values
from bases.plan import Plan
from bases.statistics import distinct, paired, sentence, spread, values
from bench.table import Table
from rift_cl import Device
from rift_cl.basis import HGLobe, LGLobe, SphericalHarmonics
from rift_cl.report.plot import curves

NAME = "angular_fixed"
TITLE = "View-dependent colour: a fixed chart in place of spherical harmonics"
BASELINE = "SH"
COUNTS = (4, 9, 16)
WIDTHS = (0.4, 0.5, 0.6, 0.7, 0.85, 1.0)
_RIDGE = 1e-9
_UPRIGHT = (1.0, 0.0, 0.0, 0.0)
# A mean error within this share of the other is called equal, whatever the seeds say.
_EQUAL = 0.04


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    rings = plan.of(tiny=8, quick=24, full=48)
    return {**plan.settings(), "rings": rings, "widths": list(WIDTHS)}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Mean errors of every set of modes, count and seed, at its best width."""
    sphere = Hemisphere.gauss(settings(plan)["rings"])
    wanted = [(seed, count) for seed in plan.seeds for count in COUNTS]
    done = {(run["seed"], run["count"]) for run in kept["runs"]}
    result = {"total": len(wanted) * len(_designs(sphere, 4)), "runs": list(kept["runs"])}
    for seed, count in wanted:
        if (seed, count) not in done:
            result["runs"] += _runs(sphere, seed, count)
        yield result


def _runs(sphere: Hemisphere, seed: int, count: int) -> list[dict[str, Any]]:
    truths = [lobe_values(name, sphere.directions, seed) for name in LOBES]
    found = []
    for basis, designs in _designs(sphere, count).items():
        errors = [(_error(design, sphere, truths), width) for width, design in designs]
        rms, width = min(errors)
        found.append(
            {"basis": basis, "count": count, "seed": seed, "rms": rms, "width": width}
        )  # fmt: skip
    return found


def _designs(sphere: Hemisphere, count: int) -> dict[str, list[tuple[float, Floats]]]:
    d = sphere.directions
    harmonics = SphericalHarmonics.of_count(count).functions(None, d)
    sets: dict[str, tuple[type[HGLobe] | type[LGLobe], Sequence[int]]] = {
        "HG row": (HGLobe, hermite_columns(count - 1)),
        "LG row": (LGLobe, laguerre_columns(count - 1)),
        "HG total": (HGLobe, range(count - 1)),
        "LG total": (LGLobe, range(count - 1)),
    }
    found = {"SH": [(0.0, harmonics)]}
    for name, (kind, modes) in sets.items():
        lobe = kind(2 + max(modes))
        columns = [0, *(1 + mode for mode in modes)]
        found[name] = [
            (w, lobe.functions([*_UPRIGHT, *[np.log(w)] * (lobe.n_geometry - 4)], d)[:, columns])
            for w in WIDTHS
        ]
    return found


def _error(design: Floats, sphere: Hemisphere, truths: Sequence[Floats]) -> float:
    share = np.sqrt(sphere.weights / sphere.weights.sum())[:, None]
    wanted = np.stack(truths, axis=-1)
    fit = design @ ridge_least_squares(share * design, share * wanted, _RIDGE)
    return float(np.mean([sphere.rms(error) for error in (fit - wanted).T]))


def tables(result: dict[str, Any]) -> Iterator[Table]:
    """Mean errors by the number of coefficients."""
    runs = result["runs"]
    bases = distinct(runs, "basis")
    rows = []
    for count in distinct(runs, "count"):
        cells = [str(count)]
        for basis in bases:
            widths = values(runs, "width", basis=basis, count=count)
            width = "" if basis == BASELINE else f" (w {np.median(widths):g})"
            cells.append(spread(values(runs, "rms", basis=basis, count=count), ".4f") + width)
        rows.append(cells)
    yield Table(
        f"Mean RMS error over {len(LOBES)} lobes, linear fits on a fixed chart",
        ["coefficients", *bases],
        rows,
        ["In brackets: the best of the widths (the median over the seeds)."],
    )


def pictures(result: dict[str, Any]) -> dict[str, tuple[Any, str]]:
    """Mean error against coefficients."""
    runs = result["runs"]
    counts = distinct(runs, "count")
    series = {
        basis: (counts, [np.mean(values(runs, "rms", basis=basis, count=n)) for n in counts])
        for basis in distinct(runs, "basis")
    }
    figure = curves(series, xlabel="coefficients per channel", ylabel="mean RMS error")
    return {"coefficients": (figure, "Mean RMS error against coefficients, fixed chart")}


def verdicts(result: dict[str, Any]) -> list[str]:
    """Whether the chart's modes replace the harmonics to advantage."""
    runs, said = result["runs"], []
    for basis in distinct(runs, "basis"):
        if basis == BASELINE:
            continue
        for count in distinct(runs, "count"):
            mine = [run for run in runs if run["count"] == count]
            gain = paired(mine, basis, BASELINE, what="rms", keys=("seed",), lower_is_better=True)
            where = f"{count} coefficients"
            text = sentence(basis, BASELINE, gain, "of RMS error taken off", where)
            share = 0.0 if gain is None else gain.mean / np.mean(values(mine, "rms", basis="SH"))
            small = f" That is {share:+.1%}" + (
                ", no more than even." if abs(share) < _EQUAL else "."
            )
            said.append(text + small)
    return said
