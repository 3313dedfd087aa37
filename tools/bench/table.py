"""A table, how numbers stand in it, and how it is shown: by rich, or as Markdown."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.table import Table as RichTable

NONE = "–"
# Columns where the output goes to a file.
_WIDTH = 170


@dataclass(frozen=True)
class Table:
    """A table with a title above and notes below.

    Args:
        title: what it shows.
        columns: heads; the first ``texts`` of them are text, the others numbers.
        rows: as many cells as heads in each.
        notes: sentences that belong under it.
        texts: number of text columns.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()
    texts: int = 1


def show(found: Iterable[Table]) -> None:
    """Print tables on the terminal."""
    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    for table in found:
        drawn = RichTable(title=table.title, title_justify="left")
        for number, column in enumerate(table.columns):
            text = number < table.texts
            drawn.add_column(column, justify="left" if text else "right", overflow="fold")
        for row in table.rows:
            drawn.add_row(*row)
        console.print(drawn)
        for note in table.notes:
            console.print(note, style="dim")


def markdown_lines(found: Iterable[Table]) -> Iterator[str]:
    """Tables as lines of a page."""
    for table in found:
        yield from ("", f"## {table.title}", "")
        rule = [":--" if number < table.texts else "--:" for number in range(len(table.columns))]
        for row in (table.columns, rule, *table.rows):
            yield f"| {' | '.join(row)} |"
        for note in table.notes:
            yield from ("", note)


def times(record: dict[str, Any], parts: int = 1) -> str:
    """The shortest time and the median in milliseconds, of one of so many parts."""
    return f"{milliseconds(record['min_s'] / parts)} ({milliseconds(record['median_s'] / parts)})"


def milliseconds(seconds: float) -> str:
    """Three digits, or all before the point."""
    return f"{seconds * 1e3:.3g}" if seconds < 1 else f"{seconds * 1e3:.0f}"


def percent(share: float) -> str:
    """With one digit."""
    return f"{share:.1%}"


def number_or_none(value: float | None, form: str) -> str:
    """In a format, or a dash."""
    return NONE if value is None else format(value, form)
