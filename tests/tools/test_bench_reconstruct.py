"""The benchmark of whole runs makes a scan, runs versions in turns and keeps their figures."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


# Turns themselves are those of tests/tools/test_bench_splats.py.
@pytest.mark.study
def test_two_versions_take_turns(tmp_path):
    record = tmp_path / "figures.json"
    options = ["--rows", "2", "--views", "90", "--bins", "64", "--center", "33", "--rounds", "1"]
    done = subprocess.run(
        [
            *(sys.executable, str(ROOT / "tools/bench_reconstruct.py"), "--json", str(record)),
            *("--against", str(ROOT), *options),
        ],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    runs = json.loads(record.read_text())["runs"]
    assert set(runs) == {"this version", "the other"}
    for (figures,) in runs.values():
        assert figures["processor"] > 0
        assert abs(figures["center"] - 33) < 0.5
    assert "this / the other" in done.stdout
