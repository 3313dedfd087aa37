"""A whole run of the tests fails where it never launched a kernel or never began a command.

Both selections are held to it (see ``selection``), so that the short one goes on to touch
everything: whoever adds a kernel or a command adds a test that plain ``pytest`` runs. What
processes of their own do is not seen.

``--record-kernels FILE`` adds the macros of all kernels that the run launches to a file that
``tools/compile_gate.py`` reads.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import rift_cl as rift
from rift_cl.cl.build.source import kernel_names
from rift_cl.cl.program import Programs, literal

_touched: set[str] = set()
_WORKERS_KEY = "touched"
# A kernel, the kind of device and its macros, as in "adam gpu A=1 B=2".
_variants: set[str] = set()
_VARIANTS_KEY = "kernel variants"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let a run record what the kernels are built with."""
    parser.addoption(
        "--record-kernels",
        type=Path,
        metavar="FILE",
        help="add every set of macros that a kernel is launched with to this JSON file",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Take down what is launched and run in this process."""
    recorded = config.option.record_kernels
    if config.selection == "named" and not recorded:
        return
    from rift_cl.commands.cli import COMMANDS

    launch = Programs.launch

    def launch_and_note(
        self: Programs, name: str, size: tuple[int, ...], given: dict[str, Any]
    ) -> None:
        launch(self, name, size, given)
        _touched.add(f"kernel {name}")
        if recorded:
            _variants.add(_variant(self, name, given))

    Programs.launch = launch_and_note
    for name, entry in COMMANDS.items():
        COMMANDS[name] = entry._replace(run=_noted(name, entry.run))


def _variant(programs: Programs, name: str, given: dict[str, Any]) -> str:
    macros = (f"{macro}={literal(given[macro])}" for macro in sorted(given) if macro.isupper())
    kind = "cpu" if programs._device.traits.is_cpu else "gpu"
    return " ".join((name, kind, *macros))


def _record(path: Path) -> None:
    """Add what was launched to the file; kernels that are no more leave it."""
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []
    names = set(kernel_names())
    kept = sorted(line for line in {*known, *_variants} if line.split()[0] in names)
    path.write_text(json.dumps(kept, indent=0) + "\n", encoding="utf-8")


def _noted(name: str, run: Any) -> Any:
    def run_and_note(settings: Any, output: Any) -> None:
        # Before it runs: a viewer ends with Ctrl-C.
        _touched.add(f"rift {name}")
        run(settings, output)

    return run_and_note


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take over what a worker of pytest-xdist touched."""
    told = getattr(node, "workeroutput", {})
    _touched.update(told.get(_WORKERS_KEY, ()))
    _variants.update(told.get(_VARIANTS_KEY, ()))


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail where all passed and something was left out; a worker only tells its parent."""
    config = session.config
    if hasattr(config, "workeroutput"):
        config.workeroutput[_WORKERS_KEY] = sorted(_touched)
        config.workeroutput[_VARIANTS_KEY] = sorted(_variants)
        return
    if config.option.record_kernels:
        _record(config.option.record_kernels)
    if exitstatus == pytest.ExitCode.OK and _left_out(config):
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
