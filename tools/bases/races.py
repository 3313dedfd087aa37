"""What races of additive splats show: tables, plots and verdicts, from their records alone.

Equal parameters: every basis after so many steps. Equal wall time: every basis at the moment at
which the Gaussians had taken so many. The clock of a fit runs while that fit steps; fits take turns
step by step, so that whatever else the machine does slows all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bases.additive_fit import EXACT, at_time
from bases.statistics import Difference, chosen, distinct, sentence, spread, values
from bench.table import Table
from rift_cl.report.plot import curves

BASELINE = "Gaussian"


def _moments(result: dict[str, Any]) -> dict[str, int]:
    last = int(result["runs"][0]["history"][-1]["step"])
    return {"short": result["short"], "converged": last}


def _comparable(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Every run with its scores at both moments, by steps, by wall clock and by processor time."""
    runs, found = result["runs"], []
    mates = {_key(run): run for run in runs if run["basis"] == BASELINE}
    for run in runs:
        mate = mates[_key(run)]["history"]
        row = {k: v for k, v in run.items() if k != "history"}
        for name, step in _moments(result).items():
            reached = next(mark for mark in mate if mark["step"] == step)
            own = next(mark for mark in run["history"] if mark["step"] == step)
            row[f"{name} steps"] = own["psnr"]
            for clock in ("wall", "cpu"):
                row[f"{name} {clock}"] = at_time(run["history"], reached[clock], clock, "psnr")
        found.append(row)
    return found


def _key(run: dict[str, Any]) -> tuple[Any, ...]:
    keys = ("seed", "target", "samples", "budget", "views", "solve")
    return tuple(run.get(k) for k in keys)


def _cases(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    keys = [k for k in ("target", "samples", "views", "budget", "solve") if k in runs[0]]
    combos = dict.fromkeys(tuple(run[k] for k in keys) for run in runs)
    return [dict(zip(keys, combo, strict=True)) for combo in combos]


def _words(case: dict[str, Any]) -> str:
    units = {"samples": "samples an edge", "views": "views", "budget": "parameters"}
    told = {k: f"{v} {units[k]}" if k in units else str(v) for k, v in case.items()}
    return ", ".join((told | {"solve": _solver(case["solve"])}).values())


def _solver(solve: int) -> str:
    return "exact solves" if solve == EXACT else f"{solve} conjugate gradients"


def _most_exact(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of every case, the runs with the solver that comes closest to the best coefficients."""
    solvers: dict[tuple[Any, ...], set[int]] = {}
    for run in runs:
        solvers.setdefault(_key(run)[:-1], set()).add(run["solve"])
    best = {case: EXACT if EXACT in found else max(found) for case, found in solvers.items()}
    return [run for run in runs if run["solve"] == best[_key(run)[:-1]]]


def race_tables(result: dict[str, Any]) -> Iterator[Table]:
    """PSNR at equal parameters and equal time, then what it cost."""
    runs = _comparable(result)
    bases = distinct(runs, "basis")
    notes = {
        "steps": "Equal parameters and equal steps.",
        "wall": "Equal parameters, at the wall clock of the Gaussians' last of these steps.",
        "cpu": "Equal parameters, at the processor time of the Gaussians' last of these steps.",
    }
    for name, step in _moments(result).items():
        for clock, note in notes.items():
            rows = [
                [_words(case), *(spread(values(runs, f"{name} {clock}", basis=b, **case))
                                 for b in bases)]
                for case in _cases(runs)
            ]  # fmt: skip
            how = "steps" if clock == "steps" else f"steps of the Gaussians by {clock} time"
            yield Table(f"PSNR in dB after {step} {how} ({name})", ["case", *bases], rows, [note])
    rows = [
        [b, str(distinct([r for r in runs if r["basis"] == b], "per_splat")[0]),
         *(spread(values(runs, what, basis=b), ".3g") for what in ("wall_ms", "cpu_ms", "pairs"))]
        for b in bases
    ]  # fmt: skip
    heads = ["basis", "parameters a splat", "ms a step", "processor ms a step", "boxes a pixel"]
    yield Table("What a step costs, over all cases", heads, rows)


def race_pictures(result: dict[str, Any]) -> dict[str, tuple[Any, str]]:
    """PSNR against time for every budget, and against parameters."""
    found = {}
    budgets = distinct(result["runs"], "budget")
    for budget in budgets:
        mine = [run for run in result["runs"] if run["budget"] == budget]
        figure = curves(_by_time(mine), xlabel="seconds", ylabel="mean PSNR, dB", log_x=True)
        found[f"time_{budget}"] = (figure, f"Mean PSNR against wall time, {budget} parameters")
    runs = _most_exact(_comparable(result))
    for name in _moments(result):
        series = {}
        for basis in distinct(runs, "basis"):
            means = [np.mean(values(runs, f"{name} steps", basis=basis, budget=n)) for n in budgets]
            series[basis] = budgets, means
        figure = curves(series, xlabel="parameters", ylabel="mean PSNR, dB")
        found[f"parameters_{name}"] = (figure, f"Mean PSNR against parameters, {name}")
    return found


def _by_time(runs: list[dict[str, Any]]) -> dict[str, tuple[list[float], list[float]]]:
    """Mean curves of every basis and length of solves."""
    several, found = len(distinct(runs, "solve")) > 1, {}
    for basis in distinct(runs, "basis"):
        for solve in distinct(runs, "solve"):
            marks = [run["history"] for run in chosen(runs, basis=basis, solve=solve)]
            wall, psnr = (
                [float(np.mean([mark[what] for mark in at])) for at in zip(*marks, strict=True)]
                for what in ("wall", "psnr")
            )
            found[f"{basis}, {_solver(solve)}" if several else basis] = (wall, psnr)
    return found


def race_verdicts(result: dict[str, Any]) -> list[str]:
    """Every basis against Gaussians: by steps and by time, short and converged.

    With the most exact solves, where there is a choice: pairs should be independent.
    """
    runs, said = _most_exact(_comparable(result)), []
    several = len(distinct(result["runs"], "solve")) > 1
    how = "most exact solves, equal parameters" if several else "equal parameters"
    for name, step in _moments(result).items():
        for clock, words in (("steps", "equal steps"), ("wall", "equal wall time")):
            for basis in distinct(runs, "basis"):
                if basis != BASELINE:
                    gain = _gain(runs, basis, f"{name} {clock}")
                    where = f"{how} and {words} ({step} steps, {name})"
                    said.append(sentence(basis, BASELINE, gain, "dB", where))
    return [*said, *_best_verdicts(result)]


def _best_verdicts(result: dict[str, Any]) -> list[str]:
    """Every basis with the solver that suits it, where there was a choice.

    The time is that of the Gaussians' last step with the solver that took longest; the best that a
    fit of either basis had by then counts.
    """
    runs, said = result["runs"], []
    if len(distinct(runs, "solve")) < 2:
        return said
    for name, step in _moments(result).items():
        best: dict[str, dict[tuple[Any, ...], float]] = {}
        ends: dict[tuple[Any, ...], float] = {}
        for run in chosen(runs, basis=BASELINE):
            end = next(m["wall"] for m in run["history"] if m["step"] == step)
            ends[_key(run)[:-1]] = max(end, ends.get(_key(run)[:-1], 0.0))
        for run in runs:
            case, found = _key(run)[:-1], best.setdefault(run["basis"], {})
            reached = at_time(run["history"], ends[case], "wall", "psnr")
            found[case] = max(reached, found.get(case, -np.inf))
        for basis, found in best.items():
            if basis != BASELINE:
                gain = Difference.of([v - best[BASELINE][case] for case, v in found.items()])
                where = f"equal parameters and wall time, each with its best solver ({name})"
                said.append(sentence(basis, BASELINE, gain, "dB", where))
    return said


def _gain(runs: list[dict[str, Any]], basis: str, what: str) -> Difference:
    mates = {_key(run): run[what] for run in runs if run["basis"] == BASELINE}
    return Difference.of([run[what] - mates[_key(run)] for run in runs if run["basis"] == basis])
