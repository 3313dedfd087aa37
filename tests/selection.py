"""Which tests run: plain ``pytest`` takes one case of each test, ``pytest -m full`` takes them all.

A test with many parameters proves most of what it proves with the first of them, and every one of
them costs time, above all where each needs kernels of its own. So plain ``pytest`` runs each test
with the first of its parameters, on one kind of device (a file's tests all on the same one, so that
they share kernels). Marks change that:

- ``full``: only ``pytest -m full`` runs the test; another one touches the same code at less cost.
- ``each``: plain ``pytest`` runs it with each of its parameters, for example once per file format.
- ``dealt``: ``pytest -m full`` runs it with each row of its parameters on one kind of device. It
  puts kernels together that have tests of their own on every kind.

- ``variants``: builds many kernels, each for a launch or two. Where a CPU compiles them, it does so
  without optimization, which takes most of the time and changes nothing of our source; all of
  tests/splat is compiled so. What users get, optimized, is launched by the other folders and by
  every command.
- ``study``: no selection runs it. It computes a study of ``tools/`` at length, as whoever writes
  the figures down does, or goes again, in another way, through what a selection runs: tutorials as
  notebooks are, but for one, since their code and their commands are run as pages
  (``test_documents``). ``-m study`` runs all of them.

A test of four and more rows is dealt in any case: each kind of device gets half of them, and,
where there are several parameters, each value of every one.

``pytest -m rest`` is ``-m full`` without what the last plain ``pytest`` passed, for .ci/run, which
runs one after the other and installs optional packages in between. Tests that may do something else
once those are there are repeated: all of a file in which one looked for a package that was not
there, or started a process, of which nothing is seen.

Whoever names a file, a folder or a word of a test's name (``-k``) gets everything that is there,
unless ``-m plain`` asks for the short selection. All three selections run on all cores.
"""

from __future__ import annotations

import os
import sys
import zlib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest

MARKS = (
    "full: takes long, and only `pytest -m full` runs it",
    "each: plain `pytest` runs it with each of its parameters, not with the first alone",
    "once: a CPU runs it as a CPU alone; others test its kernels on every kind of device",
    "dealt: all cases together run each of its parameters once, on the devices in turn",
    "variants: builds many kernels for a launch or two each, without optimization on a CPU",
    "study: computes a study of tools/ at length; `pytest -m study` runs it, or whoever names it",
)
# A worker holds its compiled kernels and its data: up to some 2 GB each.
_WORKER_BYTES = 3 << 30
_MOST_WORKERS = 8
# From this many rows of parameters on, a row is run on one kind of device.
_MANY_ROWS = 4
# Where pytest's cache keeps what plain ``pytest`` passed.
_PASSED_KEY = "selection/passed"
_passed: set[str] = set()
# Files of tests whose results may depend on optional packages.
_open: set[str] = set()
_OPEN_KEY = "may depend on optional packages"
_PROCESSES = ("subprocess.Popen", "os.posix_spawn", "os.fork", "os.forkpty", "os.system")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Decide what was asked for; pytest-xdist tells each worker (see pytest_configure_node)."""
    option = config.option
    told = getattr(config, "workerinput", {}).get("selection")
    marked = option.markexpr if option.markexpr in ("plain", "full", "rest") else None
    if marked:
        option.markexpr = ""
    named = _named(config)
    config.selection = told or marked or ("named" if named else "plain")
    # Whether every test of the selection runs, so that what none of them touched is a fault.
    config.whole = config.selection in ("plain", "full") and not named
    if told is None and (config.selection != "named" or _names_a_folder(config)):
        _use_all_cores(config)


def _named(config: pytest.Config) -> bool:
    """Whether the command line says which tests it wants."""
    option = config.option
    by_path = config.args_source is pytest.Config.ArgsSource.ARGS
    words = (option.keyword, option.markexpr, option.deselect, getattr(option, "lf", False))
    return bool(by_path or any(words))


def _names_a_folder(config: pytest.Config) -> bool:
    """Whether the tests that the command line names are those of a whole folder, which are many."""
    by_path = config.args_source is pytest.Config.ArgsSource.ARGS
    return by_path and any(Path(each).is_dir() for each in config.args)


def _use_all_cores(config: pytest.Config) -> None:
    """Ask pytest-xdist for workers unless the command line says how many, or wants a debugger.

    Files stay together: their tests share compiled kernels and what their fixtures made.
    """
    option = config.option
    if getattr(option, "numprocesses", 0) is not None or option.usepdb or option.collectonly:
        return
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    # One more than cores, for tests wait as well: for processes, disks and browsers.
    workers = max(1, min((cores or 1) + 1, _memory() // _WORKER_BYTES, _MOST_WORKERS))
    if workers == 1:
        return
    # PoCL's threads of one worker would take every core from the others.
    os.environ.setdefault("POCL_MAX_PTHREAD_COUNT", str(max(2, (cores or 1) // workers)))
    option.numprocesses = workers
    if option.dist == "no":
        option.dist = "loadfile"
        # By default files of few tests come last, and some of those take longest.
        option.loadscopereorder = False


def _memory() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 2 * _WORKER_BYTES


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node) -> None:
    """Tell a worker what was asked of its parent; it is handed its tests' paths in any case."""
    node.workerinput["selection"] = node.config.selection


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks; a plain run notes what may depend on optional packages."""
    for mark in MARKS:
        config.addinivalue_line("markers", mark)
    if config.selection == "plain":
        notes = _Notes()
        config.pluginmanager.register(notes, "optional-packages")
        sys.meta_path.append(notes)
        sys.addaudithook(notes.hear)


class _Notes:
    """Which files have tests that may go otherwise where more packages are installed.

    What one test of a file made, others of it use, so that files are noted and not tests.
    """

    def __init__(self) -> None:
        self.files: set[str] = set()
        self.file = ""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Note that a package was looked for in vain: the last finder is asked only then."""
        if path is None:
            self.files.add(self.file)

    def hear(self, event: str, arguments: tuple[object, ...]) -> None:
        """Note that a process was started."""
        if event in _PROCESSES:
            self.files.add(self.file)

    def pytest_collectstart(self, collector: pytest.Collector) -> None:
        self.file = _file(collector.nodeid)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.file = _file(nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item):
        report = yield
        report.user_properties.append((_OPEN_KEY, _file(item.nodeid) in self.files))
        return report


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what the selection does not run."""
    if config.selection == "named":
        return
    offered = [item for item in items if item.get_closest_marker("study") is None]
    chosen = set((plain if config.selection == "plain" else dealt)(offered))
    if config.selection == "rest":
        passed = set(config.cache.get(_PASSED_KEY, ()) if hasattr(config, "cache") else ())
        chosen = {item for item in chosen if item.nodeid not in passed}
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    items[:] = [item for item in items if item in chosen]


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Take down what passed; reports of all workers come to their parent."""
    if report.failed:
        _passed.discard(report.nodeid)
    elif report.passed and report.when == "call":
        _passed.add(report.nodeid)
    if dict(report.user_properties).get(_OPEN_KEY):
        _open.add(_file(report.nodeid))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Keep what plain ``pytest`` passed for ``-m rest``."""
    config = session.config
    parent = not hasattr(config, "workerinput")
    if config.selection == "plain" and parent and hasattr(config, "cache"):
        kept = (nodeid for nodeid in _passed if _file(nodeid) not in _open)
        config.cache.set(_PASSED_KEY, sorted(kept))


def _file(nodeid: str) -> str:
    return nodeid.split("::", maxsplit=1)[0]


def plain(items: Iterable[pytest.Item]) -> Iterable[pytest.Item]:
    """One case of each test, or every case where the test asks for it."""
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("full") is None:
            tests.setdefault(item.nodeid.split("[")[0], []).append(item)
    for cases in tests.values():
        yield from cases if cases[0].get_closest_marker("each") else [_one(cases)]


def dealt(items: Iterable[pytest.Item]) -> Iterable[pytest.Item]:
    """Every case, but of a test that is ``dealt``, or has many rows, each row on one device."""
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if _is_cpu(item) is None:
            yield item
        else:
            tests.setdefault(item.nodeid.split("[")[0], []).append(item)
    for name, cases in tests.items():
        devices = list(dict.fromkeys(id(case.callspec.params["device"]) for case in cases))
        rows = _dealt_rows(map(_row, cases), len(devices), zlib.crc32(name.encode()))
        dealt = cases[0].get_closest_marker("dealt") is not None or len(rows) >= _MANY_ROWS
        for case in cases:
            device = devices.index(id(case.callspec.params["device"]))
            if not dealt or rows[_row(case)] == device:
                yield case


def _row(case: pytest.Item) -> tuple[tuple[str, int], ...]:
    """A row of parameters without the device; values are the same objects for each device."""
    params = case.callspec.params.items()
    return tuple((name, id(value)) for name, value in params if name != "device")


def _dealt_rows(
    rows: Iterable[tuple[tuple[str, int], ...]], devices: int, turn: int
) -> dict[tuple[tuple[str, int], ...], int]:
    """The device of each row: that on which its values, then all rows, were had least often.

    So every value of each of several parameters is had on every device, though not beside every
    value of the others. Tests of one row begin on different devices, always the same (``turn``).
    """
    chosen: dict[tuple[tuple[str, int], ...], int] = {}
    had: Counter[tuple[object, int]] = Counter()
    for row in rows:
        if row in chosen:
            continue
        order = {n: (sum(had[v, n] for v in row), had[None, n], (n + turn) % devices)
                 for n in range(devices)}  # fmt: skip
        chosen[row] = min(order, key=lambda n: order[n])
        had.update((value, chosen[row]) for value in (None, *row))
    return chosen


def _one(cases: list[pytest.Item]) -> pytest.Item:
    """The first case on the kind of device that the test's file is run on."""
    kinds = list(dict.fromkeys(kind for kind in map(_is_cpu, cases) if kind is not None))
    if not kinds:
        return cases[0]
    kind = kinds[zlib.crc32(cases[0].path.name.encode()) % len(kinds)]
    return next(case for case in cases if _is_cpu(case) is kind)


def _is_cpu(case: pytest.Item) -> bool | None:
    """Whether a case runs as on a CPU; None where it asks for no device."""
    parameters = case.callspec.params if hasattr(case, "callspec") else {}
    return parameters["device"].traits.is_cpu if "device" in parameters else None
