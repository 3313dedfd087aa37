"""Progress on stderr: a bar with rate and time left on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterable
from contextlib import suppress

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from rift_cl.progress import Report

# Plain lines come no closer together than this, in seconds, except the last.
_PAUSE = 5.0


class _Pace:
    """Steps per second since the first report of steps of a kind.

    What was done before that report may be an earlier run's, and took no time of this one.
    """

    def __init__(self) -> None:
        self._what, self._done = "", 0
        self._first, self._begin = 0, 0.0

    def after(self, report: Report) -> float:
        """The rate after this report; 0 while there is none to tell."""
        now = time.monotonic()
        if report.what != self._what or report.done < self._done:
            self._what, self._first, self._begin = report.what, report.done, now
        self._done = report.done
        elapsed = now - self._begin
        return (report.done - self._first) / elapsed if elapsed > 0 else 0.0


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
        TextColumn("{task.fields[pace]}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task, pace = progress.add_task("", pace=""), _Pace()
        for report in reports:
            progress.update(
                task,
                completed=report.done,
                total=report.total,
                description=f"{report.what}{_figures(report)}",
                pace=", ".join(_told(report, pace.after(report))),
            )


def _print_lines(reports: Iterable[Report]) -> None:
    pace, last = _Pace(), -math.inf
    for report in reports:
        rate, now = pace.after(report), time.monotonic()
        if now - last < _PAUSE and report.done < report.total:
            continue
        last = now
        parts = [f"{report.done}/{report.total} {report.what}", *_told(report, rate)]
        print_line(", ".join(parts) + _figures(report))


def _told(report: Report, rate: float) -> list[str]:
    """The rate and the time left, where there is a rate."""
    left = report.total - report.done
    told = [f"{rate:.3g} {report.what}/s"] if rate else []
    return told + ([f"{left / rate:.0f} s left"] if rate and left else [])


def print_line(line: str) -> None:
    """Print a line to stderr; a closed or full stderr must not end the work."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(line, file=sys.stderr, flush=True)


def _figures(report: Report) -> str:
    return "".join(f", {name} {value:.6g}" for name, value in report.values.items())
