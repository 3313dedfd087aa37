"""What tests of the tools share: a tool's modules, imported as its script does."""

import importlib
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def tool(monkeypatch):
    """Import a module as the script does."""
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module
