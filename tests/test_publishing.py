"""What is published fits together: version, extras, the installs that messages name, forms."""

from __future__ import annotations

import ast
import re
from datetime import date
from pathlib import Path

import pytest
import yaml

import rift_cl as rift

ROOT = Path(__file__).parents[1]
PYPROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
# Modules of packages that are imported by another name.
MODULES = {
    "PyWavelets": "pywt",
    "pi-heif": "pi_heif",
    "flip-evaluator": "flip_evaluator",
    "astra-toolbox": "astra",
    "OpenImageIO": "OpenImageIO",
    "scikit-image": "skimage",
    "pillow": "PIL",
    "pyyaml": "yaml",
    # Of one version with the other, which imports it.
    "dask": "distributed",
}
# Not imported: a driver, and the programs of developers.
DRIVERS, DEVELOPMENT = ("intel",), ("all", "test", "dev", "docs")
# What a message names and no extra brings: it draws Dask's dashboard, and weighs more than Dask.
BESIDES = ("bokeh",)
REQUIREMENT = re.compile(r"([\w-]+)(\[\w+\])?(.*)")


def requirements(block):
    """Name and versions of each requirement in a list of pyproject.toml."""
    lines = "\n".join(line for line in block.splitlines() if not line.strip().startswith("#"))
    found = (REQUIREMENT.match(text) for text in re.findall(r'"([^"]+)"', lines))
    return {match[1]: match[3].split(";")[0].strip() for match in found}


def declared():
    """Requirements of the package itself, then of each extra, by its name."""
    plain = re.search(r"\ndependencies = \[\n(.*?)\n\]", PYPROJECT, re.DOTALL)[1]
    extras = PYPROJECT.split("[project.optional-dependencies]\n")[1].split("\n[")[0]
    found = {"": requirements(plain)}
    for name, block in re.findall(r"^(\w+) = \[(.*?)\]$", extras, re.MULTILINE | re.DOTALL):
        found[name] = requirements(block)
    return found


def texts(path):
    """Every text of a module, f-strings with their braces, and packages that are asked for."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            parts = (v.value if isinstance(v, ast.Constant) else "{}" for v in node.values)
            yield "".join(parts)
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "optional_package":
            yield f"pip install {node.args[0].value}"
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "not_installed":
            yield f"pip install {node.args[2].value}"


def installs():
    """Each requirement that a text of the package says to install, with the file that says so."""
    for path in (ROOT / "rift_cl").rglob("*.py"):
        for text in texts(path):
            named = re.findall(r"pip install (?:--upgrade )?('[^']+'|[\w-]+|\{\})", text)
            # Extras of the package itself are looked up by tests/test_documents.py.
            named = [each.strip("'") for each in named if not each.startswith("'.[")]
            yield from ((path.relative_to(ROOT), each) for each in named)


@pytest.mark.full
def test_every_install_that_a_message_names_is_one_that_works():
    """It is declared here, with the same limits where there is an upper one."""
    known = {name: limits for group in declared().values() for name, limits in group.items()}
    found = [(path, text) for path, text in installs() if text != "{}"]
    assert len({text for _, text in found}) > 8
    for path, text in found:
        name, _, limits = REQUIREMENT.match(text).groups()
        if name in BESIDES:
            continue
        assert name in known, f"{path}: pip install {text}"
        if "<" in known[name]:
            assert limits == known[name], f"{path}: pip install {text}, declared {known[name]}"


def imported():
    """Names of all packages that are imported, or loaded by name, in this repository's programs."""
    names = set()
    for folder in ("rift_cl", "tools", "examples", "tests"):
        for path in (ROOT / folder).rglob("*.py"):
            code = path.read_text(encoding="utf-8")
            names |= set(re.findall(r"^\s*(?:import|from) (\w+)", code, re.MULTILINE))
            names |= set(
                re.findall(r'(?:import_module|importorskip|optional_package)\("(\w+)', code)
            )
    return names


def test_extras_install_what_is_used():
    groups, used = declared(), imported()
    for extra, group in groups.items():
        if extra in (*DRIVERS, *DEVELOPMENT):
            continue
        unused = [name for name in group if MODULES.get(name, name) not in used]
        assert not unused, f"{extra or 'dependencies'}: {unused}"


def test_the_version_is_in_one_place():
    assert '\ndynamic = ["version"]' in PYPROJECT
    assert '\npath = "rift_cl/__init__.py"' in PYPROJECT
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(citation["version"]) == rift.__version__, "what CITATION.cff says follows it"
    assert {"cff-version", "message", "title", "authors", "license"} <= citation.keys()


def test_releases_in_the_changelog_are_dated_and_the_last_is_this_version():
    heads = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heads[0] == "Unreleased" or rift.__version__ in heads[0]
    released = [head.split(", ") for head in heads if head != "Unreleased"]
    days = [date.fromisoformat(day) for _, day in released]
    assert released[0][0] == rift.__version__
    assert days == sorted(days, reverse=True)


@pytest.mark.parametrize("name", ["wrong_result", "device", "question"])
def test_a_form_for_issues_asks_for_something(name):
    path = ROOT / ".github" / "ISSUE_TEMPLATE" / f"{name}.yml"
    if not path.is_file():
        pytest.skip("the forms are not part of a source distribution")
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= form.keys()
    assert any(field.get("validations", {}).get("required") for field in form["body"])
    assert len({field["id"] for field in form["body"]}) == len(form["body"])


def test_the_security_page_says_how_to_report():
    page = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    assert "## How to report" in page
    for tool in re.findall(r"`(tools/\w+\.py)`", page):
        assert (ROOT / tool).is_file()
