"""Progress on stderr: a bar with rate and time left on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from contextlib import suppress

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from rift_cl.progress import Report

# Plain lines come no closer together than this, in seconds, except the last.
_PAUSE = 5.0


def show_progress(reports: Iterable[Report], *, quiet: bool) -> None:
    """Run a generator of reports to its end and show where it stands."""
    if quiet:
        for _ in reports:
            pass
    elif sys.stderr is not None and sys.stderr.isatty():
        _draw_bar(reports)
    else:
        _print_lines(reports)


def _draw_bar(reports: Iterable[Report]) -> None:
    columns = (
        BarColumn(),
        TextColumn("{task.completed}/{task.total} {task.description}"),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("", rate="")
        begin = time.monotonic()
        for report in reports:
            rate = _rate(report, time.monotonic() - begin)
            progress.update(
                task,
                completed=report.done,
                total=report.total,
                description=f"{report.what}{_figures(report)}",
                rate=rate,
            )


def _print_lines(reports: Iterable[Report]) -> None:
    begin, last = time.monotonic(), -_PAUSE
    for report in reports:
        elapsed = time.monotonic() - begin
        if elapsed - last < _PAUSE and report.done < report.total:
            continue
        last = elapsed
        left = elapsed / report.done * (report.total - report.done) if report.done else None
        parts = [f"{report.done}/{report.total} {report.what}", _rate(report, elapsed)]
        parts += [f"{left:.0f} s left"] if left else []
        line = ", ".join(part for part in parts if part) + _figures(report)
        print_line(line)


def print_line(line: str) -> None:
    """Print a line to stderr; a closed or full stderr must not end the work."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(line, file=sys.stderr, flush=True)


def _rate(report: Report, elapsed: float) -> str:
    return f"{report.done / elapsed:.3g} {report.what}/s" if report.done and elapsed > 0 else ""


def _figures(report: Report) -> str:
    return "".join(f", {name} {value:.6g}" for name, value in report.values.items())
