"""Time to quality: fits of two versions and of a stand-in for OpenSplat; when a goal is reached.

No test looks at how long anything took.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from test_trainer import Ball

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.images.image import write_png
from rift_cl.io.output import write_json

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A ball of splats seen by eight cameras before grey."""
    folder = tmp_path_factory.mktemp("capture")
    ball = Ball(rift.default_device())
    names = [f"{k}.png" for k in range(8)]
    for name, image in zip(names, ball.images, strict=True):
        write_png(folder / name, np.clip(image, 0, 1))
    write_json(folder / "transforms.json", transforms_of(ball.cameras, names))
    return folder


def run(tool, monkeypatch, capture, out, *more):
    sizes = ["--steps", "5", "--splats", "60", "--every", "2", "--views", "1"]
    words = [str(capture), "--json", str(out), *sizes, *map(str, more)]
    monkeypatch.setattr(sys, "argv", ["bench_quality", *words])
    status = tool("bench_quality").main()
    return status, json.loads(out.read_text(encoding="utf-8")) if out.exists() else None


def test_versions_fit_alike_and_are_scored_on_their_way(tool, capture, tmp_path, monkeypatch):
    more = ("--against", ROOT, "--keep", tmp_path / "kept", "--markdown", tmp_path / "page.md")
    (tmp_path / "kept").mkdir()
    # Of a PATH that is empty the driver has no linker.
    monkeypatch.setattr("bench.opensplat.shutil.which", lambda program: None)
    status, record = run(tool, monkeypatch, capture, tmp_path / "quality.json", *more)
    assert status == 0
    ours, other = record["cases"][0]["fits"]
    assert [moment["step"] for moment in ours["moments"]] == [1, 2, 4, 5]
    assert [m["psnr"] for m in ours["moments"]] == [m["psnr"] for m in other["moments"]]
    for name in ("cpu_s", "wall_s"):
        seconds = [moment[name] for moment in ours["moments"]]
        assert seconds == sorted(seconds) and seconds[0] > 0
    assert "OpenSplat" in record["skipped"]
    assert "PSNR at the end" in (tmp_path / "page.md").read_text(encoding="utf-8")
    (kept,) = (tmp_path / "kept").iterdir()
    assert json.loads(kept.read_text(encoding="utf-8")) == record


def test_a_goal_is_reached_at_the_first_moment_that_scores_it(tool):
    quality = tool("bench.quality")
    scores = (20.0, 36.0, 34.0, 41.0)
    found = [quality.Moment(10 * k, float(k), 2.0 * k, score) for k, score in enumerate(scores)]
    goals = {goal.pop("psnr"): goal for goal in quality.record_of("we", found)["goals"]}
    assert goals[30.0] == goals[35.0] == {"step": 10, "cpu_s": 1.0, "wall_s": 2.0}
    assert goals[40.0]["step"] == 30
    assert goals[43.0] == {"step": None, "cpu_s": None, "wall_s": None}


def test_scenes_that_opensplat_saved_are_scored(tool, capture, tmp_path, monkeypatch):
    opensplat, quality = tool("bench.opensplat"), tool("bench.quality")
    case = quality.FitCase(capture, 4, 60, every=2, views=1, downscale=1, seed=0)
    rift.fit(capture, tmp_path / "fit", steps=2, splats=60, kind="photos")
    program, saved = tmp_path / "opensplat", str(tmp_path / "fit" / "scene.ply")
    program.write_text(
        f"#!{sys.executable}\n"
        "import json, pathlib, shutil, sys\n"
        "project = pathlib.Path(sys.argv[1])\n"
        "transforms = json.loads((project / 'transforms.json').read_text())\n"
        "assert all((project / f['file_path']).is_file() for f in transforms['frames'])\n"
        "points = (project / transforms['ply_file_path']).read_text().split()\n"
        "assert points[0] == 'ply' and len(transforms['frames']) == 7\n"
        "for step in (2, 4):\n"
        f"    shutil.copy({saved!r}, project / f'splat_{{step}}.ply')\n"
    )
    program.chmod(0o755)
    found = opensplat.moments(case, None, str(program))
    assert [moment.step for moment in found] == [2, 4]
    assert found[0].psnr == found[1].psnr > 5
    program.write_text(f"#!{sys.executable}\nraise SystemExit('no GPU')\n")
    with pytest.raises(rift.RiftError, match="no GPU"):
        opensplat.moments(case, None, str(program))


def test_a_preset_that_is_none_is_named(tool, capture, tmp_path, monkeypatch, capsys):
    out = tmp_path / "quality.json"
    status, _ = run(tool, monkeypatch, capture, out, "--preset", "slow")
    assert status == InputError.exit_status
    assert "slow" in capsys.readouterr().err and not out.exists()
