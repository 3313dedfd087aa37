"""Progress on stderr: rates and times left are of the run that is seen, whatever was done before.

The clock is ours, so that rates are exact.
"""

from __future__ import annotations

import sys
from threading import Event
from types import SimpleNamespace

import pytest

from rift_cl import progress
from rift_cl.commands import progress_bar
from rift_cl.commands.progress_bar import BuildsBetween, show_progress
from rift_cl.progress import Builds, Report


@pytest.fixture
def clock(monkeypatch):
    """Reports of work whose steps take the time that they say."""

    class Clock:
        now = 1000.0

        def monotonic(self):
            return self.now

        def reports(self, steps):
            for seconds, *report in steps:
                self.now += seconds
                yield Report(*report)

    clock = Clock()
    monkeypatch.setattr(progress_bar, "time", clock)
    return clock


def shown(clock, capsys, *steps):
    """The lines of reports (seconds before it, done, total, what)."""
    show_progress(clock.reports(steps), quiet=False)
    return capsys.readouterr().err.splitlines()


def test_the_rate_is_that_of_the_steps_since_the_first_report(clock, capsys):
    steps = [(0, 0, 40, "slices"), (10, 10, 40, "slices"), (30, 40, 40, "slices")]
    assert shown(clock, capsys, *steps) == [
        "0/40 slices",
        "10/40 slices, 1 slices/s, 30 s left",
        "40/40 slices, 1 slices/s",
    ]


def test_steps_of_an_earlier_run_are_not_counted(clock, capsys):
    # Gone on after 2000 steps, of which the first report tells when the kernels stand.
    steps = [(60, 2050, 3000, "steps"), (10, 2100, 3000, "steps"), (40, 2300, 3000, "steps")]
    assert shown(clock, capsys, *steps) == [
        "2050/3000 steps",
        "2100/3000 steps, 5 steps/s, 180 s left",
        "2300/3000 steps, 5 steps/s, 140 s left",
    ]


def test_every_kind_of_step_has_its_own_rate(clock, capsys):
    steps = [(0, 0, 100, "steps"), (50, 100, 100, "steps")]
    steps += [(3, 1, 6, "views"), (6, 3, 6, "views"), (9, 6, 6, "views"), (9, 1, 6, "views")]
    steps += [(20, 2, 6, "views")]
    assert shown(clock, capsys, *steps)[1:] == [
        "100/100 steps, 2 steps/s",
        "3/6 views, 0.333 views/s, 9 s left",
        "6/6 views, 0.333 views/s",
        "1/6 views",
        "2/6 views, 0.05 views/s, 80 s left",
    ]


def test_lines_between_are_left_out_but_count(clock, capsys):
    steps = [(0, 0, 60, "steps"), *((1, done, 60, "steps") for done in range(1, 11))]
    assert shown(clock, capsys, *steps) == [
        "0/60 steps",
        "5/60 steps, 1 steps/s, 55 s left",
        "10/60 steps, 1 steps/s, 50 s left",
    ]


def test_work_that_no_time_passes_in_has_no_rate(clock, capsys):
    steps = [(0, 0, 2, "steps"), (0, 2, 2, "steps")]
    assert shown(clock, capsys, *steps) == ["0/2 steps", "2/2 steps"]


def test_a_terminal_shows_the_same_rate(clock, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    steps = [(60, 2050, 3000, "steps"), (10, 2100, 3000, "steps")]
    printed = "\n".join(shown(clock, capsys, *steps))
    assert "2100/3000 steps" in printed and " 5 steps/s, 180 s left" in printed


def test_who_is_quiet_prints_nothing(clock, capsys):
    show_progress(clock.reports([(0, 1, 1, "steps")]), quiet=True)
    assert capsys.readouterr().err == ""


def test_kernels_that_take_long_to_build_are_told_until_the_next_report(monkeypatch):
    now, found = [0.0], Builds()
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(progress_bar, "BUILDS", found)
    builds = BuildsBetween()
    with found.of("adam"):
        now[0] += 0.9
        assert builds.told() == ""
    with found.of("ssim_map"):
        now[0] += 0.3
        assert builds.told() == "building kernels: 1 in 1 s, now ssim_map"
        builds.reported()
        assert builds.told() == ""
    now[0] += 100
    assert builds.told() == "", "nothing is being built"


def test_lines_tell_of_kernels_while_the_work_waits_for_them(capsys, monkeypatch):
    found, told = Builds(), Event()
    monkeypatch.setattr(progress_bar, "BUILDS", found)
    monkeypatch.setattr(progress_bar, "_WORTH_TELLING", 0.0)
    monkeypatch.setattr(progress_bar, "_LOOK", 0.001)
    say = progress_bar.print_line

    def said(line):
        say(line)
        if "building" in line:
            told.set()

    monkeypatch.setattr(progress_bar, "print_line", said)

    def work():
        with found.of("adam"):
            assert told.wait(60)
        yield Report(1, 1, "steps")

    show_progress(work(), quiet=False)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["building kernels: 0 in 0 s, now adam", "1/1 steps"]
