"""tools/README.md names every command and every folder once."""

import re
from pathlib import Path

TOOLS = Path(__file__).parents[2] / "tools"


def test_every_command_and_folder_is_named_once():
    text = (TOOLS / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+\.py)` \|", text, re.MULTILINE)
    assert sorted(rows) == sorted(path.name for path in TOOLS.glob("*.py"))
    folders = {path.name for path in TOOLS.iterdir() if (path / "__init__.py").is_file()}
    assert sorted(re.findall(r"`(\w+)/`", text)) == sorted(folders)


def test_every_file_at_the_top_is_a_command():
    assert [
        p.name for p in TOOLS.glob("*.py") if '__name__ == "__main__"' not in p.read_text()
    ] == []
