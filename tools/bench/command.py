"""What every benchmark does with its record: it is kept after each case, and shown at the end."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import rift_cl as rift
from bench.costs import CoverageError
from bench.history import Record, keep, kept
from bench.table import Table, show
from rift_cl.io import write_text


def say(text: str) -> None:
    """A line about what is being measured now."""
    print(text, file=sys.stderr, flush=True)


def report(
    name: str,
    records: Iterable[Record],
    *,
    json_file: Path | None,
    markdown_file: Path | None,
    page: Callable[[Record], str],
    tables: Callable[[Record], Iterable[Table]],
    keep_in: Path | None = None,
    kept: Callable[[Record], Record] = kept,
) -> int:
    """Write every record as it grows, print the tables of the last one; the exit status.

    Args:
        name: of the tool.
        records: all that was measured so far, after each case.
        json_file: for the record, if it is wanted.
        markdown_file: for the page, if there is to be one.
        page: of a record.
        tables: of a record.
        keep_in: folder for the last record by date, if it is to be kept.
        kept: what is kept of it.
    """
    record: Record = {}
    try:
        for record in records:
            if json_file is not None:
                write_text(json_file, json.dumps(record, indent=1) + "\n")
            if markdown_file is not None:
                write_text(markdown_file, page(record))
    except (rift.RiftError, CoverageError) as error:
        say(f"{name}: {error}")
        return error.exit_status if isinstance(error, rift.RiftError) else 1
    if keep_in is not None:
        say(f"kept as {keep(record, keep_in, kept)}")
    show(tables(record))
    return 0
