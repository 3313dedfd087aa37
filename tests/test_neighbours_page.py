"""docs/how-to/neighbours.md: every block of code runs where its package is installed."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "neighbours.md"
FIRST, *BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
OTHERS = ("torch", "jax", "pylops", "odl")


@pytest.fixture(scope="module")
def names():
    made = {}
    exec(FIRST, made)
    return made


def subject(block):
    """The last name that the block imports, which tells what it is about."""
    return (re.findall(r"(?:from|import) ([\w.]+)", block) or ["rift_cl.show"])[-1]


@pytest.mark.each
@pytest.mark.filterwarnings("ignore")  # ODL's, of what Python and NumPy have given up
@pytest.mark.parametrize("block", BLOCKS, ids=subject)
def test_a_block_runs(block, names, tmp_path, monkeypatch):
    wanted = re.findall(r"^import (\w+)", block, re.MULTILINE)
    wanted += ["xarray"] if "rift_cl.interop.xarray" in block else []
    missing = [name for name in wanted if find_spec(name) is None]
    if missing:
        pytest.skip(f"{missing[0]} is not installed")
    monkeypatch.chdir(tmp_path)
    exec(block, dict(names))


def test_the_page_shows_each_neighbour():
    assert {name for name in OTHERS if any(f"import {name}\n" in b for b in BLOCKS)} == {*OTHERS}
    assert any("interop.xarray" in block for block in BLOCKS)
    assert any("napari_reader" in block for block in BLOCKS)
