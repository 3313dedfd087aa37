"""The table at the head of docs/benchmarks/index.md, from the pages of benchmarks beside it.

    python tools/print_benchmark_summary.py

Nothing is measured here and no figure is written here: ratios, date and device are read from the
pages that the benchmarks printed. A test holds the table against them, so that a page that is
printed again wants this run as well.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import tyro

_BENCHMARKS = Path(__file__).parents[1] / "docs" / "benchmarks"
_TORCH = "tiles in torch, on the CPU"
_JOBS = {"forward": "Project an image", "backward": "Backproject", "fbp": "Filtered backprojection"}


@dataclass(frozen=True)
class Options:
    """Print the summary of the benchmarks.

    Args:
        pages: folder of the pages; the table goes between the marks of its index.md.
    """

    pages: Path = _BENCHMARKS


class Row(NamedTuple):
    """A job on the summary.

    Args:
        job: what was done, and of what sizes.
        beside: what it was compared with.
        gains: what was gained, one for each size or scene.
        unit: of the gains.
    """

    job: str
    beside: str
    gains: list[float]
    unit: str = " times as fast"


def table(folder: Path) -> str:
    """The table of all pages, in Markdown.

    Args:
        folder: of the pages.

    Raises:
        ValueError: a page lacks its table, or does not say its device and its date.
    """
    lines = [
        "| job | beside | gain | when, and on what | printed by |",
        "| :-- | :-- | --: | :-- | :-- |",
    ]
    pages = (
        ("performance", "bench_kernels.py --peers", _kernels),
        ("training", "bench_training.py --peers", _steps),
        ("defaults", "search_defaults.py", _defaults),
    )
    for name, command, rows in pages:
        text = (folder / f"{name}.md").read_text(encoding="utf-8")
        where = f"{_origin(name, text)} | [`tools/{command}`]({name}.md)"
        for row in rows(text):
            if not row.gains:
                raise ValueError(f"{name}.md holds nothing about '{row.job}'")
            lines.append(f"| {row.job} | {row.beside} | {_span(row)} | {where} |")
    return "\n".join(lines)


def _kernels(page: str) -> Iterator[Row]:
    """Operations on NumPy arrays, as peers take them, and splats drawn."""
    races = list(_sections(page, "Times faster than the fastest peer, "))
    sizes = f"{races[0][0]} to {races[-1][0]}" if races else ""
    for operation, job in _JOBS.items():
        found = [
            cells
            for _, rows in races
            for cells in rows
            if cells[:2] == [operation, "rift_cl, NumPy"]
        ]
        peers = ", ".join(sorted({cells[2] for cells in found}))
        yield Row(
            f"{job}, {sizes}", f"{peers}, the fastest of all peers", [_gain(c[3]) for c in found]
        )
    ((_, drawn),) = _sections(page, "Splats against a rasterizer in torch")
    for operation in ("draw", "draw and gradient"):
        found = [cells for cells in drawn if cells[1] == operation]
        scenes = f"Splats, {operation}: {found[0][0]} to {found[-1][0]}" if found else operation
        yield Row(scenes, _TORCH, [_gain(cells[5]) for cells in found])


def _steps(page: str) -> Iterator[Row]:
    """Whole training steps."""
    ((_, rows),) = _sections(page, "Steps per second")
    found = [cells for cells in rows if cells[1] == "torch trainer"]
    scenes = f"A training step, {found[0][0]} to {found[-1][0]}" if found else "A training step"
    yield Row(scenes, f"{_TORCH}, with its fused Adam", [_gain(cells[4]) for cells in found])


def _defaults(page: str) -> Iterator[Row]:
    """Held-out views of fits with the defaults."""
    found = re.findall(r"^\| defaults \|(.*)\|$", page, re.MULTILINE)
    gains = [float(gain) for cells in found for gain in re.findall(r"\(([+-][\d.]+)\)", cells)]
    yield Row("Held-out views of fits to photographs", "the defaults of 0.1.0", gains, " dB")


def _sections(page: str, title: str) -> Iterator[tuple[str, list[list[str]]]]:
    """What follows the title in a heading, and the rows of the table below it."""
    for section in re.split(r"^## ", page, flags=re.MULTILINE)[1:]:
        heading, _, body = section.partition("\n")
        if heading.startswith(title):
            rows = [line.strip("| ").split(" | ") for line in body.splitlines() if line[:1] == "|"]
            yield heading.removeprefix(title), rows[2:]


def _gain(cell: str) -> float:
    return float(cell.rstrip("×"))


def _span(row: Row) -> str:
    """Least to greatest."""
    sign = "+" if row.unit.strip() == "dB" else ""
    least, most = (f"{gain:{sign}g}" for gain in (min(row.gains), max(row.gains)))
    return f"{least} to {most}{row.unit}" if least != most else f"{least}{row.unit}"


def _origin(name: str, page: str) -> str:
    device = re.search(r"on \*\*(.+?)\*\* \(.*?driver ([^,)]+)", page)
    date = re.search(r"(\d{4}-\d\d-\d\d)T\d\d:\d\d", page)
    if device is None or date is None:
        raise ValueError(f"{name}.md does not say its device and its date")
    return f"{date[1]}, {device[1]}, driver {device[2]}"


def with_table(index: str, folder: Path) -> str:
    """The text of index.md with the table of the pages between its marks."""
    filled = f"<!-- summary -->\n{table(folder)}\n<!-- end -->"
    return re.sub(r"<!-- summary -->.*?<!-- end -->", lambda _: filled, index, flags=re.DOTALL)


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    index = tyro.cli(Options).pages / "index.md"
    text = with_table(index.read_text(encoding="utf-8"), index.parent)
    index.write_text(text, encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
