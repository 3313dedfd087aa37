"""Reproduce the figures of the paper "RiFT - Radiance Field Tomography".

    python tools/reproduce_paper.py --quick --out paper
    python tools/reproduce_paper.py --full --ornament ornament --out paper
    python tools/reproduce_paper.py --report-only --out paper

Each figure's result is a JSON file of its own, with the device, the version and the date;
``report.html`` is drawn from those files alone, so that it can be redrawn without computing. A run
that was broken off goes on where it was: what a figure's file has already is not computed again,
and fits, in ``fits``, go on from their last checkpoint.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import tyro

from paper import (
    aperture_filter,
    capture_support,
    compensation,
    convergence,
    field_bias,
    figure_02_04,
    figure_05,
    figure_06,
    figure_07,
    figure_09,
    figure_11,
    figure_11_volume,
    figure_12,
    figure_13,
    figure_14,
    figure_15,
    hybrid,
    merit_study,
    planned_ornament,
    planned_views,
    slice_bias,
    spectral_bias,
    surface_views,
)
from paper.plan import Plan, find_ornament, sample_ornament
from rift_cl import RiftError
from rift_cl.cl import Device, open_device
from rift_cl.commands.run_folder.run_folder import environment
from rift_cl.errors import InputError
from rift_cl.io import make_folder, write_json, write_text
from rift_cl.report.html_page import Page

FIGURES: tuple[ModuleType, ...] = (
    figure_02_04,
    figure_05,
    figure_06,
    figure_07,
    figure_09,
    figure_11,
    figure_11_volume,
    figure_12,
    figure_13,
    figure_14,
    figure_15,
    slice_bias,
    spectral_bias,
    field_bias,
    hybrid,
    compensation,
    convergence,
    merit_study,
    surface_views,
    planned_views,
    planned_ornament,
    aperture_filter,
    capture_support,
)
# Those that fit splats to the ornament.
FITTED: tuple[ModuleType, ...] = (
    figure_11,
    figure_12,
    spectral_bias,
    field_bias,
    hybrid,
    aperture_filter,
)


@dataclass(frozen=True)
class Settings:
    """Reproduce the paper's figures."""

    out: Path = Path("paper")
    """Folder for one JSON file per figure, report.html and the fits."""
    quick: bool = False
    """Small sizes, and pictures that come with the package; a few minutes (the default)."""
    full: bool = False
    """The paper's sizes; hours on a CPU."""
    ornament: Path | None = None
    """Folder with the captures orbit, off_path and perhaps orbit_test (every 8th view of orbit
    with less noise), as tools/render_ornament.py makes them; for the fits of --full."""
    steps: int | None = None
    """Of every fit; 400, or 10000 with --full, when not given."""
    splats: int | None = None
    """Most splats of every fit; 3000, or 30000 with --full, when not given."""
    counts: tuple[int, ...] = ()
    """Numbers of input views of the fits; 4 10 24 60, or 10 64 250 570 with --full, when not
    given."""
    seeds: tuple[int, ...] = (0, 1)
    """Of the fits with and without homogenisation; the other figures take the first."""
    noises: tuple[float, ...] = (0.0,)
    """Of the fits with and without homogenisation: standard deviations of white noise that is
    added to the training pictures, in display light."""
    only: tuple[str, ...] = ()
    """Names of the figures to compute, such as figure_05; all when not given."""
    report_only: bool = False
    """Compute nothing; draw report.html again from the JSON files."""
    device: str | None = None
    """Device to use; see 'rift devices'."""

    def plan(self) -> Plan:
        """What the figures are computed with.

        Raises:
            InputError: an option makes no sense, or captures are missing.
        """
        unknown = set(self.only) - {figure.NAME for figure in FIGURES}
        if unknown or (self.quick and self.full):
            problem = f"unknown figures {sorted(unknown)}" if unknown else "both --quick and --full"
            raise InputError(f"{problem}; figures: {sorted(f.NAME for f in FIGURES)}")
        if self.ornament is not None and not self.full:
            raise InputError("--ornament goes with --full; --quick has pictures of its own")
        if not self.seeds:
            raise InputError("--seeds has no number, wanted one or more")
        if not self.noises or not all(0 <= noise < 1 for noise in self.noises):
            raise InputError(f"--noises is {list(self.noises)}, wanted numbers from 0, below 1")
        given = None if self.ornament is None else find_ornament(self.ornament)
        usual = (10_000, 30_000, (10, 64, 250, 570)) if self.full else (400, 3000, (4, 10, 24, 60))
        return Plan(
            full=self.full,
            out=self.out,
            device=self.device,
            ornament=given if self.full else sample_ornament(),
            counts=tuple(sorted(set(self.counts or usual[2]))),
            steps=usual[0] if self.steps is None else self.steps,
            splats=usual[1] if self.splats is None else self.splats,
            seeds=self.seeds,
            noises=self.noises,
        )


def main() -> int:
    """Compute what was asked for, then draw the report."""
    settings = tyro.cli(Settings)
    try:
        return _reproduce(settings)
    except RiftError as error:
        print(f"reproduce_paper: {error}", file=sys.stderr)
        return error.exit_status


def _reproduce(settings: Settings) -> int:
    plan = settings.plan()
    make_folder(settings.out)
    if not settings.report_only:
        device = open_device(settings.device)
        for figure in FIGURES:
            if settings.only and figure.NAME not in settings.only:
                continue
            if figure in FITTED and plan.ornament is None:
                print(f"{figure.NAME} is left out: {plan.missing()}", file=sys.stderr)
                continue
            print(f"{figure.NAME} ...", file=sys.stderr)
            _compute(figure, plan, device)
    write_text(settings.out / "report.html", _report(settings.out).html())
    print(f"report.html is in {settings.out}")
    return 0


def _compute(figure: ModuleType, plan: Plan, device: Device) -> None:
    path, settings = plan.out / f"{figure.NAME}.json", figure.settings(plan)
    for result in figure.compute(plan, device, _kept(path, settings)):
        record = {
            "figure": figure.NAME,
            "settings": settings,
            "environment": environment(device),
            "result": result,
        }
        write_json(path, record)


def _kept(path: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """The result of an earlier run with the same settings, finished or not; empty if none."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        return dict(record["result"]) if record["settings"] == settings else {}
    except (OSError, ValueError, LookupError, TypeError):
        return {}


def _report(folder: Path) -> Page:
    page = Page("The figures of RiFT, reproduced", "From the JSON files beside this page")
    for figure in FIGURES:
        path = folder / f"{figure.NAME}.json"
        if not path.exists():
            continue
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        page.section(figure.TITLE)
        figure.show(page, record["result"])
        page.facts({"seed": "none drawn", **record["settings"]})
        page.facts(record["environment"])
    return page


if __name__ == "__main__":
    sys.exit(main())
