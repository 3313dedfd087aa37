"""Compare bases for splats and for their colours: who wins, who loses, and by how much.

    python tools/compare_bases.py --quick --out bases
    python tools/compare_bases.py --full --seeds 0 1 2 --out bases
    python tools/compare_bases.py --only angular_dense volumes --out bases
    python tools/compare_bases.py --report-only --out bases

Everything is compared at equal parameters and at equal wall time, after few steps and after many,
over several seeds that all bases share. Each study's result is a JSON file of its own, with the
device, the version and the date. A run that was broken off goes on where it was: what a file has
already is not computed again. ``bases.md``, the plots and ``report.html`` are drawn from those
files alone.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import tyro

from bases import angular_dense, angular_fixed, angular_views, images, radiance, slices, volumes
from bases.plan import Plan
from bench.table import Table, markdown_lines, show
from rift_cl import Report, RiftError
from rift_cl.cl import Device, open_device
from rift_cl.commands.progress_bar import show_progress
from rift_cl.commands.run_folder.run_folder import environment
from rift_cl.errors import InputError
from rift_cl.io import atomic_path, make_folder, write_json, write_text
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png

STUDIES: tuple[ModuleType, ...] = (
    angular_dense,
    angular_fixed,
    angular_views,
    images,
    slices,
    volumes,
    radiance,
)


@dataclass(frozen=True)
class Settings:
    """Compare bases for splats and for their colours."""

    out: Path = Path("bases")
    """Folder for one JSON file per study, the plots, bases.md and report.html."""
    quick: bool = False
    """Small sizes; a few minutes (the default)."""
    full: bool = False
    """The protocol's sizes; hours on a CPU."""
    tiny: bool = False
    """Sizes that show nothing but that all of it runs, for tests."""
    only: tuple[str, ...] = ()
    """Names of the studies; all when not given."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Of targets, starts and noise; a spread wants three or more."""
    report_only: bool = False
    """Compute nothing; draw the report again from the JSON files."""
    device: str | None = None
    """Device to use; see 'rift devices'."""

    def plan(self) -> Plan:
        """What the studies are computed with.

        Raises:
            InputError: an option makes no sense.
        """
        names = [study.NAME for study in STUDIES]
        unknown = sorted(set(self.only) - set(names))
        if unknown:
            raise InputError(f"--only has no study {', '.join(unknown)}; studies: {names}")
        if self.quick + self.full + self.tiny > 1:
            raise InputError("--quick, --full and --tiny exclude each other; give one of them")
        if not self.seeds or len(set(self.seeds)) < len(self.seeds) or min(self.seeds) < 0:
            raise InputError(f"--seeds is {list(self.seeds)}, wanted different numbers from 0")
        size = "full" if self.full else "tiny" if self.tiny else "quick"
        return Plan(size, self.out, self.seeds, self.device)


def main() -> int:
    """Compute what was asked for, then draw the report."""
    settings = tyro.cli(Settings)
    try:
        return _compare(settings)
    except RiftError as error:
        print(f"compare_bases: {error}", file=sys.stderr)
        return error.exit_status


def _compare(settings: Settings) -> int:
    plan = settings.plan()
    make_folder(plan.out)
    try:
        if not settings.report_only:
            device = open_device(settings.device)
            for study in STUDIES:
                if not settings.only or study.NAME in settings.only:
                    print(f"{study.TITLE} ...", file=sys.stderr)
                    show_progress(_computed(study, plan, device), quiet=False)
    finally:
        # A study that fails leaves the report of what there is.
        _report(plan)
    return 0


def _report(plan: Plan) -> None:
    """Draw and print what the files have."""
    records = {study.NAME: _read(plan.out / f"{study.NAME}.json") for study in STUDIES}
    shown = [(study, records[study.NAME]) for study in STUDIES if records[study.NAME]]
    _write_report(plan.out, shown)
    for study, record in shown:
        show(_all_tables(study, record["result"]))
        print("\n".join(study.verdicts(record["result"])), end="\n\n")
    print(f"bases.md and report.html are in {plan.out}")


def _computed(study: ModuleType, plan: Plan, device: Device) -> Iterator[Report]:
    """Runs of a study; each is in its file before the next one begins."""
    path, settings = plan.out / f"{study.NAME}.json", study.settings(plan)
    record = _read(path)
    same = record.get("settings") == settings
    kept = record["result"] if same else {"runs": []}
    for result in study.compute(plan, device, kept):
        write_json(
            path,
            {
                "study": study.NAME,
                "settings": settings,
                "environment": environment(device),
                "result": result,
            },
        )
        yield Report(len(result["runs"]), result["total"], "runs")


def _read(path: Path) -> dict[str, Any]:
    """A study's record, or nothing where there is none, or one that was damaged."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        list(record["result"]["runs"])
        return dict(record)
    except (OSError, ValueError, LookupError, TypeError):
        return {}


def _all_tables(study: ModuleType, result: dict[str, Any]) -> list[Table]:
    return list(study.tables(result)) if result["runs"] else []


def _write_report(out: Path, shown: list[tuple[ModuleType, dict[str, Any]]]) -> None:
    page = Page("Bases for splats, compared", "From the JSON files beside this page")
    lines = ["# Bases for splats, compared"]
    for study, record in shown:
        result = record["result"]
        if not result["runs"]:
            continue
        said, found = study.verdicts(result), _all_tables(study, result)
        page.section(study.TITLE)
        page.paragraph(study.__doc__.split("\n\n", 1)[1].replace("\n", " ").strip())
        for sentence in said:
            page.paragraph(sentence)
        for table in found:
            page.table(table.columns, table.rows, caption=table.title)
        for name, (figure, caption) in study.pictures(result).items():
            png = figure_png(figure)
            with atomic_path(out / f"{study.NAME}_{name}.png") as path:
                path.write_bytes(png)
            page.figure(png, caption=caption, alt=caption)
        page.facts(record["settings"])
        page.facts(record["environment"])
        lines += ["", f"# {study.TITLE}", "", *said, *markdown_lines(found)]
    write_text(out / "report.html", page.html())
    write_text(out / "bases.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    sys.exit(main())
