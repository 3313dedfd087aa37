"""The measure of surfaces knows its ball and which views lie beyond, and tells what it found."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.geometry import Camera

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def measure(monkeypatch):
    monkeypatch.syspath_prepend(TOOLS)
    yield importlib.import_module("measure_surfaces")
    sys.modules.pop("measure_surfaces", None)


def test_the_ball_is_of_radius_1_about_the_origin(measure):
    view = np.eye(4)
    view[:3, 3] = 0, 0, 5
    camera = Camera((31, 41), np.array([[50.0, 0, 20.5], [0, 50, 15.5], [0, 0, 1]]), view)
    depth, normals, facing = measure.ball_seen(camera)
    assert depth[15, 20] == pytest.approx(4) and facing[15, 20] == pytest.approx(1)
    np.testing.assert_allclose(normals[15, 20], (0, 0, -1), atol=1e-12)
    seen = facing > 0
    np.testing.assert_allclose(np.linalg.norm(normals[seen], axis=1), 1, rtol=1e-9)
    assert facing[0, 0] == -1 and 200 < seen.sum() < 400
    y, x = np.argwhere(seen)[0]
    ray = (x + 0.5 - 20.5) / 50, (y + 0.5 - 15.5) / 50, 1
    place = np.array(ray) * depth[y, x] - (0, 0, 5)
    np.testing.assert_allclose(place, normals[y, x], atol=1e-9)


def test_views_beyond_are_the_highest(measure, tmp_path):
    frames = []
    for number in range(16):
        pose = np.eye(4)
        pose[2, 3] = (7 * number) % 16
        frames.append({"file_path": f"{number:02}.png", "transform_matrix": pose.tolist()})
        (tmp_path / f"{number:02}.png").write_bytes(b"picture")
    (tmp_path / "transforms.json").write_text(json.dumps({"w": 4, "frames": frames}))
    low, high = measure._split(tmp_path, tmp_path / "parts")
    heights = {
        folder.name: [
            frame["transform_matrix"][2][3]
            for frame in json.loads((folder / "transforms.json").read_text())["frames"]
        ]
        for folder in (low, high)
    }
    assert sorted(heights["high"]) == [14, 15] and len(heights["low"]) == 14
    assert len(list(low.glob("*.png"))) == 14


def test_every_variant_is_taken_and_what_was_found_is_told(measure):
    for values in measure.VARIANTS.values():
        FitPhotosSettings.of(Path("capture"), Path("out"), **values).check()
    ball = {
        "what": "ball",
        "psnr": 30.0,
        "cpu_s": 9.0,
        "expected": 0.25,
        "median": 0.12,
        "normals": 31.0,
    }
    found = [{"variant": "defaults", **ball}]
    found.append({"variant": "flatness", "what": "lego", "psnr": 28.0, "cpu_s": 8.0})
    first, second = measure.tables(found)
    assert first.rows[0][:5] == ("defaults", "0.250", "0.120", "31.0", "30.00, 9 s")
    assert first.rows[1][5] == "28.00, 8 s" and len(second.rows) == 2
