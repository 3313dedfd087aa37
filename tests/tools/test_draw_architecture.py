"""docs/explanation/architecture.md holds: its places exist, and its picture shows the tree."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "explanation" / "architecture.md"
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def drawing(tool):
    return tool("draw_architecture")


def test_things_live_where_the_page_says():
    rows = re.findall(r"^\| (.+?) \| `([^`]+)` \| `([^`]+)` \|$", PAGE.read_text(), re.MULTILINE)
    assert len(rows) > 30
    texts = {path: (ROOT / path).read_text() for _, path, _ in rows if (ROOT / path).exists()}
    assert [row for row in rows if row[2] not in texts.get(row[1], "")] == []


def test_folders_that_the_page_names_exist():
    rooms = r"`((?:io|reconstruct|operators|train|splat|sampling|cl)/[\w/.]+)`"
    named = re.findall(rooms, PAGE.read_text())
    assert len(named) > 20
    assert [name for name in named if not (ROOT / "rift_cl" / name).exists()] == []


def test_the_picture_shows_every_package_in_its_layer(drawing):
    """Run tools/draw_architecture.py again after adding a package."""
    drawn = {group.get("id") for group in ET.parse(PAGE.with_suffix(".svg")).iter(f"{SVG}g")}
    assert drawn == {name for row in drawing.layers() for name in row}
    assert drawn == drawing.files().keys() - {"__init__", "__main__"}


def test_the_same_sources_give_the_same_picture(drawing):
    assert drawing.picture() == drawing.picture()
    ET.fromstring(drawing.picture())


def test_files_that_import_a_package_are_counted_once(drawing, tmp_path):
    for name, text in {
        "high/one.py": "from rift_cl.low import a\nfrom rift_cl.low.deep import b\n",
        "high/two.py": "def f():\n    import rift_cl.low\n",
        "high/three.py": "from rift_cl import low\nfrom rift_cl.high import one\n",
        "low/deep.py": "import numpy\n",
        "low/shallow.py": "import numpy\n",
        "lowest/one.py": "from rift_cl.lowest import one\n",
    }.items():
        path = tmp_path / "rift_cl" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    rows = ("high", "low", "lowest")
    names = "".join(f'  "rift_cl.{name}",\n' for name in rows)
    (tmp_path / "pyproject.toml").write_text(f"layers = [\n{names}]\n")
    assert drawing.imports(tmp_path) == {("high", "low"): 3}
    assert drawing.table(tmp_path).splitlines()[2:] == ["| high | 3 |"]
    assert "3 files of high import low" in drawing.picture(tmp_path)
