"""Benchmark results by date: what is kept of a record, and what counts as slower."""

import json
from pathlib import Path

import pytest

from rift_cl.errors import InputError

RESULTS = Path(__file__).parents[2] / "docs" / "benchmarks"


def record(date, **seconds):
    """As bench_kernels writes it, with one operation."""
    kernels = [
        {"kernel": name, "launches": 1, "min_s": least, "median_s": 2 * least, "raw_s": [least]}
        for name, least in seconds.items()
    ]
    return {
        "version": "0.1.0",
        "date": f"{date}T12:00:00+00:00",
        "packages": {},
        "import_s": 0.1,
        "device": {"name": "Some GPU (R)"},
        "host": {},
        "groups": [],
        "splats": [],
        "limits": {"multiply_add": 1e12, "bandwidth": 1e11, "launch": 1e-5, "raw": [1, 2]},
        "cases": [{"name": "32²", "splits": [{"operation": "forward", "kernels": kernels}]}],
    }


@pytest.fixture
def history(tool):
    return tool("bench.history")


@pytest.fixture
def compare(tool):
    return tool("compare_benchmarks")


def test_a_result_has_the_times_and_where_they_were_taken(history, tmp_path):
    path = history.keep(record("2026-01-02", a=1e-3, b=2e-3), tmp_path)
    assert path.name == "2026-01-02-some-gpu-r.json"
    found = history.load(path)
    assert found["kernels_us"]["32² / forward / a"] == [1000, 2000]
    assert "raw" not in found["limits"]


def test_the_kernel_that_became_slower_is_named(history, compare, tmp_path, monkeypatch, capsys):
    history.keep(record("2026-01-02", a=1e-3, b=2e-3, tiny=1e-6, gone=1), tmp_path)
    history.keep(record("2026-02-02", a=1.5e-3, b=2.1e-3, tiny=9e-6, new=1), tmp_path)
    other = record("2026-01-20", a=1e-9)
    history.keep({**other, "device": {"name": "another"}}, tmp_path)

    def status(*options):
        monkeypatch.setattr("sys.argv", ["compare_benchmarks", "--folder", str(tmp_path), *options])
        return compare.main(), capsys.readouterr().out

    code, printed = status()
    assert code == 1
    assert "32² / forward / a" in printed
    assert "1.50" in printed
    assert "forward / b" not in printed
    assert "tiny" not in printed
    assert status("--slower", "1.6")[0] == 0


def test_without_two_results_of_a_device_there_is_nothing_to_compare(history, compare, tmp_path):
    with pytest.raises(InputError, match="keep"):
        compare.last_two(tmp_path)
    history.keep(record("2026-01-02", a=1e-3), tmp_path)
    with pytest.raises(InputError, match="keep"):
        compare.last_two(tmp_path)


def test_another_file_is_no_result(history, tmp_path):
    path = tmp_path / "x.json"
    for text in ("[]", "{", json.dumps({"device": 1})):
        path.write_text(text)
        with pytest.raises(InputError, match=r"x\.json"):
            history.load(path)


def test_the_results_of_this_project_can_be_read(history):
    paths = sorted(RESULTS.glob("*.json"))
    assert paths
    for path in paths:
        assert history.load(path)["date"][:10] == path.name[:10]
