"""What README and docs promise: code and tutorials run; commands, options and links are there."""

import ast
import importlib
import json
import re
import shlex
from contextlib import redirect_stdout, suppress
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.basis.angular import ANGULAR_BASES
from rift_cl.commands.cli import COMMANDS, main
from rift_cl.io.scans.formats import SCAN_READERS
from rift_cl.metrics import psnr
from rift_cl.operators.filters.ramp_filters import FILTERS
from rift_cl.train.loss.pixel_loss import PIXEL_LOSSES
from rift_cl.train.strategy import STRATEGIES

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
SUFFIXES = (".py", ".md")
PAGES = sorted(
    [
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "examples/README.md")),
        *(page for page in DOCS.rglob("*.md") if page.parent.name != "generated"),
    ]
)
# Tables whose command was not written down when they were printed; there must be no others.
UNTOLD = {
    ("homogenisation.md", "Short fits"),
    ("export.md", "What other viewers cannot render"),
}
# Tutorials with what makes them small enough for a test.
TUTORIALS = {
    "operators": {},
    "scan": {"--method tv --nonnegative": "--method tv --nonnegative --steps 5"},
    "own_parts": {
        "steps=60": "steps=10",
        "sample.ornament()": "sample.ornament_off_path()",
        "steps=200, splats=1000, downscale=4": "steps=2, splats=100, downscale=8",
    },
    "photographs": {
        "--out fit --dry-run": "--out fit --dry-run --steps 20 --splats 300 --downscale 4",
        "--steps 1500 --splats 4000": "--steps 20 --splats 300 --downscale 4",
        "--frames 24": "--frames 2",
    },
}
# Options of programs other than ours.
ELSEWHERE = {
    "--tyro-print-completion",
    "--extra",
    "--prefix",
    "--durations",
    "--costs",
    "--preload",
    "--index-url",
}


@pytest.fixture
def run_page(monkeypatch):
    """Runs the blocks of a page as tools/run_page.py does."""
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("run_page").run_page


def test_code_runs(run_page, tmp_path, capsys):
    names = run_page(DOCS / "how-to/python.md", tmp_path)
    printed = capsys.readouterr().out
    assert float(printed.split()[0]) > 20
    assert psnr(names["volume"], names["head"], peak=1.0) > 20
    assert names["gradients"].splats.means.shape == (1000, 3)


@pytest.mark.timeout(1200)  # kernels of many kinds, and nothing that a slow machine could miss
@pytest.mark.parametrize("name", TUTORIALS)
def test_a_tutorial_runs_from_top_to_bottom(name, run_page, tmp_path):
    try:
        names = run_page(DOCS / f"tutorials/{name}.md", tmp_path, TUTORIALS[name])
    finally:
        for registry, added in (
            (FILTERS, "butterworth"),
            (PIXEL_LOSSES, "charbonnier"),
            (ANGULAR_BASES, "cosine"),
        ):
            if added in registry:
                registry.remove(added)
    if name == "own_parts":
        kernels = re.findall(
            r"`((?:radon|plane)\w+)`", (DOCS / "tutorials/own_parts.md").read_text()
        )
        assert {"radon_project", *kernels} <= set(names["fresh"].kernels)
    if name == "operators":
        errors = [psnr(image, names["truth"], peak=1.0) for image in names["slices"].values()]
        assert min(errors) > 20
    if name == "scan":
        assert (tmp_path / "again/report.html").exists()
    if name == "photographs":
        assert (tmp_path / "scene.ply").exists() and names["film"].read(0).shape[2] == 3


def registering():
    """What ``rift --load`` may be given: blocks of the page of own parts, and whole examples."""
    page = (DOCS / "tutorials/own_parts.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    found = {f"block {n}": text for n, text in enumerate(blocks) if "register_" in text}
    assert len(found) == 3
    for path in sorted((ROOT / "examples").glob("own_*.py")):
        if "rift.register_" in path.read_text() or " register_" in path.read_text():
            found[path.name] = path.read_text()
    return found


@pytest.mark.parametrize("text", registering().values(), ids=registering())
def test_what_registers_a_part_does_nothing_else(text):
    """So that a file of it, loaded before each command, costs nothing."""
    for line in ast.parse(text).body:
        if isinstance(line, ast.Expr) and isinstance(line.value, ast.Call):
            assert "register_" in ast.unparse(line.value.func)
        elif isinstance(line, ast.If):
            assert ast.unparse(line.test) == "__name__ == '__main__'"
        else:
            plain = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.ClassDef)
            assert isinstance(line, plain) or isinstance(getattr(line, "value", None), ast.Constant)


def test_python_on_a_page_of_prose_runs(run_page, tmp_path):
    """With what the page takes as there: an operator, a sinogram, a stack of slices."""
    grid = rift.Grid((32, 32))
    A = rift.Projector(grid, rift.Parallel(np.arange(24) * np.pi / 24, bins=48))
    y = A(rift.phantom.shepp_logan(grid))
    given = {"A": A, "sinogram": y, "line_integrals": y, "flat_counts": 20_000.0}
    made = run_page(DOCS / "explanation/reconstruction.md", tmp_path, given=given)
    assert made["image"].shape == grid.shape and made["weights"].shape == y.shape
    made = run_page(DOCS / "explanation/bases.md", tmp_path)
    assert np.isclose(np.linalg.norm(made["same"]), np.linalg.norm(made["c"]))
    slices = np.random.default_rng(0).normal(size=(20, 24, 24))
    made = run_page(DOCS / "how-to/scan_output.md", tmp_path, given={"slices": slices})
    assert made["attenuation"].shape == slices.shape


def test_every_page_with_python_is_run_by_a_test():
    """One of a scheduler's cluster is not, which no test has."""
    shown = {str(p.relative_to(DOCS)) for p in DOCS.rglob("*.md") if "```python" in p.read_text()}
    prose = {f"explanation/{name}.md" for name in ("reconstruction", "bases")}
    how_to = {f"how-to/{name}.md" for name in ("scan_output", "python", "neighbours", "scale_out")}
    assert shown == {f"tutorials/{name}.md" for name in TUTORIALS} | prose | how_to


def test_every_tutorial_is_run_by_a_test():
    written = {page.stem for page in (DOCS / "tutorials").glob("*.md")}
    assert written - {"index", "examples"} == set(TUTORIALS)


def test_every_example_is_on_the_page_of_examples():
    page = (DOCS / "tutorials/examples.md").read_text()
    assert set(re.findall(r"literalinclude} \.\./\.\./examples/(\w+\.py)", page)) == {
        path.name for path in (ROOT / "examples").glob("*.py")
    }


def test_every_page_is_in_the_contents_of_the_site():
    """A page that no table of contents names cannot be found; Sphinx warns of it, as late."""
    for folder in {page.parent for page in DOCS.rglob("*.md")} - {DOCS / "reference/generated"}:
        trees = re.findall(r"```{toctree}\n(.*?)```", (folder / "index.md").read_text(), re.DOTALL)
        named = {line for tree in trees for line in tree.splitlines() if line and line[0] != ":"}
        found = {page.stem for page in folder.glob("*.md")} - {"index"}
        assert found == {name for name in named if "/" not in name}, folder


def test_pictures_are_small_have_a_text_and_say_what_drew_them():
    drawn = json.loads((DOCS / "pictures/drawn.json").read_text())
    shown = set()
    for page in PAGES:
        for text, path in re.findall(r"!\[(.*?)\]\((\S+?)\)", page.read_text(), re.DOTALL):
            assert len(text) > 20, f"{page.name}: {path} needs a text that says what it shows"
            shown.add((page.parent / path).resolve())
    kept = {path for path in (DOCS / "pictures").iterdir() if path.suffix != ".json"}
    assert kept <= shown
    # Those of the paper's page are drawn by tools/print_paper_page.py, which the page names.
    assert {path.stem for path in kept if not path.stem.startswith("paper-")} <= set(drawn)
    for path in kept:
        assert path.stat().st_size <= (1_000_000 if path.suffix == ".webp" else 150_000), path
    assert sum(path.stat().st_size for path in kept) <= 4_000_000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_table_of_figures_says_what_printed_it(page):
    """As far as can be told: decimal figures in a table, and a command of ours in its section."""
    text = page.read_text()
    head, *sections = re.split(r"^#{2,3} ", text, flags=re.MULTILINE)
    for section in sections:
        rows = re.findall(r"^\|.*\d[.]\d.*\|$", section, re.MULTILINE)
        measured = [row for row in rows if len(re.findall(r"[ (+-]\d+[.]\d+", row)) > 1]
        told = re.search(r"tools/\w+[.]py|pytest|--only|rift fit|`\w+_\w+`", head + section)
        title = section.splitlines()[0]
        assert len(measured) < 3 or told or (page.name, title) in UNTOLD, title


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
    for name in (*COMMANDS, "fit"):
        with redirect_stdout(StringIO()) as printed, suppress(SystemExit):
            main([*name.split(), "--help"])
        found[name] = printed.getvalue()
        assert "--quiet" in found[name] or name == "fit"
    found["fit"] += found["fit photos"] + found["fit xray"]
    with redirect_stdout(StringIO()) as printed:
        main(["--help"])
    found["--help"] = printed.getvalue()
    return found


def commands_on(page):
    """Lines of ours in blocks that are indented, or fenced as bash or text, without comments."""
    text = page.read_text().replace("\\\n", " ")
    fenced = re.findall(r"^```(?:bash|text)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    shown = [*re.findall(r"^    (.*)$", text, re.MULTILINE), *"\n".join(fenced).splitlines()]
    # Files that are loaded first are a reader's own, and so are the names that they register.
    shown = [re.sub(r"^rift(?: --load \S+)+(.*)$", r"rift\1 ...", line) for line in shown]
    return [re.split(r"\s{2,}#", line)[0] for line in shown if re.match(r"rift [^-\s]", line)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_command_line_takes_every_command_on_a_page(page, helps, monkeypatch, capsys):
    """Its options and their values are read as they are for a run, which is not begun."""
    taken = []
    for name, entry in COMMANDS.items():
        monkeypatch.setitem(COMMANDS, name, entry._replace(run=lambda made, _: taken.append(made)))
    for line in commands_on(page):
        _, command, *words = shlex.split(line)
        kind = " ".join([command, *words[:1]])
        options = [word for word in words if word.startswith("--")]
        listed = helps[kind if kind in helps else command]
        assert [word for word in options if word not in listed] == [], line
        # Settings of an earlier run are read from its file, and a usage is no command.
        if "--config" not in words and "OPTIONS" not in line and "..." not in line:
            before = len(taken)
            status = main([command, *words])
            assert (status, len(taken)) == (0, before + 1), (line, capsys.readouterr().err)


def test_every_option_that_a_text_names_is_one_of_a_command_or_a_tool(helps):
    known = set(re.findall(r"--[a-z][\w-]*", "".join(helps.values())))
    tools = "".join(path.read_text() for path in (ROOT / "tools").glob("*.py"))
    known |= {"--" + name.replace("_", "-") for name in re.findall(r"^    (\w+): ", tools, re.M)}
    known |= set(re.findall(r'add_argument\("(--[\w-]+)"', tools))
    for page in PAGES:
        code = re.findall(r"`(?!`)([^`]+)`", re.sub(r"```.*?```", "", page.read_text(), flags=re.S))
        named = {word for each in code for word in re.findall(r"(?<![\w-])--[a-z][\w-]*", each)}
        assert named - known - ELSEWHERE == set(), page.name


def test_names_of_the_package_on_a_page_are_there_after_its_import():
    """What another test has imported is there in any case, so that the package must list it."""
    texts = [page.read_text() for page in (*PAGES, *(ROOT / "examples").glob("*.py"))]
    named = {
        name for text in texts for name in re.findall(r"\brift\.([A-Za-z]\w*(?:\.\w+)?)", text)
    }
    assert {"reconstruct.variation_weight", "io.read_known_view", "Projector"} <= named
    for name in sorted(named):
        first, _, second = name.partition(".")
        assert first in rift.__all__, name
        assert not second or hasattr(getattr(rift, first), second), name


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
