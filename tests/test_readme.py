"""What README and docs promise: code runs, and commands, options and links are there."""

import re
import shlex
from contextlib import redirect_stdout, suppress
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.io.scans.formats import SCAN_READERS
from rift_cl.metrics import psnr
from rift_cl.operators.filters.ramp_filters import FILTERS
from rift_cl.train.loss.pixel_loss import PIXEL_LOSSES
from rift_cl.train.strategy import STRATEGIES

ROOT = Path(__file__).parents[1]
SUFFIXES = (".py", ".md")
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
    *(ROOT / "docs").rglob("*.md"),
]
COMMANDS = [
    "devices",
    "demo",
    "reconstruct",
    "center",
    "fit",
    "eval",
    "render",
    "view",
    "export",
    "analyze",
    "sweep",
    "plan",
    "cache",
]
# Options of programs other than ours.
ELSEWHERE = {"--tyro-print-completion", "--extra", "--prefix", "--durations"}


def test_code_runs(capsys):
    code = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(code) == 5
    names = {}
    for block in code:
        if "import torch" not in block or find_spec("torch"):
            exec(block, names)
    printed = capsys.readouterr().out
    assert float(printed.split()[0]) > 20
    assert psnr(names["volume"], names["head"], peak=1.0) > 20
    assert names["gradients"].splats.means.shape == (1000, 3)


def test_what_contributors_are_shown_runs(tmp_path):
    """A filter, a reader of scans, a loss and a strategy of one's own, each by its name."""
    code = re.findall(r"```python\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)
    added = [
        (FILTERS, "soft"),
        (SCAN_READERS, ".raw16"),
        (PIXEL_LOSSES, "charbonnier"),
        (STRATEGIES, "fixed"),
    ]
    try:
        names = {}
        for block in code:
            exec(block, names)
        assert all(name in registry for registry, name in added)
    finally:
        for registry, name in added:
            if name in registry:
                registry.remove(name)
    path = tmp_path / "scan.raw16"
    np.ones((10, 64, 128), np.uint16).tofile(path)
    assert names["read_raw"](path, None).shape == (10, 64, 128)
    assert type(names["settings"].strategy).__name__ == "FixedSettings"


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


@pytest.fixture(scope="module")
def helps():
    """The help text of every command, by its name; of ``fit``, that of both kinds."""
    found = {}
    for name in (*COMMANDS, "fit photos", "fit xray"):
        with redirect_stdout(StringIO()) as printed, suppress(SystemExit):
            main([*name.split(), "--help"])
        found[name] = printed.getvalue()
        assert "--quiet" in found[name] or name == "fit"
    found["fit"] += found["fit photos"] + found["fit xray"]
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_on_a_page_has_only_options_that_there_are(page, helps):
    """The blocks of commands, up to their comments."""
    lines = re.findall(r"^    (rift [^-].*?)(?:\s{2,}#.*)?$", page.read_text(), re.MULTILINE)
    for line in lines:
        _, command, *words = shlex.split(line.rstrip("\\"))
        kind = " ".join([command, *words[:1]])
        command = kind if kind in helps else command
        options = [word for word in words if word.startswith("--")]
        assert [word for word in options if word not in helps[command]] == [], line


def test_every_option_that_a_text_names_is_one_of_a_command_or_a_tool(helps):
    known = set(re.findall(r"--[a-z][\w-]*", "".join(helps.values())))
    tools = "".join(path.read_text() for path in (ROOT / "tools").glob("*.py"))
    known |= {"--" + name.replace("_", "-") for name in re.findall(r"^    (\w+): ", tools, re.M)}
    for page in PAGES:
        code = re.findall(r"`(?!`)([^`]+)`", re.sub(r"```.*?```", "", page.read_text(), flags=re.S))
        named = {word for each in code for word in re.findall(r"(?<![\w-])--[a-z][\w-]*", each)}
        assert named - known - ELSEWHERE == set(), page.name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_links_to_exists(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        path, _, heading = link.partition("#")
        if path.startswith("https:"):
            continue
        target = page.parent / path if path else page
        assert target.exists(), link
        heads = re.findall(r"^#+ (.*)$", target.read_text(), re.MULTILINE) if heading else []
        anchors = {re.sub(r"[^\w -]", "", head).lower().replace(" ", "-") for head in heads}
        assert not heading or heading in anchors, link
