"""What tests of the tools share: a tool's modules, imported as its script does.

Tools are for who works on the package and are no part of it: only ``pytest -m full`` tests them.
"""

import importlib
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def tool(monkeypatch):
    """Import a module as the script does."""
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module


def pytest_collection_modifyitems(items):
    """Mark the tests of this folder."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.full)
