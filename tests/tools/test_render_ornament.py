"""``tools/render_ornament.py`` without its tracer: cameras, files, runs that go on."""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rift_cl.errors import InputError, OutputError, RiftError
from rift_cl.io import open_capture

TOOLS = Path(__file__).parents[2] / "tools"
SIZE = (24, 32)


@pytest.fixture
def cameras(tool):
    return tool("ornament.cameras")


@pytest.fixture
def script(tool):
    return tool("render_ornament")


def projected(camera, point):
    """Where a point of the world lands, in pixels."""
    local = camera.view[:3, :3] @ point + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return np.array([fx * local[0] / local[2] + cx, fy * local[1] / local[2] + cy]), local[2]


def test_every_built_in_camera_looks_at_the_ornament_with_z_up(cameras):
    for pose in (*cameras.ring(5, 12, 5.5), *cameras.off_path(24)):
        (shot,) = cameras.shots_at([pose], SIZE, 45)
        place, depth = projected(shot.camera, np.array(cameras.TARGET))
        np.testing.assert_allclose(place, (16, 12), atol=1e-9)
        assert depth == pytest.approx(np.linalg.norm(pose[:3, 3] - cameras.TARGET))
        above, _ = projected(shot.camera, np.array([0, 0, 0.5]))
        assert above[0] == pytest.approx(16) and above[1] < 12


def test_the_field_of_view_spans_the_width(cameras):
    (shot,) = cameras.shots_at(cameras.ring(1, 12, 5.5), SIZE, 45)
    assert math.degrees(2 * math.atan(16 / shot.focal)) == pytest.approx(45)


def test_a_ring_is_even_and_keeps_its_height(cameras):
    places = np.array([pose[:3, 3] for pose in cameras.ring(12, 12, 5.5)]) - cameras.TARGET
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 5.5)
    np.testing.assert_allclose(np.degrees(np.arcsin(places[:, 2] / 5.5)), 12)
    turns = np.unwrap(np.arctan2(places[:, 1], places[:, 0]))
    np.testing.assert_allclose(turns, np.arange(12) * np.pi / 6, atol=1e-12)


def test_views_off_the_path_differ_in_all_three_ways(cameras):
    places = np.array([pose[:3, 3] for pose in cameras.off_path(24)]) - cameras.TARGET
    far = np.linalg.norm(places, axis=1)
    up = np.degrees(np.arcsin(places[:, 2] / far))
    assert far.min() == pytest.approx(5) and far.max() == pytest.approx(6)
    assert up.min() == pytest.approx(2) and up.max() == pytest.approx(30)
    assert len({(round(a), round(b, 3)) for a, b in zip(up, far, strict=True)}) == 24
    turns = np.degrees(np.arctan2(places[:, 1], places[:, 0])) % 360
    np.testing.assert_allclose((turns[1:] - turns[:-1]) % 360, 137.50776405)


def test_the_package_reads_back_the_very_cameras(script, tmp_path):
    settings = script.Settings(views=3, size=(32, 24))
    shots = run(script, settings, tmp_path)
    views = open_capture(tmp_path).views
    assert [view.camera for view in views] == [shot.camera for shot in shots]
    assert [view.name for view in views] == [f"images/000{k}.png" for k in range(3)]


def run(script, settings, out, draw=None):
    """Run with a painter that needs no tracer."""
    shots = script.shots_of(settings)
    draw = draw or (lambda number: np.full((*shots[0].size, 3), number / 10))
    record = script.record_of(settings, shots, "a painter")
    list(script.render_capture(out, record, draw))
    return shots


def test_the_cameras_of_a_file_are_taken_as_they_are(cameras, script, tmp_path):
    settings = script.Settings(
        off_path=True, views=4, size=(40, 30), aperture_radius=0.1, focus_distance=4.6
    )
    before = run(script, settings, tmp_path)
    after = cameras.shots_of_file(tmp_path / "transforms.json")
    assert [s.camera for s in after] == [s.camera for s in before]
    assert {(s.aperture_radius, s.focus_distance) for s in after} == {(0.1, 4.6)}
    larger = cameras.shots_of_file(tmp_path / "transforms.json", (60, 80))
    point = np.array([0.3, -0.2, 0.4])
    for one, two in zip(after, larger, strict=True):
        here, there = projected(one.camera, point)[0], projected(two.camera, point)[0]
        np.testing.assert_allclose(there, 2 * here)
    pinholes = script.Settings(cameras=tmp_path / "transforms.json", aperture_radius=0.0)
    assert {s.aperture_radius for s in script.shots_of(pinholes)} == {0.0}
    with pytest.raises(InputError, match="same proportions"):
        cameras.shots_of_file(tmp_path / "transforms.json", (60, 60))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"k1": 0.1}, "distorted lens"),
        ({"camera_model": "OPENCV_FISHEYE"}, "distorted lens"),
        ({"fl_y": 50.0}, "must be square"),
        ({"w": None}, "has no 'w'"),
        ({"fl_x": None, "camera_angle_x": None}, "has no 'fl_x'"),
        ({"frames": []}, "'frames' is empty"),
        ({"frames": [{}]}, "transform_matrix"),
        ({"frames": [{"transform_matrix": (2 * np.eye(4)).tolist()}]}, "transform_matrix"),
        ({"frames": [{"transform_matrix": np.diag([2.0, 2, 2, 1]).tolist()}]}, "scales the scene"),
        ({"frames": "none"}, "wanted a list"),
    ],
)
def test_a_lens_or_pose_that_is_not_rendered_is_named(cameras, script, tmp_path, changes, words):
    run(script, script.Settings(views=2, size=(8, 6)), tmp_path)
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))
    with pytest.raises(RiftError, match=words):
        cameras.shots_of_file(path)


def test_frames_of_several_lenses_are_refused(cameras, script, tmp_path):
    run(script, script.Settings(views=2, size=(8, 6)), tmp_path)
    path = tmp_path / "transforms.json"
    record = json.loads(path.read_text())
    record["frames"][1]["fl_x"] = record["frames"][1]["fl_y"] = 77.0
    path.write_text(json.dumps(record))
    with pytest.raises(InputError, match="several lenses"):
        cameras.shots_of_file(path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"views": 0}, "--views is 0"),
        ({"samples": 0}, "--samples is 0"),
        ({"seed": -1}, "--seed is -1"),
        ({"size": (0, 4)}, "--size is"),
        ({"elevation": 90.0}, "--elevation is 90"),
        ({"distance": 0.5}, "--distance is 0.5"),
        ({"distance": float("nan")}, "--distance is nan"),
        ({"field": 180.0}, "--field is 180"),
        ({"aperture_radius": -0.1, "focus_distance": 4.0}, "--aperture-radius is -0.1"),
        ({"aperture_radius": 0.1}, "--focus-distance is None"),
        ({"aperture_radius": 0.1, "focus_distance": -1.0}, "--focus-distance is -1"),
        ({"cameras": Path("nowhere.json")}, "nowhere.json"),
    ],
)
def test_settings_that_make_no_sense_are_named(script, changes, words):
    with pytest.raises(InputError, match=words):
        script.shots_of(script.Settings(**changes))


def test_an_interrupted_run_goes_on_and_draws_nothing_twice(script, tmp_path):
    settings, drawn = script.Settings(views=4, size=(8, 6)), []

    def until(last):
        def draw(number):
            if number == last:
                raise KeyboardInterrupt
            drawn.append(number)
            return np.full((6, 8, 3), number / 10)

        return draw

    with pytest.raises(KeyboardInterrupt):
        run(script, settings, tmp_path, until(2))
    assert drawn == [0, 1]
    assert not (tmp_path / "transforms.json").exists()
    run(script, settings, tmp_path, until(None))
    assert drawn == [0, 1, 2, 3]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["images", "transforms.json"]
    (tmp_path / "images" / "0001.png").unlink()
    run(script, settings, tmp_path, until(None))
    assert drawn == [0, 1, 2, 3, 1]
    assert len(list((tmp_path / "images").iterdir())) == 4


def test_pictures_of_other_settings_are_kept(script, tmp_path):
    settings = script.Settings(views=2, size=(8, 6))
    run(script, settings, tmp_path)
    before = (tmp_path / "images" / "0001.png").read_bytes()
    for changes, key in (({"seed": 1}, "scene_seed"), ({"views": 3}, "frames")):
        with pytest.raises(OutputError, match=f"differ in .*{key}"):
            run(script, dataclasses.replace(settings, **changes), tmp_path)
    assert (tmp_path / "images" / "0001.png").read_bytes() == before


def test_a_folder_with_other_things_is_refused(script, tmp_path):
    (tmp_path / "notes.txt").write_text("keep")
    with pytest.raises(OutputError, match="holds other things"):
        run(script, script.Settings(views=1, size=(8, 6)), tmp_path)
    (tmp_path / "render.json").write_text("{")
    with pytest.raises(OutputError, match=r"render\.json"):
        run(script, script.Settings(views=1, size=(8, 6)), tmp_path)
    assert not (tmp_path / "images").exists()


def test_the_script_says_in_a_sentence_what_is_wrong(tmp_path):
    command = [sys.executable, str(TOOLS / "render_ornament.py"), "--views", "0"]
    command += ["--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 3
    assert done.stderr == "render_ornament: --views is 0, wanted 1 or more\n"
    assert not (tmp_path / "out").exists()
