"""Scenes of the splat benchmark, its count of used lanes, and two versions in one process.

No test looks at how long anything took.
"""

from __future__ import annotations

import json
import math
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.splat import Renderer, Splats

ROOT = Path(__file__).parents[2]
SCENE = "cube:40:20x12"


@pytest.mark.parametrize(
    "text", ["cube:512x512", "cube:0:5x5", "fitted:480", "no_file.ply:9x9", ""]
)
def test_a_scene_that_is_none_is_refused(tool, text):
    with pytest.raises(InputError, match="wanted cube:SPLATS"):
        tool("bench.splat_scenes").DrawnScene.parse(text)


@pytest.mark.parametrize("text", ["fitted:64x48", SCENE, "needles:40:20x12"])
def test_a_scene_fills_its_picture(tool, text):
    scene = tool("bench.splat_scenes").DrawnScene.parse(text)
    device = rift.default_device()
    splats = Splats.upload(device, **scene.parameters)
    frame = Renderer(device=device).forward(splats, Camera(*scene.lens))
    hidden = 1 - device.get(frame.transmittance)
    assert hidden.shape == scene.size
    assert 0.1 < hidden.mean() < 0.999


def test_needles_are_long_and_hold_the_volume_of_the_cubes_splats(tool):
    random_splats = tool("bench.splat_scenes").random_splats
    round_ones, long_ones = random_splats(9)["scales"], random_splats(9, long=True)["scales"]
    np.testing.assert_allclose(
        (long_ones / round_ones).prod(axis=1), 0.25**3 * np.ones(9), rtol=1e-5
    )
    np.testing.assert_allclose(
        long_ones[:, 0] / long_ones[:, 1] / (round_ones[:, 0] / round_ones[:, 1]), 40, rtol=1e-5
    )


def test_used_lanes_are_the_pairs_that_count(tool):
    scene = tool("bench.splat_scenes").DrawnScene.parse("cube:300:24x20")
    device = rift.default_device()
    values = scene.parameters | {"scales": 4 * scene.parameters["scales"]}
    splats, camera = Splats.upload(device, **values), Camera(*scene.lens)
    frame = Renderer(device=device).forward(splats, camera)
    found = tool("bench.used_lanes").used_lanes(device, frame)
    screen, depths = (
        device.get(array) for array in (frame.projection.screen, frame.projection.depths)
    )
    order = [k for k in np.argsort(depths, kind="stable") if screen[k, 5] > 0]
    assert found == _one_by_one(screen[order].tolist(), camera.size)


def _one_by_one(screen: list[list[float]], size: tuple[int, int]) -> int:
    """The definition, pixel by pixel and splat by splat."""
    used = 0
    for pixel in range(size[0] * size[1]):
        y, x, left = pixel // size[1] + 0.5, pixel % size[1] + 0.5, 1.0
        for mean_x, mean_y, a, b, c, weight, *_ in screen:
            dx, dy = mean_x - x, mean_y - y
            sigma = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
            alpha = min(weight * math.exp(-sigma), 0.99)
            if alpha < 1 / 255:
                continue
            left *= 1 - alpha
            if left <= 1e-4:
                break
            used += 1
    return used


def test_two_versions_take_turns(tool, tmp_path, capsys, monkeypatch):
    bench = tool("bench_splats")
    out = tmp_path / "splats.json"
    arguments = ["--scenes", SCENE, "--training", "60:24x16", "--rounds", "1"]
    arguments += ["--photographs", "3:24x16:64M"]
    monkeypatch.setattr(
        sys, "argv", ["bench_splats", *arguments, "--against", str(ROOT), "--json", str(out)]
    )
    assert bench.main() == 0
    record = json.loads(out.read_text(encoding="utf-8"))
    (scene,), (training,) = record["scenes"], record["training"]
    assert scene["apart"] == 0
    assert scene["used_lanes"] > 0
    assert min(scene["memory"].values()) > 4 * 40 * (14 + 48)
    both = {"this version", "the other"}
    assert set(scene["cpu_s"]) == set(training["cpu_s"]) == both
    assert set(scene["cpu_s"]["the other"]) >= {"draw", "raster", "raster gradient"}
    (capture,) = record["photographs"]
    assert set(capture["ways"]) == {"kept", "streamed"}
    assert all(way["kept"] == 3 for way in capture["ways"].values())
    printed = capsys.readouterr().out
    assert all(words in printed for words in ("ns per used lane", "Memory", "Photographs"))


def test_growth_has_a_line_for_each_scene(tool, tmp_path, monkeypatch):
    bench = tool("bench_splats")
    monkeypatch.setattr(bench, "_GROWTH", (SCENE, "cube:80:20x12"))
    page = tmp_path / "growth.md"
    arguments = ["--growth", "--rounds", "1", "--no-lanes", "--markdown", str(page)]
    monkeypatch.setattr(sys, "argv", ["bench_splats", *arguments, "--keep", str(tmp_path)])
    assert bench.main() == 0
    (kept,) = tmp_path.glob("*.json")
    record = json.loads(kept.read_text(encoding="utf-8"))
    printed = page.read_text(encoding="utf-8").splitlines()
    lines = [line.split(" | ") for line in printed if "cube:" in line]
    assert [line[1] for line in lines] == ["40", "80"]
    assert [int(line[2]) for line in lines] == [scene["entries"] for scene in record["scenes"]]
    assert "–" not in "".join(map(str, lines))


@pytest.mark.parametrize("text", ["10:480x360", "0:48x36:64M", "5:8x8:64M", "5:48x36:none", ""])
def test_photographs_that_are_none_are_refused(tool, text):
    with pytest.raises(InputError, match="wanted"):
        tool("bench.photographs").PhotographsCase.parse(text)


def test_entries_and_lanes_are_counted_after_a_gradient_as_before(tool, monkeypatch):
    """A gradient of a large scene uses up the lists of the frame that it is of."""
    monkeypatch.setattr(import_module("rift_cl.splat.raster_pass"), "_LARGE_RECORDS", 0)
    device = rift.default_device()
    before, case = (tool("bench.splats").SplatCase(60, 24, device) for _ in range(2))
    assert case.gradients
    assert case.record() == before.record()
    assert case.entries > 0 and case.lanes[0] >= case.lanes[1] > 0
