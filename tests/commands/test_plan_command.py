"""``rift plan``: what it leaves behind, that it can be analysed and rendered, what is refused."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pytest
from test_start import ring

from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.cli import main
from rift_cl.commands.plan.input import plan_input
from rift_cl.commands.plan.report import worth_table
from rift_cl.commands.plan.settings import PlanSettings
from rift_cl.io import open_volume
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import write_json

CAMERA = {
    "name": "mine",
    "focal_length": 16,
    "f_number": 8,
    "pixel_um": 5,
    "size": [1200, 800],
}


def plan(out, *more):
    words = ["plan", "--out", str(out), "--mode", "volume", "--quiet"]
    return main([*words, *map(str, more)])


def metrics_of(folder):
    return json.loads((folder / "metrics.json").read_text())


@pytest.fixture(scope="module")
def cameras(tmp_path_factory):
    path = tmp_path_factory.mktemp("cameras") / "mine.json"
    path.write_text(json.dumps(CAMERA))
    return path


@pytest.fixture(scope="module")
def planned(cameras, tmp_path_factory):
    """Eight views of a target of 60 mm, between 10 and 40 degrees above the horizon."""
    out = tmp_path_factory.mktemp("plans") / "plan"
    words = ("--views", 8, "--diameter", 60, "--elevation", 10, 40, "--center", 0, 0, 5)
    assert plan(out, *words, "--camera", cameras, "--distance", 150, 400) == 0
    return out


def test_a_plan_is_a_capture_that_keeps_to_its_constraints(planned):
    views = open_capture(planned, photographs=False).views
    assert [view.name for view in views] == [f"images/{k:04}.jpg" for k in range(8)]
    for view in views:
        camera = view.camera
        away = camera.center - [0, 0, 5]
        distance = np.linalg.norm(away)
        assert 150 - 1e-6 <= distance <= 400 + 1e-6
        assert 10 - 1e-6 <= math.degrees(math.asin(away[2] / distance)) <= 40 + 1e-6
        # The middle of the target is in the middle of the picture, upright.
        x, y, z = camera.view[:3, :3] @ [0, 0, 5] + camera.view[:3, 3]
        np.testing.assert_allclose([x, y, z], [0, 0, distance], atol=1e-6)
        assert camera.view[1, 2] < 0 and camera.size == (800, 1200)
        # The whole target is in it.
        assert camera.intrinsics[0] * 30 / math.sqrt(distance**2 - 900) <= 400 + 1e-6


def test_its_lens_is_in_the_file_and_in_the_table_for_the_tripod(planned):
    record = json.loads((planned / "transforms.json").read_text())
    for frame in record["frames"]:
        assert frame["aperture_radius"] == pytest.approx(1)
        assert frame["focus_distance"] >= 150 and frame["wavelength"] == 550e-6
        assert (frame["camera"], frame["focal_length"], frame["f_number"]) == ("mine", 16, 8)
        assert frame["exposure"] == 1
    rows = list(csv.DictReader((planned / "views.csv").read_text().splitlines()))
    assert [row["picture"] for row in rows] == [f["file_path"] for f in record["frames"]]
    for row, frame in zip(rows, record["frames"], strict=True):
        azimuth, elevation = (math.radians(float(row[f"{n}, degrees"])) for n in
                              ("azimuth", "elevation"))  # fmt: skip
        way = [math.cos(azimuth) * math.cos(elevation), math.sin(azimuth) * math.cos(elevation),
               math.sin(elevation)]  # fmt: skip
        place = np.array([0, 0, 5]) + float(row["distance, mm"]) * np.array(way)
        np.testing.assert_allclose(place, np.array(frame["transform_matrix"])[:3, 3], atol=0.01)
        assert row["f-number"] == "8" and float(row["focus, mm"]) > 0


def test_the_report_compares_and_says_what_planning_is_worth(planned, capsys):
    found, page = metrics_of(planned), (planned / "report.html").read_text()
    assert set(found["baselines"]) <= {"ring", "arc", "fibonacci", "zigzag", "random"}
    own = found["planned_with"]
    assert 0 < own["bound"] <= own["value"] < 1 and len(found["values"]) == 9
    assert found["values"][-1] == pytest.approx(found["value"], rel=1e-6)
    assert found["value"] <= min(found["baselines"].values()) * 1.02
    assert found["verdict"] in page and page.count("<img") >= 4
    assert "falls as 1/k^2" in page or "fall as 1/k^2" in page
    assert json.loads((planned / "config.json").read_text())["complete"]


def test_what_was_planned_can_be_analysed_without_photographs(planned):
    sampled = open_sampled(AnalyzeSettings(planned, unit=1.0))
    assert sampled.views == 8 and sampled.unit == "mm"
    np.testing.assert_allclose(sampled.target.center, [0, 0, 5], atol=1e-6)
    observations = sampled.observations()
    assert (
        (observations.weight > 0).all()
        and np.isfinite(observations.cutoff).all()
        and observations.blur[:, 1:].any()
    )


@pytest.mark.full
def test_the_same_seed_gives_the_same_plan_and_replaces_one_only_on_demand(
    planned, cameras, capsys
):
    words = ("--views", 8, "--diameter", 60, "--elevation", 10, 40, "--center", 0, 0, 5)
    words += ("--camera", cameras, "--distance", 150, 400)
    names = ("transforms.json", "views.csv")
    before = [(planned / name).read_bytes() for name in names]
    assert plan(planned, *words) == 5
    assert "--overwrite" in capsys.readouterr().err
    assert plan(planned, *words, "--overwrite") == 0
    assert [(planned / name).read_bytes() for name in names] == before


@pytest.mark.full
def test_no_camera_stoops_to_see_the_underside(tmp_path):
    """Nobody stands below the horizon, so that sides that face down are nobody's to show."""
    words = ("--mode", "surface", "--views", 8, "--diameter", 60)
    assert plan(tmp_path / "out", *words) == 0
    frames = json.loads((tmp_path / "out" / "transforms.json").read_text())["frames"]
    ways = np.array([frame["transform_matrix"] for frame in frames])[:, :3, 3]
    heights = ways[:, 2] / np.linalg.norm(ways, axis=1)
    assert np.median(heights) > np.sin(np.radians(25))
    assert heights.max() > np.sin(np.radians(50))


@pytest.mark.full
def test_further_views_are_planned_besides_those_that_were_taken(tmp_path, capsys):
    (tmp_path / "ring").mkdir()
    taken = transforms_of(ring(6), [f"{k}.png" for k in range(6)])
    write_json(tmp_path / "ring" / "transforms.json", taken)
    have = ("--have", tmp_path / "ring", "--unit", 100, "--views", 2)
    assert plan(tmp_path / "more", *have, "--diameter", 100) == 0
    found = metrics_of(tmp_path / "more")
    assert (found["views"], found["taken_before"]) == (2, 6)
    record = json.loads((tmp_path / "more" / "transforms.json").read_text())
    assert len(record["frames"]) == 2 and record["millimetres_per_unit"] == 100
    # Its lengths are in the capture's unit, those of the table in millimetres.
    rows = list(csv.DictReader((tmp_path / "more" / "views.csv").read_text().splitlines()))
    for row, frame in zip(rows, record["frames"], strict=True):
        place = np.array([float(row[f"{axis}, mm"]) for axis in "xyz"])
        np.testing.assert_allclose(
            100 * np.array(frame["transform_matrix"])[:3, 3], place, rtol=1e-5, atol=1e-3
        )
        assert frame["focal_length"] == float(row["focal length, mm"])
    said = capsys.readouterr()
    assert "one unit is 100 mm" in " ".join(said.out.split()) and "--diameter" not in said.err
    np.testing.assert_allclose(found["target"]["center"], [30, -20, 10], atol=1e-4)
    # Without a unit it is said how large one makes the place.
    assert plan(tmp_path / "other", *have[:2], "--views", 1, "--dry-run") == 0
    assert "is taken to be 1 mm" in capsys.readouterr().out


@pytest.mark.full
def test_a_budget_may_end_before_the_views_do(cameras, tmp_path, capsys):
    dear = tmp_path / "dear.json"
    dear.write_text(json.dumps({**CAMERA, "cost": 2}))
    words = ("--views", 5, "--budget", 7, "--diameter", 60, "--camera", dear)
    assert plan(tmp_path / "out", *words) == 0
    assert "does not allow the 5" in " ".join(capsys.readouterr().out.split())
    found = metrics_of(tmp_path / "out")
    assert (found["views"], found["cost"]) == (3, 6)


def test_a_dry_run_states_every_assumption_and_writes_nothing(tmp_path, capsys):
    assert plan(tmp_path / "out", "--dry-run") == 0
    said = capsys.readouterr()
    for word in ("100 mm", "1/k^2", "50 mm, f/11"):
        assert word in said.err
    assert "as near as it fits" in said.out and not (tmp_path / "out").exists()


def test_cameras_ways_places_and_a_pilot_become_what_the_planner_takes(tmp_path, cameras):
    several = {"cameras": [{**CAMERA, "cost": 3, "ranges": {"f_number": [4, 16]}},
                           {**CAMERA, "name": "other", "wavelength_nm": 0}]}  # fmt: skip
    (tmp_path / "two.json").write_text(json.dumps(several))
    away = np.indices((24, 24, 24)) - 11.5
    ball = (np.linalg.norm(away, axis=0) < 7).astype(np.float32)
    with open_volume(tmp_path / "pilot.zarr", ball.shape, format="zarr", spacing=1.0) as writer:
        writer.write(0, ball)
    settings = PlanSettings(
        views=4, camera=(tmp_path / "two.json",), path="tilted-rings", rings=3, mode="surface",
        keep_out=("body-sphere:0,0,-200,50", "box:-inf,-inf,-inf,inf,inf,-60",
                  "cone:0,0,500,0,0,1,20"),
        budget=9.0, pilot=tmp_path / "pilot.zarr", azimuth=(0.0, 360.0),
    )  # fmt: skip
    settings.check()
    given = plan_input(settings)
    first, second = given.types
    assert (first.focal_length, first.pixel, first.size) == (16, 5e-3, (800, 1200))
    assert second.wavelength == 0 and given.constraints.ranges["mine"].f_number == (4, 16)
    assert given.constraints.path.count == 3 and given.constraints.azimuth == (0, 2 * math.pi)
    assert [k.hides for k in given.constraints.keepouts] == [True, False, False]
    assert given.constraints.budget.cost("mine", 1) == 3
    assert given.target.mode == "surface" and len(given.target.normals) > 8
    assert not any("transparent" in note for note in given.notes)
    assert any("pilot" in note for note in given.notes)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--views", 0), "--views is 0"),
        (("--views", -3), "--views is -3"),
        (("--diameter", 0), "--diameter is 0"),
        (("--elevation", 50, 20), "--elevation is 50 20"),
        (("--elevation", 0, 100), "--elevation is 0 100"),
        (("--azimuth", "nan", 5), "--azimuth is nan"),
        (("--distance", 0.001, 20), "distance ends at 20"),
        (("--diameter", 1e300), "diameter is 1e+300"),
        (("--diameter", 1e-300), "diameter is 1e-300"),
        (("--azimuth", -720, 720), "--azimuth is -720 720, more than the full circle"),
        (("--path", "tilted-rings", "--azimuth", 0, 90), "--azimuth is 0 90"),
        (("--distance", -5, 20), "--distance is -5"),
        (("--cover", 0), "--cover is 0"),
        (("--budget", 0), "--budget is 0"),
        (("--snr", -1), "--snr is -1"),
        (("--seed", -1), "--seed is -1"),
        (("--unit", 5), "--unit"),
        (("--keep-out", "ball:1,2,3"), "--keep-out is 'ball:1,2,3'"),
        (("--keep-out", "sphere:0,0,0,-3"), "radius is -3"),
        (("--keep-out", "sphere:0,0,0,99999"), "no place"),
        (("--lens", "nowhere.json"), "nowhere.json"),
        (("--lens", "broken.zmx"), "broken.zmx"),
        (("--camera", "nowhere.json"), "nowhere.json"),
        (("--have", "nowhere"), "nowhere"),
        (("--have", "broken.zmx"), "broken.zmx"),
        (("--pilot", "nowhere"), "nowhere"),
        (("--path", "tilted-rings", "--rings", 0), "count is 0"),
    ],
)
def test_what_makes_no_sense_is_named_and_leaves_nothing(
    tmp_path, monkeypatch, capsys, more, words
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.zmx").write_bytes(b"\xff\xfe\x00garbage")
    assert plan(tmp_path / "out", "--views", 4, *more) == 3
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("criterion", "mode", "near"),
    [
        ("wiener", "volume", "none above 0.5%"),
        ("logdet", "volume", "none above 1.5%"),
        ("wiener", "surface", "0.4%"),
    ],
)
def test_gains_that_sampled_frequencies_do_not_tell_are_none(criterion, mode, near):
    metrics = {
        "criterion": criterion,
        "mode": mode,
        "value": 1.0,
        "baselines": {"ring": 1.004, "random": 1.25},
    }
    assert [row[2] for row in worth_table(metrics)[1]] == ["", near, "20.0%"]
