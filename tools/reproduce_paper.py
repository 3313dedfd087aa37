"""Reproduce the figures of the paper "RiFT, Radiance Field Tomography".

    python tools/reproduce_paper.py --quick --out paper
    python tools/reproduce_paper.py --full --out paper
    python tools/reproduce_paper.py --report-only --out paper

Each figure's result is a JSON file of its own, with the device, the version and the date;
``report.html`` is drawn from those files alone, so that it can be redrawn without computing.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import tyro

from figures import figure_05, figure_06
from rift_cl.cl import Device, open_device
from rift_cl.errors import RiftError
from rift_cl.html_page import Page
from rift_cl.io import make_folder, write_json, write_text
from rift_cl.jobs.run_folder import environment

FIGURES: tuple[ModuleType, ...] = (figure_05, figure_06)


@dataclass(frozen=True)
class Settings:
    """Reproduce the paper's figures."""

    out: Path = Path("paper")
    """Folder for one JSON file per figure and report.html."""
    quick: bool = False
    """Small sizes, in well under a minute (the default)."""
    full: bool = False
    """The paper's sizes."""
    only: tuple[str, ...] = ()
    """Names of the figures to compute, such as figure_05; all when not given."""
    report_only: bool = False
    """Compute nothing; draw report.html again from the JSON files."""
    device: str | None = None
    """Device to use; see 'rift devices'."""


def main() -> int:
    """Compute what was asked for, then draw the report."""
    settings = tyro.cli(Settings)
    try:
        return _reproduce(settings)
    except RiftError as error:
        print(f"reproduce_paper: {error}", file=sys.stderr)
        return error.exit_status


def _reproduce(settings: Settings) -> int:
    known = {figure.NAME for figure in FIGURES}
    unknown = set(settings.only) - known
    if unknown or (settings.quick and settings.full):
        problem = f"unknown figures {sorted(unknown)}" if unknown else "both --quick and --full"
        print(f"reproduce_paper: {problem}; figures: {sorted(known)}", file=sys.stderr)
        return 2
    make_folder(settings.out)
    if not settings.report_only:
        device = open_device(settings.device)
        for figure in FIGURES:
            if not settings.only or figure.NAME in settings.only:
                print(f"{figure.NAME} ...", file=sys.stderr)
                _compute(figure, settings, device)
    write_text(settings.out / "report.html", _report(settings.out).html())
    print(f"report.html is in {settings.out}")
    return 0


def _compute(figure: ModuleType, settings: Settings, device: Device) -> None:
    record = {
        "figure": figure.NAME,
        "full": settings.full,
        "seed": None,
        "environment": environment(device),
        "result": figure.compute(settings.full, device),
    }
    write_json(settings.out / f"{figure.NAME}.json", record)


def _report(folder: Path) -> Page:
    page = Page("The figures of RiFT, reproduced", "From the JSON files beside this page")
    for figure in FIGURES:
        path = folder / f"{figure.NAME}.json"
        if not path.exists():
            continue
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        page.section(figure.TITLE)
        figure.show(page, record["result"])
        seed = "none drawn" if record["seed"] is None else record["seed"]
        page.facts({"size": "full" if record["full"] else "quick", "seed": seed})
        page.facts(record["environment"])
    return page


if __name__ == "__main__":
    sys.exit(main())
