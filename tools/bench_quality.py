"""Time to quality: seconds and steps after which held-out photographs reach 30, 35, 40 and 43 dB.

    python tools/bench_quality.py ornament/orbit lego fox --json quality.json --markdown quality.md
    python tools/bench_quality.py lego --json quality.json --against ../checkout-of-79177a8
    python tools/bench_quality.py lego --json quality.json --keep docs/benchmarks/quality

Every eighth photograph of a capture is held out; some of them are scored every so many steps, and
the first such moment at which their mean PSNR reaches a goal counts. A fit's rates follow from its
number of steps, so that a short fit arrives sooner than a long one: give several of --steps.
Seconds are processor time of all threads and wall time, of reading photographs, placing first
splats and training, but not of scoring. A kernel that was never compiled before is compiled in
them: run twice on a new machine.

--against does the same with another checkout, which has its own defaults (and --preset, where it
knows that); OpenSplat takes part if the program ``opensplat`` is found.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import Positional

import rift_cl as rift
from bench import opensplat
from bench.checkout import Checkout
from bench.command import report, say
from bench.quality import GOALS, FitCase, moments, record_of
from bench.surroundings import in_words, surroundings
from bench.table import NONE, Table, markdown_lines
from rift_cl.commands.fit_photos.presets import PRESETS
from rift_cl.errors import InputError

_OURS, _OTHER, _OPENSPLAT = "this version", "the other", "OpenSplat"


@dataclass(frozen=True)
class Options:
    """Measure how soon fits are good.

    Args:
        captures: what is fitted, with poses.
        json: file for every moment of every fit.
        steps: of the fits.
        splats: most of each fit.
        every: steps between two scores.
        views: held-out photographs that are scored.
        downscale: whole factor by which photographs are made smaller.
        preset: of ``rift fit photos``; its defaults if not given.
        seed: of the fits.
        against: checkout of another version.
        markdown: file for the tables.
        keep: folder for the result by date, DATE-DEVICE.json.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    captures: Annotated[tuple[Path, ...], Positional]
    json: Path
    steps: tuple[int, ...] = (3000,)
    splats: int = 20_000
    every: int = 50
    views: int = 8
    downscale: int = 1
    preset: str | None = None
    seed: int = 0
    against: Path | None = None
    markdown: Path | None = None
    keep: Path | None = None
    device: str | None = None


def measure_all(options: Options) -> Iterator[dict[str, Any]]:
    """Run the benchmark.

    Yields:
        The record of all that was measured so far, after each fit.
    """
    if options.preset not in (None, *PRESETS):
        raise InputError(f"--preset is {options.preset!r}, wanted one of {', '.join(PRESETS)}")
    device = rift.open_device(options.device)
    turns: dict[str, Callable[[], AbstractContextManager[Any]]] = {_OURS: nullcontext}
    if options.against is not None:
        turns[_OTHER] = Checkout(options.against).active
    head = {**surroundings(device), "preset": options.preset, "seed": options.seed}
    cases: list[dict[str, Any]] = []
    skipped: dict[str, str] = {}
    for capture in options.captures:
        for steps in options.steps:
            case = _case(capture, steps, options)
            fits: list[dict[str, Any]] = []
            cases.append({"name": case.name, "steps": steps, "fits": fits})
            for who, turn in turns.items():
                say(f"{case.name}, {who}")
                fits.append(record_of(who, list(moments(case, device.selector, turn))))
                yield {**head, "cases": cases, "skipped": skipped}
            try:
                fits.append(record_of(_OPENSPLAT, opensplat.moments(case, device.selector)))
            except InputError as error:
                skipped[_OPENSPLAT] = str(error)
            yield {**head, "cases": cases, "skipped": skipped}


def _case(capture: Path, steps: int, options: Options) -> FitCase:
    return FitCase(
        capture,
        steps=steps,
        splats=options.splats,
        every=options.every,
        views=options.views,
        downscale=options.downscale,
        seed=options.seed,
        preset=options.preset,
    )


def tables(record: dict[str, Any]) -> Iterator[Table]:
    """One table: a row for each fit."""
    heads = [f"{goal:g} dB" for goal in GOALS]
    rows = [
        (case["name"], fit["who"], *map(_cell, fit["goals"]), *_end(fit))
        for case in record["cases"]
        for fit in case["fits"]
    ]
    notes = (
        "Processor seconds of all threads / wall seconds / steps until the mean PSNR of held-out "
        "photographs first reached a goal, without the time of scoring; a dash where it did not.",
        f"Preset: {record['preset'] or 'none'}; seed {record['seed']}.",
        *(f"{who} did not take part: {why}." for who, why in record["skipped"].items()),
    )
    columns = ("fit", "by", *heads, "PSNR at the end", "processor s", "wall s")
    yield Table("Time to quality", columns, rows, notes, texts=2)


def _cell(goal: dict[str, Any]) -> str:
    if goal["step"] is None:
        return NONE
    return f"{goal['cpu_s']:.1f} / {goal['wall_s']:.1f} / {goal['step']}"


def _end(fit: dict[str, Any]) -> tuple[str, str, str]:
    last = fit["moments"][-1]
    return f"{last['psnr']:.2f}", f"{last['cpu_s']:.1f}", f"{last['wall_s']:.1f}"


def page(record: dict[str, Any]) -> str:
    """The tables as a page, with the device named."""
    preset = f", --preset {record['preset']}" if record["preset"] else ""
    lines = [
        "<!-- Generated by tools/bench_quality.py; do not edit. -->",
        f"# Time to quality{preset}",
        "",
        in_words(record),
    ]
    return "\n".join([*lines, *markdown_lines(tables(record))]) + "\n"


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    return report(
        "bench_quality",
        measure_all(options),
        json_file=options.json,
        markdown_file=options.markdown,
        page=page,
        tables=tables,
        keep_in=options.keep,
        kept=dict,
    )


if __name__ == "__main__":
    sys.exit(main())
