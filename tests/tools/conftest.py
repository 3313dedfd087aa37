"""What tests of the tools share: a tool's modules, imported as its script does.

Tools are for who works on the package and are no part of it: only ``pytest -m full`` tests them.
"""

import importlib
import os
import runpy
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def tool(monkeypatch):
    """Import a module as the script does."""
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module


@pytest.fixture
def ended(monkeypatch, capsys):
    """Run a script in this process: its status, and what it said on stderr.

    For what ends before there is much work: a process of its own would load torch for one sentence.
    """

    def run(path, *arguments):
        monkeypatch.syspath_prepend(TOOLS)
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(path), run_name="__main__")
        return end.value.code, capsys.readouterr().err

    return run


def pytest_ignore_collect(config):
    """Spare plain ``pytest`` what importing these tests takes; None asks the others."""
    return True if config.selection == "plain" else None


def pytest_collection_modifyitems(items):
    """Mark the tests of this folder."""
    folder = f"{Path(__file__).parent}{os.sep}"
    for item in items:
        if str(item.path).startswith(folder):
            item.add_marker(pytest.mark.full)
