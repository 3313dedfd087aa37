"""The table and the report of ``rift sweep``."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rift_cl.commands.reconstruct.report import PREVIEW_PICTURE
from rift_cl.commands.sweep.one_run import PICTURE
from rift_cl.commands.sweep.variations import Variation
from rift_cl.errors import OutputError
from rift_cl.io.output import write_text
from rift_cl.json_parsing import parse_json
from rift_cl.report.html_page import Page

# Figures that a table on a page has room for.
_COLUMNS = 8
_PICTURES = 60


@dataclass(frozen=True)
class Row:
    """What came of a run.

    Args:
        run: the run.
        figures: its numbers by name.
        refused: why it could not be done; empty where it was.
    """

    run: Variation
    figures: dict[str, float]
    refused: str = ""

    @classmethod
    def of(cls, run: Variation, refused: str) -> Row:
        """The row of a run by what it left in its folder.

        Raises:
            OutputError: its figures are not there, or cannot be read.
        """
        if refused:
            return cls(run, {}, refused)
        path = run.settings.out / "metrics.json"
        try:
            return cls(run, dict(_numbers(parse_json(path.read_text(encoding="utf-8")))))
        except (OSError, ValueError, RecursionError) as error:
            raise OutputError(
                f"{path}: cannot be read ({error}): remove {path.parent} and go on with --resume"
            ) from error

    @property
    def picture(self) -> bytes | None:
        """A slice or a view, if the run left one."""
        for name in (PREVIEW_PICTURE, PICTURE):
            path = Path(self.run.settings.out) / name
            if not self.refused and path.is_file():
                return path.read_bytes()
        return None


def _numbers(record: Any, name: str = "") -> list[tuple[str, float]]:
    """The numbers in a record of figures, by names that say where they are."""
    if isinstance(record, bool) or record is None:
        return []
    if isinstance(record, (int, float)):
        return [(name, record)] if math.isfinite(record) else []
    if not isinstance(record, Mapping):
        return []
    inner = (_numbers(value, f"{name} {key}".strip()) for key, value in record.items())
    return [number for numbers in inner for number in numbers]


def _score_columns(rows: Sequence[Row], most: int) -> list[str]:
    """Names of the figures that tell the runs apart.

    Scores of held-out views come first, then the others as the runs list them.
    """
    done = [row for row in rows if not row.refused]
    names = list(dict.fromkeys(name for row in done for name in row.figures))
    differ = [name for name in names if len({row.figures.get(name) for row in done}) > 1] or names
    plain = [name for name in differ if len(name.split()) <= 4 and not name.startswith("errors")]
    plain.sort(key=lambda name: not ("psnr" in name or "ssim" in name))
    return plain[:most]


def score_table(rows: Sequence[Row], most: int = _COLUMNS) -> tuple[list[str], list[list[Any]]]:
    """The columns and the rows of the table: what was varied, and what came out.

    Args:
        rows: the runs.
        most: figures that there is room for.
    """
    varied = list(dict.fromkeys(name for row in rows for name in row.run.varied))
    columns = _score_columns(rows, most)
    body = [
        [
            *([] if varied else [row.run.name]),
            *(row.run.varied.get(name) for name in varied),
            *(row.figures.get(name) for name in columns),
        ]
        for row in rows
    ]
    return [*(varied or ["run"]), *_headings(columns, varied)], body


def _headings(figures: Sequence[str], varied: Sequence[str]) -> list[str]:
    """What columns of figures are called: a center that was found is not the one that was given."""
    return [f"found {name}" if name in varied else name for name in figures]


def write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write all figures of all runs, a line for each."""
    varied = list(dict.fromkeys(name for row in rows for name in row.run.varied))
    names = list(dict.fromkeys(name for row in rows for name in row.figures))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["run", *varied, *_headings(names, varied), "refused"])
    for row in rows:
        given = [row.run.varied.get(name, "") for name in varied]
        figures = [row.figures.get(name, "") for name in names]
        writer.writerow([row.run.name, *given, *figures, row.refused])
    write_text(path, text.getvalue())


def sweep_page(job: str, rows: Sequence[Row]) -> Page:
    """The report of a finished sweep."""
    page = Page(f"Sweep of rift {job}", f"{len(rows)} runs")
    shown = [(row, picture) for row in rows if (picture := row.picture) is not None]
    if shown:
        page.section("Pictures")
        page.panels(
            [picture for _, picture in shown[:_PICTURES]],
            titles=[row.run.name for row, _ in shown[:_PICTURES]],
            columns=min(4, len(shown)),
            caption="The middle slice of each run, or the first view that was held out; each slice "
            "has a grey scale of its own.",
            alt="Pictures of the runs",
        )
    page.section("Figures")
    columns, body = score_table(rows)
    if any(row.refused for row in rows):
        columns = [*columns, "why it could not be done"]
        body = [[*cells, row.refused] for cells, row in zip(body, rows, strict=True)]
    page.table(columns, body, caption="sweep.csv has all figures")
    page.section("Reports")
    for row in rows:
        if not row.refused:
            page.link(row.run.name, f"runs/{row.run.name}/report.html")
    return page
