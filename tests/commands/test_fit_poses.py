"""Poses in any unit, with other axes, far from the origin: the same scene, or a sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_start import moved, ring, survey, turned

from rift_cl.commands.cameras.pose_check import check_poses
from rift_cl.commands.cli import main
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.io.scenes.splat_scene import SplatScene

MIDDLE = np.array([0.3, -0.2, 0.1])
WHERE = Path("capture")


def reposed(capture, folder, scale, count=None):
    """The same photographs, or the first of them, in another unit of length."""
    folder.mkdir()
    record = json.loads((capture / "transforms.json").read_text())
    record["frames"] = record["frames"][:count]
    for frame in record["frames"]:
        name, pose = frame["file_path"], np.array(frame["transform_matrix"])
        (folder / name).write_bytes((capture / name).read_bytes())
        pose[:3, 3] *= scale
        frame["transform_matrix"] = pose.tolist()
    (folder / "transforms.json").write_text(json.dumps(record))
    return folder


def fitted(capture, out, *more):
    given = ["--steps", 120, "--splats", 300, "--hold-out", 4, *more]
    assert main(["fit", "photos", str(capture), "--out", str(out), *map(str, given)]) == 0
    return json.loads((out / "metrics.json").read_text())["scores"]


@pytest.mark.full
def test_no_unit_of_positions_changes_a_fit(capture, tmp_path):
    """Near planes, penalties, learning rates and starts all go by the size of the scene."""
    found, near = {}, {}
    for name, scale in (("usual", 1.0), ("large", 1024.0), ("small", 2.0**-10)):
        units = reposed(capture, tmp_path / name, scale)
        found[name] = fitted(units, tmp_path / f"fit {name}")["held out"]["fit_psnr"]
        config = json.loads((tmp_path / f"fit {name}" / "config.json").read_text())
        near[name] = config["settings"]["rendering"]["near"] / scale
    assert near["usual"] == near["large"] == near["small"] > 0
    assert np.ptp([*found.values()]) < 0.3


@pytest.mark.parametrize(("scale", "near"), [(1e-3, 0.002), (1e3, 0.01)])
def test_a_file_of_a_small_scene_is_not_behind_the_near_plane(tmp_path, scale, near):
    count = 40
    SplatScene(
        means=np.random.default_rng(0).uniform(-scale, scale, (count, 3)),
        log_scales=np.full((count, 3), np.log(0.1 * scale)),
        quats=np.tile([1.0, 0, 0, 0], (count, 1)),
        logit_opacities=np.zeros(count),
        sh=np.zeros((count, 1, 3)),
    ).save(tmp_path / "scene.ply")
    drawn = OpenedScene(SceneInput(scene=tmp_path / "scene.ply")).rendering
    assert drawn.near_plane <= near * min(scale, 1) * 1.8


def inverted(cameras, before, after):
    return [
        Camera(c.size, c.K, np.diag(before) @ np.linalg.inv(c.view) @ np.diag(after))
        for c in cameras
    ]


PLAIN, TURN = (1, 1, 1, 1), (1, -1, -1, 1)
WRONG = {
    "other axes": (lambda cameras: turned(cameras, TURN[:3]), "OpenCV's"),
    "inverted": (lambda cameras: inverted(cameras, PLAIN, PLAIN), "from world to camera"),
    "inverted, OpenGL": (lambda cameras: inverted(cameras, TURN, TURN), "from world to camera"),
    "inverted, other axes": (
        lambda cameras: inverted(cameras, TURN, PLAIN),
        "from world to camera",
    ),
    "elsewhere": (lambda cameras: turned(ring(middle=MIDDLE + 50), TURN[:3]), "check the poses"),
}


@pytest.mark.parametrize("case", WRONG)
def test_poses_that_look_past_the_points_are_told_with_what_they_are(case):
    change, words = WRONG[case]
    points = MIDDLE + np.random.default_rng(0).normal(0, 0.5, (300, 3)).astype(np.float32)
    check_poses(ring(), points, WHERE)
    with pytest.raises(InputError, match=f"capture: half of the photographs.*{words}"):
        check_poses(change(ring()), points, WHERE)


def test_each_picture_of_a_survey_may_show_few_of_the_points():
    cameras = survey(400)
    points = np.random.default_rng(0).uniform((0, -1, 3.9), (270, 1, 4.1), (20_000, 3))
    check_poses(cameras, points.astype(np.float32), WHERE)
    with pytest.raises(InputError, match="check the poses"):
        check_poses(turned(cameras, (1, -1, -1)), points.astype(np.float32) + 500, WHERE)


def test_few_pictures_may_miss_the_points_and_points_may_be_missing():
    points = MIDDLE + np.random.default_rng(0).normal(0, 0.5, (300, 3)).astype(np.float32)
    some = [*ring(8), *turned(ring(4), (1, -1, -1))]
    check_poses(some, points, WHERE)
    check_poses(turned(ring(), (1, -1, -1)), None, WHERE)


def test_coordinates_that_float32_cannot_tell_apart_are_told_with_what_to_subtract():
    for middle in ((1e3, 2e3, 0), (4.5e5, 5.4e6, 100)):
        cameras = ring(middle=np.array(middle))
        if middle[0] < 1e4:
            check_poses(cameras, None, WHERE)
            continue
        with pytest.raises(InputError, match=r"steps of 0.5.*subtract \(450000, 5400000, 101\)"):
            check_poses(cameras, None, WHERE)
        # The same in kilometres of a scene of kilometres.
        check_poses(moved(ring(), 1e6), None, WHERE)


@pytest.mark.full
def test_of_two_photographs_none_is_held_out(capture, tmp_path, capsys):
    two = reposed(capture, tmp_path / "two", 1.0, 2)
    assert fitted(two, tmp_path / "fit") == {}
    assert "None of the 2 photographs was held out" in capsys.readouterr().err
