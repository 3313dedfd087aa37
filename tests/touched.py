"""A whole run of the tests fails where it never launched a kernel or never began a command.

Both selections are held to it (see ``selection``), so that the short one goes on to touch
everything: whoever adds a kernel or a command adds a test that plain ``pytest`` runs. What
processes of their own do is not seen.
"""

from __future__ import annotations

from typing import Any

import pytest

import rift_cl as rift
from rift_cl.cl.program import Programs
from rift_cl.cl.source import kernel_names

_touched: set[str] = set()
_WORKERS_KEY = "touched"


def pytest_configure(config: pytest.Config) -> None:
    """Take down what is launched and run in this process."""
    if config.selection == "named":
        return
    from rift_cl.commands.cli import COMMANDS

    launch = Programs.launch

    def launch_and_note(self: Programs, name: str, *rest: Any, **named: Any) -> None:
        launch(self, name, *rest, **named)
        _touched.add(f"kernel {name}")

    Programs.launch = launch_and_note
    for name, entry in COMMANDS.items():
        COMMANDS[name] = entry._replace(run=_noted(name, entry.run))


def _noted(name: str, run: Any) -> Any:
    def run_and_note(settings: Any, output: Any) -> None:
        # Before it runs: a viewer ends with Ctrl-C.
        _touched.add(f"rift {name}")
        run(settings, output)

    return run_and_note


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take over what a worker of pytest-xdist touched."""
    _touched.update(getattr(node, "workeroutput", {}).get(_WORKERS_KEY, ()))


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail where all passed and something was left out; a worker only tells its parent."""
    config = session.config
    if hasattr(config, "workeroutput"):
        config.workeroutput[_WORKERS_KEY] = sorted(_touched)
    elif exitstatus == pytest.ExitCode.OK and _left_out(config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Name what was left out."""
    missing = _left_out(config)
    if missing:
        terminalreporter.section(f"no test of the {config.selection} selection touched")
        terminalreporter.line(", ".join(missing))


def _left_out(config: pytest.Config) -> list[str]:
    if not config.whole or config.option.collectonly:
        return []
    from rift_cl.commands.cli import COMMANDS

    wanted = {f"rift {name}" for name in COMMANDS} | {f"kernel {name}" for name in _kernels()}
    return sorted(wanted - _touched)


def _kernels() -> list[str]:
    """Every kernel but the drivers for CPUs where there is none; a CPU is tested as a GPU too."""
    on_cpu = any(device.traits.is_cpu for device in rift.devices())
    return [name for name in kernel_names() if on_cpu or not name.endswith("_cpu")]
