"""The training benchmark runs, compares equal work, and sees every wait of the host.

No test looks at how long anything took.
"""

from __future__ import annotations

import importlib
import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl import metrics
from rift_cl.errors import InputError
from rift_cl.train.strategy import McmcSettings

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "tools" / "bench_training.py"
SCENE = "300:40x24"


@pytest.fixture
def tool(monkeypatch):
    """Import a module as the script does."""
    monkeypatch.syspath_prepend(SCRIPT.parent)
    return importlib.import_module


@pytest.fixture
def case(tool):
    return tool("bench.training_case").TrainingCase.parse(SCENE, rift.default_device())


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A run in this process, which shares its kernels with the other tests."""
    folder, shown = tmp_path_factory.mktemp("bench"), io.StringIO()
    where = ["--json", folder / "training.json", "--markdown", folder / "training.md"]
    arguments = ["bench_training", "--quick", "--scenes", SCENE, *map(str, where)]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(shown):
        patch.syspath_prepend(SCRIPT.parent)
        patch.setattr(sys, "argv", arguments)
        assert importlib.import_module("bench_training").main() == 0
    assert sorted(path.name for path in folder.iterdir()) == ["training.json", "training.md"]
    record = json.loads((folder / "training.json").read_text(encoding="utf-8"))
    return record, (folder / "training.md").read_text(encoding="utf-8"), shown.getvalue()


def test_head_names_version_device_and_date(bench):
    record, page, shown = bench
    device = rift.default_device()
    assert record["version"] == rift.__version__
    assert record["device"]["name"] == device.name and record["date"].endswith("+00:00")
    assert device.name in page and "tools/bench_training.py --peers" in page
    assert "Steps per second" in shown


def test_without_peers_the_page_says_so(bench):
    record, page, _ = bench
    (scene,) = record["scenes"]
    assert [entry["name"] for entry in scene["contenders"]] == ["rift_cl"]
    assert scene["speed_ups"] == [] and record["skipped"] == {}
    assert "--peers adds a trainer in torch" in page


def test_shares_of_a_step_add_up_and_every_part_is_there(bench):
    for way, found in bench[0]["scenes"][0]["stages"].items():
        assert sum(row["share"] for row in found["rows"]) == pytest.approx(1)
        stages = {row["stage"] for row in found["rows"]}
        assert ("homogenisation" in stages) == (way == "homogenised")
        assert {"raster", "raster gradient", "Adam and activation", "upload"} <= stages
        assert {"shading gradient and Adam", "random walk"} <= stages


def test_every_row_of_a_table_has_its_columns(bench):
    cells = 0
    for line in bench[1].splitlines():
        if line.startswith("|"):
            cells = cells or line.count("|")
            assert line.count("|") == cells, line
        else:
            cells = 0


def test_the_page_names_the_waits(bench):
    waits = bench[0]["scenes"][0]["host"]["waits"]
    places = {way: {wait["function"] for wait in found} for way, found in waits.items()}
    assert "n_entries" in places["plain"]
    assert places["poses and exposures"] > places["plain"]
    assert "n_entries" in bench[1]


def test_bad_scene_is_one_sentence_and_the_input_status(tmp_path):
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, SCRIPT, "--scenes", "500*48", "--json", tmp_path / "x.json"],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == InputError.exit_status
    assert "500*48" in done.stderr and "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_each_blocking_call_is_seen_with_its_place_and_the_driver_left_as_it_was(tool):
    import pyopencl as cl

    before = cl.enqueue_copy, cl.CommandQueue.finish
    device, loss = (
        rift.default_device(),
        importlib.import_module("rift_cl.train.loss.homogenised_loss"),
    )
    settings = importlib.import_module("rift_cl.train.loss.homogenisation").Homogenisation(0.5)
    image = np.zeros((16, 16, 3), np.float32)
    with tool("bench.waits").each_wait() as log:
        watching = loss.HomogenisedLoss(device, settings, ssim_weight=0.0, kind="l1", noise=0.01)
        watching.watch(device.array(image), device.array(image))
        device.finish()
    # A kernel's first launch ends with a wait of its own.
    found = [wait for wait in log if wait.function != "launch" and "image_loss" not in wait.place]
    assert [wait.bytes for wait in found if wait.kind == "to the device"] == [image.nbytes] * 2
    (read,) = (wait for wait in found if wait.kind == "to the host")
    assert read.bytes == 4 and read.function == "watch"
    assert read.place.startswith("rift_cl/train/loss/homogenised_loss.py:")
    assert log[-1].kind == "finish"
    assert (cl.enqueue_copy, cl.CommandQueue.finish) == before


def test_kernel_without_a_stage_is_noticed(tool):
    stage_of, costs = tool("bench.training_stages").stage_of, tool("bench.costs")
    assert stage_of("radix_count") == "tile lists"
    assert stage_of("splat_raster_cpu") == "raster"
    with pytest.raises(costs.CoverageError, match="cone_project"):
        stage_of("cone_project")


def test_a_trainer_keeps_its_splats_so_that_all_steps_are_alike(case):
    trainer = case.trainer()
    for _ in range(3):
        trainer.step()
    assert len(trainer.parameters) == case.count
    assert trainer.parameters.raw["sh"].shape == (case.count, 16, 3)


def test_missing_torch_is_one_sentence_that_says_what_to_do(tool, case, monkeypatch):
    trainers, race = tool("bench.trainers"), tool("bench.race")
    monkeypatch.setitem(sys.modules, "torch", None)
    skipped: dict[str, str] = {}
    lined = race.line_up(trainers.TRAINERS, case.device, case, skipped)
    assert [entry.name for entry in lined] == ["rift_cl"]
    assert "pip install 'torch>=2.4,<2.14'" in skipped["torch trainer"]


def test_torch_trains_the_same_splats_where_nothing_is_random(tool, case):
    pytest.importorskip("torch", reason="torch is not installed")
    trainers = tool("bench.trainers")
    still = replace(case.settings, strategy=replace(case.settings.strategy, noise=0.0))
    object.__setattr__(case, "settings", still)
    ours = trainers.RiftTrainer(case.device, case)
    theirs = trainers.TorchTilesAlone(case.device, case)
    for _ in range(2):
        for contender in (ours, theirs):
            contender.leave(contender.prepared("pass")())
    assert len(ours.losses) == 16 and ours.losses[-1] < ours.losses[0]
    np.testing.assert_allclose(theirs.losses, ours.losses, rtol=2e-4)


def test_the_walk_in_torch_is_as_wide_as_ours(tool, case):
    torch = pytest.importorskip("torch", reason="torch is not installed")
    faint = {**case.raw, "logits": np.full(case.count, -7.0, np.float32)}
    walk = replace(case.settings, strategy=McmcSettings(first=30_000, noise=1.0))
    theirs = tool("bench.torch_trainer").TorchTrainer(faint, walk, extent=1.0, size=1.0)
    before = theirs._leaves["means"].detach().clone()
    theirs._shake(1.0)
    moved = (theirs._leaves["means"].detach() - before).numpy()
    parameters = tool("rift_cl.train.parameters").Parameters.of(case.device, faint)
    parameters.shake(1.0, 0)
    expected = parameters.host()[0]["means"] - faint["means"]
    widths = [np.median(np.linalg.norm(found, axis=1)) for found in (moved, expected)]
    assert torch.is_tensor(before) and widths[0] == pytest.approx(widths[1], rel=0.3)


def test_similarity_in_torch_is_that_of_the_package(tool):
    torch = pytest.importorskip("torch", reason="torch is not installed")
    random = np.random.default_rng(0)
    image, target = random.uniform(size=(2, 20, 24, 1)).astype(np.float32)
    loss = tool("bench.torch_trainer").image_loss(
        torch.tensor(image), torch.tensor(target), ssim_weight=1.0
    )
    assert float(loss) == pytest.approx(1 - metrics.ssim(image[..., 0], target[..., 0]), abs=1e-5)
