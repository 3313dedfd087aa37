"""``pytest --costs`` prints the processor time of each file's tests, most costly first.

Processor time of the tests' process, of its threads and of the processes that it started: unlike
the clock on the wall it says the same on a busy machine. What a fixture of the whole session costs
is counted for the file that asked first.
"""

from __future__ import annotations

import os
from collections import Counter

import pytest

_ROWS = 40


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption("--costs", action="store_true", help="print each test file's processor time")


def pytest_configure(config: pytest.Config) -> None:
    """Count where it was asked for; workers of pytest-xdist are given the same options."""
    if config.option.costs:
        config.pluginmanager.register(_Costs(), "costs-counter")


def _spent() -> float:
    """Processor seconds of this process and of those of its children that have ended."""
    return sum(os.times()[:4])


class _Costs:
    def __init__(self) -> None:
        self.before = _spent()
        self.seconds: Counter[str] = Counter()
        self.tests: Counter[str] = Counter()

    @pytest.hookimpl(wrapper=True)
    def pytest_collection(self):
        result = yield
        self.before = _spent()
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self):
        report = yield
        now = _spent()
        report.user_properties.append(("processor seconds", now - self.before))
        self.before = now
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        file = report.nodeid.split("::")[0]
        self.seconds[file] += dict(report.user_properties)["processor seconds"]
        self.tests[file] += report.when == "call"

    def pytest_terminal_summary(self, terminalreporter) -> None:
        total = sum(self.seconds.values())
        terminalreporter.section(f"{total:.0f} s of processor time in tests")
        for file, seconds in self.seconds.most_common(_ROWS):
            terminalreporter.line(f"{seconds:8.1f} s {self.tests[file]:6d} tests  {file}")
