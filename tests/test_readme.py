"""What the README promises: its code runs, and its second command is what is checked."""

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


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
