"""Which tests run: plain ``pytest`` takes one case of each test, ``pytest -m full`` takes them all.

A test with many parameters proves most of what it proves with the first of them, and every one of
them costs time, above all where each needs kernels of its own. So plain ``pytest`` runs each test
with the first of its parameters, on one kind of device (a file's tests all on the same one, so that
they share kernels). Two marks change that:

- ``full``: only ``pytest -m full`` runs the test; another one touches the same code at less cost.
- ``each``: plain ``pytest`` runs it with each of its parameters, for example once per file format.

Whoever names a file, a folder or a word of a test's name (``-k``) gets everything that is there.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

import pytest

MARKS = (
    "full: takes long, and only `pytest -m full` runs it",
    "each: plain `pytest` runs it with each of its parameters, not with the first alone",
)


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks; a worker of pytest-xdist is told what was asked of its parent."""
    for mark in MARKS:
        config.addinivalue_line("markers", mark)
    option = config.option
    config.selection = getattr(config, "workerinput", {}).get("selection") or (
        "full" if option.markexpr == "full" else "named" if _named(config) else "plain"
    )
    if option.markexpr == "full":
        option.markexpr = ""


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node) -> None:
    """Tell a worker what was asked; it is handed the paths of its tests in any case."""
    node.workerinput["selection"] = node.config.selection


def _named(config: pytest.Config) -> bool:
    option = config.option
    by_path = config.args_source is pytest.Config.ArgsSource.ARGS
    return bool(by_path or option.keyword or option.markexpr)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what plain ``pytest`` does not run."""
    if config.selection != "plain":
        return
    chosen = set(plain(items))
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    items[:] = [item for item in items if item in chosen]


def plain(items: Iterable[pytest.Item]) -> Iterable[pytest.Item]:
    """One case of each test, or every case where the test asks for it."""
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("full") is None:
            tests.setdefault(item.nodeid.split("[")[0], []).append(item)
    for cases in tests.values():
        yield from cases if cases[0].get_closest_marker("each") else [_one(cases)]


def _one(cases: list[pytest.Item]) -> pytest.Item:
    """The first case on the kind of device that the test's file is run on."""
    on_each = {case.callspec.id: case for case in cases if hasattr(case, "callspec")}
    devices = dict.fromkeys(
        case.callspec.params["device"].traits.is_cpu
        for case in on_each.values()
        if "device" in case.callspec.params
    )
    if not devices:
        return cases[0]
    kind = list(devices)[zlib.crc32(cases[0].path.name.encode()) % len(devices)]
    return next(c for c in cases if c.callspec.params["device"].traits.is_cpu is kind)
