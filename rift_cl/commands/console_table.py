"""Tables on standard output: what a command found, for a person to read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

# Columns of a terminal whose width is not known.
_WIDTH = 80


def print_table(
    columns: Sequence[str], rows: Iterable[Sequence[Any]], *, caption: str = ""
) -> None:
    """Print a table; numbers have four digits that count, and None is a dash."""
    table = Table(*columns, caption=caption or None, caption_justify="left")
    for row in rows:
        table.add_row(*map(_text, row))
    console = Console()
    # Some shells and schedulers say that a terminal has no columns: they know of none.
    console.width = console.width or _WIDTH
    console.print(table)


def _text(cell: Any) -> str:
    if cell is None:
        return "\N{EN DASH}"
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)
