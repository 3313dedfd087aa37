"""What the README promises: its code runs, and its second command is what is checked."""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

from rift_cl.commands.cli import main

ROOT = Path(__file__).parents[1]
SUFFIXES = (".py", ".md")


def test_code_runs(capsys):
    code = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(code) == 4
    names = {}
    for block in code:
        if "import torch" not in block or find_spec("torch"):
            exec(block, names)
    printed = capsys.readouterr().out
    assert float(printed.split()[0]) > 20
    assert names["gradients"].splats.means.shape == (1000, 3)


def test_checks_call_the_second_command():
    checks = ROOT / ".ci" / "run"
    if not checks.exists():
        pytest.skip("the checks are not part of a source distribution")
    readme = (ROOT / "README.md").read_text()
    commands = re.findall(r"^    python3 -m venv .*$", readme, re.MULTILINE)
    assert len(commands) == 2
    second = commands[1].split("activate && ")[1]
    assert f"\n{second}\n" in checks.read_text()


def sources():
    """What people read, and what talks to them."""
    folders = (ROOT / name for name in ("rift_cl", "tools", "docs"))
    found = [path for folder in folders for path in folder.rglob("*") if path.suffix in SUFFIXES]
    return [ROOT / "README.md", *found]


def test_whatever_is_to_be_installed_is_on_an_index():
    """This package is on none yet, so that its extras are installed from its source alone."""
    wrong = [path for path in sources() if "install 'rift-cl" in path.read_text()]
    assert not wrong, f"say which package is wanted: {wrong}"


def test_extras_that_are_named_exist():
    declared = set(re.findall(r"^(\w+) = \[", (ROOT / "pyproject.toml").read_text(), re.MULTILINE))
    named = {
        name
        for path in sources()
        for names in re.findall(r"'\.\[([\w,]+)\]'", path.read_text())
        for name in names.split(",")
    }
    assert {"test", "capture", "view", "film"} <= named <= declared


def test_every_command_in_the_readme_has_only_options_that_there_are(capsys):
    """The blocks of commands, up to their comments."""
    lines = re.findall(
        r"^    (rift .*?)(?:\s{2,}#.*)?$", (ROOT / "README.md").read_text(), re.MULTILINE
    )
    assert len(lines) > 15
    helps = {}
    for line in lines:
        _, command, *words = shlex.split(line)
        if command not in helps:
            with pytest.raises(SystemExit, match="0"):
                main([command, "--help"])
            helps[command] = capsys.readouterr().out
        for word in words:
            if word.startswith("--"):
                assert word in helps[command], f"{line}: {word}"
