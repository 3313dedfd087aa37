"""``rift analyze`` and ``rift plan`` of what is opaque: nothing is suggested behind a wall."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from walls import WALL, arc, points_before_a_wall

from rift_cl.commands.analyze.facts import one_place
from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.analyze.suggestions import cameras_to_add, usual_distance
from rift_cl.commands.cli import main
from rift_cl.commands.inputs.surfaces import ASTRAY, sides_of
from rift_cl.commands.plan.input import plan_input
from rift_cl.commands.plan.settings import PlanSettings
from rift_cl.geometry import Camera
from rift_cl.io.captures.point_cloud import write_point_cloud
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import write_json
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.sampling.planning.planner import plan


def capture(folder, cameras, points=None):
    """A capture without photographs, with sparse points if they are given."""
    folder.mkdir()
    record = transforms_of(cameras, [f"{k}.png" for k in range(len(cameras))])
    if points is not None:
        write_point_cloud(folder / "points.ply", points, None)
        record["ply_file_path"] = "points.ply"
    write_json(folder / "transforms.json", record)
    return folder


def metrics_of(folder):
    return json.loads((folder / "metrics.json").read_text())


def before_the_wall(cameras):
    return np.array([camera.center[0] + WALL for camera in cameras])


@pytest.fixture(scope="module")
def walled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("captures") / "walled"
    return capture(folder, arc(), points_before_a_wall())


def splats_of(points):
    """Solid discs at points."""
    count = len(points)
    return SplatScene(
        means=points,
        log_scales=np.full((count, 3), math.log(0.07)),
        quats=np.tile([1.0, 0, 0, 0], (count, 1)),
        logit_opacities=np.full(count, 4.0),
        sh=np.zeros((count, 1, 3)),
    )


@pytest.mark.full
def test_no_camera_is_suggested_behind_a_wall_that_sparse_points_show(walled, tmp_path):
    out = tmp_path / "out"
    words = ["analyze", str(walled), "--out", str(out), "--diameter", "1.2", "--add", "3"]
    assert main([*words, "--quiet"]) == 0
    rows = list(csv.DictReader((out / "views.csv").read_text().splitlines()))
    assert min(float(row["x, units"]) + WALL for row in rows) > 0 and len(rows) == 3
    found, page = metrics_of(out), (out / "report.html").read_text()
    assert found["mode"] == "surface" and 0.2 < found["shut_sides"] < 0.6
    assert found["unknown_with_added"] < found["unknown"]
    # Fur is resolved however few the views are.
    assert {point["limited_by"] for point in found["limits"]} == {"pixel"}
    assert "number of views" not in page and "the sparse points" in page
    # Geometry is known: suggestions go wherever it leaves room.
    assert "from the views at hand" not in page
    # What did not hold against held-out photographs is not said.
    assert "farthest from all views" in page and "a pixel of parallax is" not in page


@pytest.mark.full
def test_fitted_splats_tell_what_is_in_the_way_as_well(tmp_path):
    folder = capture(tmp_path / "fit", arc())
    splats_of(points_before_a_wall()).save(folder / "scene.ply")
    sampled = open_sampled(AnalyzeSettings(folder, diameter=1.2))
    assert any("fitted splats" in note for note in sampled.notes)
    assert before_the_wall(cameras_to_add(sampled, 2)).min() > 0
    scaled = open_sampled(AnalyzeSettings(folder, diameter=1.2, unit=100.0))
    np.testing.assert_allclose(
        [sides_of(one, usual_distance(one)).shut for one in (scaled, sampled)],
        sides_of(sampled, usual_distance(sampled)).shut,
    )


@pytest.mark.full
def test_where_nothing_tells_what_stands_where_suggestions_stay_near_and_say_so(tmp_path, capsys):
    folder, out = capture(tmp_path / "bare", arc()), tmp_path / "out"
    sampled = open_sampled(AnalyzeSettings(folder, diameter=1.2))
    assert sampled.space is None
    words = ["--diameter", "1.2", "--add", "2", "--quiet"]
    assert main(["analyze", str(folder), "--out", str(out), *words]) == 0
    assert f"about {ASTRAY:.0f} degrees from the views at hand" in capsys.readouterr().out
    for row in csv.DictReader((out / "views.csv").read_text().splitlines()):
        place = np.array([float(row[f"{axis}, units"]) for axis in "xyz"])
        way = place / np.linalg.norm(place)
        assert (sampled.directions() @ way).max() > math.cos(math.radians(ASTRAY + 3))


def test_an_arc_is_told_of_the_side_that_it_misses(tmp_path, capsys):
    folder, out = capture(tmp_path / "bare", arc()), tmp_path / "out"
    words = ["--diameter", "1.2", "--add", "0", "--quiet"]
    assert main(["analyze", str(folder), "--out", str(out), *words]) == 0
    printed, found = capsys.readouterr().out, metrics_of(out)
    assert found["largest_gap_degrees"] > 90
    assert f"is {found['largest_gap_degrees']:.3g} degrees from the nearest" in printed
    assert f"{found['uncovered_sides']:.1%} of the target's sides are seen by no view" in printed


@pytest.mark.full
def test_a_plan_besides_such_views_says_that_nothing_is_known(tmp_path, walled):
    bare = capture(tmp_path / "bare", arc())
    for folder, known in ((bare, False), (walled, True)):
        settings = PlanSettings(have=folder, unit=100.0, diameter=120.0, distance=(380.0, 450.0))
        given = plan_input(settings)
        assert any("not known" in note for note in given.notes) != known
        assert len(given.constraints.keepouts) == known


def test_depth_that_contradicts_the_cameras_is_not_made_use_of(tmp_path):
    cameras = arc()
    near = np.concatenate([0.2 * c.center + 0.02 * np.eye(3) for c in cameras for _ in range(9)])
    fog = np.concatenate([camera.center * 0.9 + np.random.default_rng(k).uniform(-0.3, 0.3, (99, 3))
                          for k, camera in enumerate(cameras)])  # fmt: skip
    folder = capture(tmp_path / "fog", cameras, np.concatenate([near, fog]))
    sampled = open_sampled(AnalyzeSettings(folder, diameter=1.2))
    assert sampled.space is None
    assert any("not used" in note for note in sampled.notes)


def largest_gap(**settings):
    """Degrees of azimuth without a view, of twelve as the command plans them."""
    given = plan_input(PlanSettings(views=12, diameter=60.0, elevation=(0, 20), **settings))
    target = replace(given.target, degree=min(given.target.degree, 8))
    found = plan(target, 12, given.constraints, given.types, method="greedy", compare=False)
    turns = np.sort(np.degrees(found.azimuth))
    return float(np.diff([*turns, turns[0] + 360]).max())


@pytest.mark.full
def test_the_back_of_an_opaque_target_is_planned_for():
    assert largest_gap() < 100
    # Seen through, opposite views tell the same.
    assert largest_gap(mode="volume") > largest_gap()


@pytest.mark.full
def test_views_besides_those_that_were_taken_keep_off_the_wall(walled, tmp_path):
    out = tmp_path / "plan"
    words = ["plan", "--have", str(walled), "--views", "4", "--unit", "100", "--diameter", "120"]
    assert main([*words, "--distance", "380", "450", "--out", str(out), "--quiet"]) == 0
    rows = csv.DictReader((out / "views.csv").read_text().splitlines())
    assert min(float(row["x, mm"]) for row in rows) > -100 * WALL


def test_a_scan_has_no_surface(scan, tmp_path, capsys):
    words = ["analyze", str(scan.integrals), "--mode", "surface", "--out", str(tmp_path / "out")]
    assert main(words) == 3
    assert "--mode surface" in capsys.readouterr().err


@pytest.mark.full
def test_two_views_far_apart_tell_more_of_depth_than_two_side_by_side(tmp_path):
    depths = []
    for reach in (2.0, 30.0):
        folder = capture(tmp_path / f"{reach}", arc(2, reach))
        out = tmp_path / f"out{reach}"
        assert main(["analyze", str(folder), "--out", str(out), "--add", "0", "--quiet"]) == 0
        depths.append(metrics_of(out)["limits"][0])
    near, far = (entry["depth"] for entry in depths)
    # 2 tan(t / 2) of the angle between them, and the pixel at their distance.
    lift = math.atan(0.25)
    between = [math.acos(math.cos(math.radians(2 * r)) * math.cos(lift) ** 2 + math.sin(lift) ** 2)
               for r in (2.0, 30.0)]  # fmt: skip
    assert near / far == pytest.approx(
        math.tan(between[1] / 2) / math.tan(between[0] / 2), rel=0.01
    )
    alone = Camera((60, 60), [[60, 0, 30], [0, 60, 30], [0, 0, 1]], arc(1, 0)[0].view)
    folder, out = capture(tmp_path / "alone", [alone]), tmp_path / "one"
    words = ["analyze", str(folder), "--out", str(out), "--add", "0", "--quiet"]
    assert main([*words, "--center", "0", "0", "0", "--diameter", "1"]) == 0
    assert "depth is not resolved" in (out / "report.html").read_text()


@pytest.mark.parametrize("mode", ["surface", "volume"])
def test_views_at_one_place_are_called_so(tmp_path, mode):
    for name, cameras in (("one", arc(8, 0.5)), ("several", arc(8, 10))):
        folder = capture(tmp_path / name, cameras)
        sampled = open_sampled(
            AnalyzeSettings(folder, mode=mode, center=(0.0, 0.0, 0.0), diameter=1.0)
        )
        assert ("one place" in " ".join(one_place(sampled))) == (name == "one")
