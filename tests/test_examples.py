"""Every file in ``examples/`` runs in a process of its own, at a small size, without a warning."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
# The size that an example is given, and a text that it prints.
RUNS = {
    "find_axis": ("64", "found at bin 35.4"),
    "fit_photographs": ("20", "<RenderedScene in "),
    "fit_xray": ("20", "<XrayScene: 1000 splats"),
    "own_angular_basis": ("", "mean of the image: "),
    "own_filter": ("32", "butterworth: "),
    "own_loss": ("30", "charbonnier: loss "),
    "own_reader": ("", "(4, 96, 96) voxels"),
    "own_solver": ("32", "SciPy's LSQR: "),
    "own_strategy": ("30", "step 30: loss "),
    "plan_views": ("3", "Plan(3 views"),
    "register_camera": ("3", "degrees off,"),
    "tomography": ("32", "total variation"),
}
# Packages that an example wants besides.
WANTS = {"register_camera": ("torch", "kornia")}


@pytest.mark.timeout(1000)
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path, tmp_path, tmp_path_factory):
    for name in WANTS.get(path.stem, ()):
        if find_spec(name) is None:
            pytest.skip(f"{name} is not installed")
    size, printed = RUNS.get(path.stem, ("", ""))
    # torch leaves a folder where it is told to, whatever it is used for.
    torch = {"TORCHINDUCTOR_CACHE_DIR": str(tmp_path_factory.mktemp("torch"))}
    done = subprocess.run(
        [sys.executable, "-W", "error", str(path), *size.split()],
        cwd=tmp_path,
        env={**os.environ, **torch, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert printed in done.stdout
    assert not list(tmp_path.iterdir()), "an example leaves files behind"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_says_what_it_shows(path):
    source = path.read_text(encoding="utf-8")
    assert len(ast.get_docstring(ast.parse(source)) or "") > 60
    assert len(source.splitlines()) < 80


def test_there_are_examples_as_named():
    assert set(RUNS) <= {path.stem for path in EXAMPLES}
