"""The benchmark runs, writes what it says, and notices a kernel that nobody measures.

No test looks at how long anything took.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.cl.build.source import kernel_names
from rift_cl.errors import InputError

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "tools" / "bench_kernels.py"


@pytest.fixture
def tool(monkeypatch):
    """Import a module as the script does."""
    monkeypatch.syspath_prepend(SCRIPT.parent)
    return importlib.import_module


def run(*arguments):
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    where = ("--json", folder / "bench.json", "--markdown", folder / "bench.md")
    done = run(
        *("--sizes", "32x24", "--groups", "32x24", "--slices", "2", "--rounds", "1"),
        # Few splats are sorted in one launch, others in chunks.
        *("--splats", "9000", "40", "16500", "40", *where),
    )
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["bench.json", "bench.md"]
    record = json.loads((folder / "bench.json").read_text(encoding="utf-8"))
    return record, (folder / "bench.md").read_text(encoding="utf-8"), done.stdout


def kernels_of(case):
    return [kernel for split in case["splits"] for kernel in split["kernels"]]


def positive(value):
    return isinstance(value, (int, float)) and math.isfinite(value) and value > 0


def test_head_names_version_device_and_date(bench):
    record, page, shown = bench
    device = rift.default_device()
    assert record["version"] == rift.__version__
    assert (record["device"]["name"], record["device"]["driver"]) == (device.name, device.driver)
    assert record["host"]["cpu"] and record["date"].endswith("+00:00") and record["seed"] == 0
    assert positive(record["import_s"])
    assert device.name in page and "radon_project" in shown


def test_limits_are_positive_and_the_best_of_the_raw_ones(bench):
    limits = bench[0]["limits"]
    assert all(positive(limits[name]) for name in ("multiply_add", "bandwidth", "launch"))
    assert limits["multiply_add"] == max(raw["multiply_add"] for raw in limits["raw"])
    assert limits["launch"] == min(raw["launch"] for raw in limits["raw"])


def test_every_kernel_has_positive_rates_in_every_case(bench):
    cases = bench[0]["cases"]
    assert [(case["n"], case["views"], case["slices"]) for case in cases] == [
        (32, 24, 1),
        (32, 24, 2),
    ]
    for case in cases:
        for kernel in kernels_of(case):
            assert positive(kernel["multiply_add_share"]) or kernel["kernel"] == "plane_split"
    scenes = bench[0]["splats"]
    assert all(0 < scene["lane_use"] <= 1 for scene in scenes)
    tables = (cases[0], *scenes, *bench[0]["groups"])
    found = [kernel for table in tables for kernel in kernels_of(table)]
    other = "_gpu" if rift.default_device().traits.is_cpu else "_cpu"
    driven = {name for name in kernel_names() if not name.endswith(other)}
    assert {kernel["kernel"] for kernel in found} == driven
    for kernel in found:
        assert all(positive(kernel[key]) for key in ("min_s", "rate_per_s", "bytes_per_s"))
        assert kernel["min_s"] == pytest.approx(min(kernel["raw_s"]), abs=1e-6)


def test_shares_of_an_operation_add_up(bench):
    tables = (bench[0]["cases"][0], *bench[0]["groups"])
    for split in [split for table in tables for split in table["splits"]]:
        shares = [kernel["share"] for kernel in split["kernels"]]
        assert sum(shares) + split["rest"]["share"] == pytest.approx(1)


def test_operations_are_timed_and_scored(bench):
    for case in bench[0]["cases"]:
        assert [entry["arrays"] for entry in case["contenders"]] == ["device", "NumPy"]
        for entry in case["contenders"]:
            assert set(entry["operations"]) == {"forward", "backward", "fbp"}
            assert all(positive(done["updates_per_s"]) for done in entry["operations"].values())
            assert entry["accuracy"]["fbp_psnr_db"] > 18
            assert entry["accuracy"]["forward_error"] < 0.15
    assert bench[0]["cases"][0]["contenders"][0]["accuracy"]["adjoint_mismatch"] < 1e-6
    assert bench[0]["cases"][0]["dot_test"] < 1e-6


def test_every_row_of_a_table_has_its_columns(bench):
    cells = 0
    for line in bench[1].splitlines():
        if line.startswith("|"):
            cells = cells or line.count("|")
            assert line.count("|") == cells, line
        else:
            cells = 0
    assert "lane use" in bench[1]


def test_without_peers_there_are_no_ratios(bench):
    assert all(case["speed_ups"] == [] for case in bench[0]["cases"])
    assert bench[0]["skipped"] == {}


def test_bad_size_is_one_sentence_and_the_input_status(tmp_path):
    done = run("--sizes", "512*768", "--json", tmp_path / "x.json")
    assert done.returncode == InputError.exit_status
    assert "512*768" in done.stderr and "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_unknown_kernel_stops_the_run(tool, monkeypatch, tmp_path, capsys):
    script = tool("bench_kernels")
    monkeypatch.setattr(script, "kernel_names", lambda: [*kernel_names(), "cone_project"])
    monkeypatch.setattr(sys, "argv", ["bench_kernels", "--json", str(tmp_path / "x.json")])
    assert script.main() == 1
    assert "cone_project" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_one_group_takes_its_place_on_a_page(bench, tool):
    record, page, _ = bench
    tables = tool("bench.tables")
    (group,) = [group for group in record["groups"] if group["name"] == "coverage"]
    now = tables.renewed(page, {**record, "groups": [group]})
    assert now.count("Measured apart, ") == 1
    kept = [line for line in now.splitlines() if not line.startswith("Measured apart")]
    assert [line for line in kept if line] == [line for line in page.splitlines() if line]
    with pytest.raises(InputError, match="no table 'Kernels, another'"):
        tables.renewed(page, {**record, "groups": [{**group, "name": "another"}]})


@pytest.mark.parametrize("slices", [1, 3])
def test_inputs_may_be_written_to(tool, slices):
    # scikit-image refuses read-only images, and would be reported as a peer that failed.
    case = tool("bench.case").Case(16, 4, slices)
    assert case.image.flags.writeable and case.projections.flags.writeable
    assert case.image.shape == case.grid.shape


@pytest.mark.parametrize("name", ["ScikitImage", "RiftAsScikitImage"])
def test_scikit_image_takes_part_and_so_do_we_in_its_place(tool, name):
    peers, race, case = tool("bench.peers"), tool("bench.race"), tool("bench.case").Case(32, 24)
    skipped: dict[str, str] = {}
    lined = race.line_up([getattr(peers, name)], rift.default_device(), case, skipped)
    (entry,) = race.race(lined, rounds=1, warm_up=False, skipped=skipped)
    accuracy = race.race_record(entry, seed=0)["accuracy"]
    assert skipped == {}
    assert accuracy["fbp_psnr_db"] > 18
    assert accuracy["forward_error"] < 0.15
    assert accuracy["adjoint_mismatch"] < 0.1


def test_ours_in_place_of_another_is_left_out_where_that_is_not_installed(tool, monkeypatch):
    peers, race, case = tool("bench.peers"), tool("bench.race"), tool("bench.case").Case(16, 4)
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    skipped: dict[str, str] = {}
    assert race.line_up([peers.RiftAsScikitImage], rift.default_device(), case, skipped) == []
    assert "not installed" in skipped["rift_cl, as scikit-image"]


def test_launches_are_recorded_and_the_device_is_left_as_it_was(tool):
    device = rift.default_device()
    grid, scan = rift.Grid((16, 16)), rift.Parallel([0.1, 1.7], bins=26)
    A = rift.Projector(grid, scan, device=device)
    with tool("bench.operations").each_launch(device) as log:
        recorded = A(np.ones((16, 16)))
    names = [name for name, _ in log]
    assert sorted(set(names)) == ["plane_split", "radon_project", "radon_resample_edges_adjoint"]
    assert len(names) == 6
    assert "launch" not in vars(device)
    assert np.array_equal(recorded, A(np.ones((16, 16))))


def test_speed_up_is_against_the_fastest_peer_that_can(tool):
    def entry(name, *, ours=False, **seconds):
        done = {key: {"min_s": s, "median_s": 2 * s} for key, s in seconds.items()}
        return {"name": name, "ours": ours, "operations": done}

    records = [
        entry("ours", ours=True, forward=1.0, fbp=1.0),
        entry("slow", forward=9.0, fbp=8.0),
        entry("fast", forward=3.0),
    ]
    found = tool("bench.race").speed_ups(records)
    ratios = {up["operation"]: (up["peer"], up["by_min"]) for up in found}
    assert ratios == {"forward": ("fast", 3.0), "fbp": ("slow", 8.0)}


def test_peer_that_cannot_be_made_is_skipped_with_the_reason(tool):
    contender, race, case = tool("bench.contender"), tool("bench.race"), tool("bench.case")

    class Missing(contender.RiftOnHost):
        name, ours = "missing", False

        def __init__(self, device, case):
            raise ImportError("No module named 'missing'")

    class Broken(contender.RiftOnHost):
        name, ours, repeats = "broken", False, 1

        def backward(self, sinogram):
            raise RuntimeError("it broke")

    skipped: dict[str, str] = {}
    size = case.Case(16, 4)
    lined = race.line_up([Missing, Broken], rift.default_device(), size, skipped)
    entries = race.race(lined, rounds=2, warm_up=False, skipped=skipped)
    assert entries == []
    assert "No module named 'missing'" in skipped["missing"]
    assert skipped["broken"] == "RuntimeError: it broke"


def test_a_gpu_races_with_those_that_use_one(tool, monkeypatch):
    peers, rasterizers = tool("bench.peers"), tool("bench.rasterizers")
    cpu, gpu = SimpleNamespace(is_cpu=True), SimpleNamespace(is_cpu=False)
    for every, on_gpu in ((peers.PEERS, "ASTRA, CUDA"), (rasterizers.RASTERIZERS, "gsplat, CUDA")):
        kinds = {
            traits.is_cpu: {
                kind.name for kind in every if kind.fits(SimpleNamespace(traits=traits))
            }
            for traits in (cpu, gpu)
        }
        assert on_gpu in kinds[False] - kinds[True]
        assert kinds[True] - kinds[False], "those of the CPU alone"
        assert kinds[True] & kinds[False], "ours, and peers on OpenCL"
