"""Progress: a bar with rate and time left on a terminal or in a notebook, else lines on stderr.

Kernels that are built between two steps are told as well, once that takes longer than a second.
"""

from __future__ import annotations

import io
import math
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from html import escape
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from rift_cl.progress import BUILDS, Report

# Plain lines come no closer together than this, in seconds, except the last.
_PAUSE = 5.0
# Seconds between two pictures of a bar in a notebook.
_REFRESH = 0.2
# Seconds of building between two reports from which on it is told, and between two looks at it.
_WORTH_TELLING, _LOOK = 1.0, 0.25
# Share of the work so far that counts as later, of it the share that is taken for undisturbed, and
# the least share of all work that makes a stretch. Measured with ``tools/time_left.py``.
_LATER, _QUICK, _SHORTEST = 0.7, 1 / 3, 1 / 400


class Pace:
    """Steps per second since the first report of steps of a kind, and the seconds that are left.

    What was done before that report may be an earlier run's, and took no time of this one. Time
    goes by in stretches between reports. The time left goes by the pace that a third of the later
    stretches reach or surpass: the first steps of a fit are slow, and what happens now and then,
    as a kernel that is built or another program that runs, only ever makes a stretch longer.

    Args:
        clock: seconds; those of the wall if not given.
    """

    def __init__(self, clock: Callable[[], float] | None = None) -> None:
        self._clock = clock or time.monotonic
        self._what, self._done, self._first = "", 0, 0
        # Work and time at the first report and at the last one that ended a stretch.
        self._begin = self._last = (0.0, 0.0)
        # Of each stretch that still counts: work at its end, its work, its seconds.
        self._stretches: deque[tuple[float, float, float]] = deque()

    def after(self, report: Report) -> tuple[float, float]:
        """The rate after this report and the seconds left; 0 while there is none to tell."""
        done, total = report.work or (float(report.done), float(report.total))
        now = self._clock()
        if report.what != self._what or report.done < self._done:
            self._what, self._first = report.what, report.done
            self._begin = self._last = (done, now)
            self._stretches.clear()
        self._done = report.done
        self._end_stretch(done, now, total)
        elapsed = now - self._begin[1]
        rate = (report.done - self._first) / elapsed if elapsed > 0 else 0.0
        return rate, (total - done) * self._seconds_of_work()

    def _end_stretch(self, done: float, now: float, total: float) -> None:
        """Note a stretch that is long enough, and forget those that are too early to count."""
        work, seconds = done - self._last[0], now - self._last[1]
        if work <= 0 or (self._stretches and work < total * _SHORTEST):
            return
        self._stretches.append((done, work, seconds))
        self._last = (done, now)
        oldest = self._begin[0] + (1 - _LATER) * (done - self._begin[0])
        while len(self._stretches) > 1 and self._stretches[0][0] <= oldest:
            self._stretches.popleft()

    def _seconds_of_work(self) -> float:
        """Seconds that a unit of work takes; 0 before there is a stretch."""
        paces = sorted((seconds / work, work) for _, work, seconds in self._stretches)
        wanted = _QUICK * sum(work for _, work in paces)
        for pace, work in paces:
            wanted -= work
            if wanted <= 0:
                return pace
        return 0.0


def show_progress(reports: Iterable[Report], *, quiet: bool) -> None:
    """Run a generator of reports to its end, and show progress."""
    display = _notebook_display()
    if quiet:
        for _ in reports:
            pass
    elif display is not None:
        _draw_in_notebook(reports, display)
    elif sys.stderr is not None and sys.stderr.isatty():
        _draw_bar(reports)
    else:
        _print_lines(reports)


class BuildsBetween:
    """The building of kernels since the last report, in words."""

    def __init__(self) -> None:
        self.reported()

    def reported(self) -> None:
        """Begin again: a step of the work is done."""
        self._seconds, self._kernels = BUILDS.seconds, BUILDS.kernels

    def told(self) -> str:
        """What is being built, where building takes long; else nothing."""
        kernel, seconds = BUILDS.now, BUILDS.seconds - self._seconds
        if not kernel or seconds < _WORTH_TELLING:
            return ""
        done = BUILDS.kernels - self._kernels
        return f"building kernels: {done} in {seconds:.0f} s, now {kernel}"


class _BuildColumn(ProgressColumn):
    """The building of kernels, on a terminal."""

    def __init__(self, builds: BuildsBetween) -> None:
        super().__init__()
        self._builds = builds

    def render(self, task: Task) -> Text:
        return Text(self._builds.told())


@contextmanager
def _lines_of_builds(builds: BuildsBetween) -> Iterator[None]:
    """Print lines of the building of kernels while the work goes on."""
    over = threading.Event()

    def watch() -> None:
        last = -math.inf
        while not over.wait(_LOOK):
            told = builds.told()
            if told and time.monotonic() - last >= _PAUSE:
                last = time.monotonic()
                print_line(told)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


def _draw_bar(reports: Iterable[Report]) -> None:
    builds = BuildsBetween()
    columns = (
        BarColumn(),
        TextColumn("{task.completed}/{task.total} {task.description}"),
        TextColumn("{task.fields[pace]}"),
        _BuildColumn(builds),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task, pace = progress.add_task("", pace=""), Pace()
        for report in reports:
            builds.reported()
            progress.update(
                task,
                completed=report.done,
                total=report.total,
                description=f"{report.what}{_figures(report)}",
                pace=", ".join(_told(report, *pace.after(report))),
            )


def _notebook_display() -> Callable[..., Any] | None:
    """IPython's ``display`` where the kernel of a notebook runs this; else None."""
    ipython = sys.modules.get("IPython")
    if ipython is None or not hasattr(ipython.get_ipython(), "kernel"):
        return None
    show: Callable[..., Any] = ipython.display.display
    return show


def _draw_in_notebook(reports: Iterable[Report], display: Callable[..., Any]) -> None:
    """One bar below the cell, of HTML's own, with the same words as text for who sees none."""
    pace, last, handle = (
        Pace(),
        -math.inf,
        display(_notebook_bar(None, ""), raw=True, display_id=True),
    )
    for report in reports:
        told, now = _told(report, *pace.after(report)), time.monotonic()
        if now - last >= _REFRESH or report.done >= report.total:
            last = now
            words = ", ".join([f"{report.done}/{report.total} {report.what}", *told])
            handle.update(_notebook_bar(report, words + _figures(report)), raw=True)


def _notebook_bar(report: Report | None, words: str) -> dict[str, str]:
    """What a notebook shows of a report; before the first, a bar that is at work."""
    where = "" if report is None else f" value='{report.done}' max='{max(report.total, 1)}'"
    said = escape(words or "begins")
    bar = f"<progress aria-label='Progress'{where} style='width:20em;max-width:100%'></progress>"
    return {"text/html": f"<div>{bar} {said}</div>", "text/plain": words or "begins"}


def _print_lines(reports: Iterable[Report]) -> None:
    pace, last, builds = Pace(), -math.inf, BuildsBetween()
    with _lines_of_builds(builds):
        for report in reports:
            builds.reported()
            told, now = _told(report, *pace.after(report)), time.monotonic()
            if now - last < _PAUSE and report.done < report.total:
                continue
            last = now
            parts = [f"{report.done}/{report.total} {report.what}", *told]
            print_line(", ".join(parts) + _figures(report))


def _told(report: Report, rate: float, left: float) -> list[str]:
    """The rate and the time left, where there is a rate."""
    told = [f"{rate:.3g} {report.what}/s"] if rate else []
    return told + ([f"{left:.0f} s left"] if left and report.done < report.total else [])


def print_any_text() -> None:
    """Let a terminal without the signs of a text show their numbers, where Python would give up.

    ASCII has no degree sign, and a file's name need not be UTF-8.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def print_line(line: str) -> None:
    """Print a line to stderr; a closed or full stderr must not end the work."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(line, file=sys.stderr, flush=True)


def _figures(report: Report) -> str:
    return "".join(f", {name} {value:.6g}" for name, value in report.values.items())
