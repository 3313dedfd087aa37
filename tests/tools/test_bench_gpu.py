"""One command for a new device: every part is told in the files, also where one fails."""

import json
import sys

import pytest

import rift_cl as rift


@pytest.fixture
def bench(tool, monkeypatch):
    bench = tool("bench_gpu")

    def parts(options, device, folder):
        found = {
            "against": "pocl",
            "families": [{"family": "fbp", "difference": "=", "worst array": "", "s": 1.5}],
        }
        write = f"open({str(folder / 'families.json')!r}, 'w').write({json.dumps(found)!r})"
        yield "families", [sys.executable, "-c", write]
        tell = "import os; print('on', os.environ['RIFT_DEVICE']); raise SystemExit(3)"
        yield "tests", [sys.executable, "-c", tell]

    monkeypatch.setattr(bench, "_parts", parts)
    monkeypatch.setattr(sys, "argv", ["bench_gpu.py", "--out", "x"])
    return bench


def test_every_part_is_told_with_the_device(bench, tmp_path):
    device = rift.default_device()
    assert bench.main(bench.Options(tmp_path / "new")) == 1
    record = json.loads((tmp_path / "new.json").read_text())
    assert record["device"]["name"] == device.name
    assert {name: part["status"] for name, part in record["parts"].items()} == {
        "families": 0,
        "tests": 3,
    }
    assert record["parts"]["tests"]["said"] == [f"on {device.selector}"]
    page = (tmp_path / "new.md").read_text()
    assert page.startswith(f"# {device.name}\n")
    assert "| fbp | = |" in page and "`python tools/bench_gpu.py --out x`" in page


def test_part_that_says_nothing_is_given_up_and_told(bench, tmp_path, monkeypatch):
    silent = [sys.executable, "-c", "import time; time.sleep(600)"]
    monkeypatch.setattr(bench, "_parts", lambda *_: iter([("tests", silent)]))
    assert bench.main(bench.Options(tmp_path / "new", limit=0.2)) == 1
    (found,) = json.loads((tmp_path / "new.json").read_text())["parts"].values()
    assert found["said"] == ["no line in 0.2 s: given up"]
    assert found["status"] != 0


def test_parts_that_are_asked_for_alone(bench, tmp_path):
    assert bench.main(bench.Options(tmp_path / "new", only=("families",))) == 0
    assert list(json.loads((tmp_path / "new.json").read_text())["parts"]) == ["families"]


def test_no_such_device_is_told(bench, tmp_path):
    assert bench.main(bench.Options(tmp_path / "new", device="no such device"))
    assert not list(tmp_path.iterdir())


def test_the_parts_are_commands_that_are_there(tool, tmp_path):
    bench = tool("bench_gpu")
    parts = dict(bench._parts(bench.Options(tmp_path / "new", quick=True), "0:0", tmp_path))
    assert list(parts) == ["families", "tests", "kernels"]
    for arguments in parts.values():
        files = [each for each in arguments[1:] if each.endswith(".py") or "/tests/" in each]
        assert files and all(bench.Path(each).exists() for each in files)
