"""``rift analyze``: what a ring, a single camera and scans sample, and what is refused."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import h5py
import numpy as np
import pytest
from test_start import MIDDLE_OF_RING, ring

from rift_cl.commands.analyze.facts import missing, resolution, unknown_share
from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.analyze.suggestions import angles_to_add
from rift_cl.commands.cli import main
from rift_cl.geometry import Camera, Fan
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.scan_cameras import scan_cameras
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import write_json
from rift_cl.sampling.targets.observations import Observations

# The ring's cameras stand so far above its middle.
ELEVATION = math.degrees(math.atan(0.3))


def capture(folder, cameras):
    """A transforms.json without its photographs."""
    folder.mkdir()
    names = [f"{k}.png" for k in range(len(cameras))]
    write_json(folder / "transforms.json", transforms_of(cameras, names))
    return folder


@pytest.fixture(scope="module")
def ringed(tmp_path_factory):
    return capture(tmp_path_factory.mktemp("captures") / "ring", ring(48))


def analyze(source, out, *more):
    words = ["analyze", str(source), "--out", str(out), "--mode", "volume", "--quiet"]
    return main([*words, *map(str, more)])


def metrics_of(folder):
    return json.loads((folder / "metrics.json").read_text())


def page_of(folder):
    return (folder / "report.html").read_text()


@pytest.mark.full
def test_a_ring_misses_a_cone_about_its_axis_and_views_above_it_are_suggested(
    ringed, tmp_path, capsys
):
    out = tmp_path / "analysis"
    assert analyze(ringed, out, "--add", 2) == 0
    printed = capsys.readouterr()
    assert "largest hole" in printed.out and "report.html" in printed.out
    # What was assumed is said on the console as well.
    assert "--diameter" in printed.err and "--center" in printed.err
    found = metrics_of(out)
    assert (found["views"], found["views_of_center"], found["unit"]) == (48, 48, "unit")
    np.testing.assert_allclose(found["target"]["center"], MIDDLE_OF_RING, atol=1e-6)
    for hole in found["missing"][1:]:
        assert abs(hole["axis"][2]) > 0.999
        assert hole["half_angle_degrees"] == pytest.approx(ELEVATION, abs=0.3)
    assert not found["orlov"] and found["tuy"]["unmet"] > 0
    shares = [hole["share"] for hole in found["missing"]]
    assert shares == sorted(shares) and shares[2] > 1 - math.cos(math.radians(10))
    assert found["crowther"]["needed"] == math.ceil(16 * math.pi)
    assert len(found["add"]) == 2 and found["unknown_with_added"] < found["unknown"] < 1
    assert len((out / "views.csv").read_text().splitlines()) == 3
    page = page_of(out)
    assert page.count("<img") >= 4 and "not measured" in page
    assert json.loads((out / "config.json").read_text())["complete"]
    # It is replaced only on demand, and nothing of it stays.
    assert analyze(ringed, out) == 5
    assert "--overwrite" in capsys.readouterr().err
    assert analyze(ringed, out, "--add", 0, "--overwrite") == 0
    assert not (out / "views.csv").exists()


def found_of(source, **settings):
    """The views, and what limits their detail, without a report."""
    settings = AnalyzeSettings(source, **settings)
    settings.check()
    sampled = open_sampled(settings)
    return sampled, resolution(sampled, ("a", "b", "c")).figures["limits"]


@pytest.mark.full
def test_lengths_are_millimetres_once_the_unit_is_known(ringed):
    units, in_units = found_of(ringed, aperture=0.02)
    mm, in_mm = found_of(ringed, aperture=0.02, unit=100.0)
    assert (units.unit, mm.unit) == ("unit", "mm")
    assert mm.target.diameter == pytest.approx(100 * units.target.diameter)
    for key in ("pixel", "number_of_views"):
        assert in_mm[1][key] * 100 == pytest.approx(in_units[1][key], rel=1e-6)
    # 2 R / (lambda z) of a pupil of 2 mm at 522 mm with 550 nm, at a tenth of the contrast.
    cutoff = 4 / (550e-6 * 100 * 5 * math.hypot(1, 0.3))
    assert in_mm[0]["diffraction"] == pytest.approx(0.8054 * cutoff, rel=1e-3)
    assert in_units[0]["diffraction"] == math.inf
    assert unknown_share(mm) == pytest.approx(unknown_share(units), rel=1e-2)


def test_the_lens_of_the_file_comes_before_that_of_the_command(tmp_path):
    lens = Aperture(0.05, 5.22, 1e-6)
    cameras = [Camera(c.size, c.K, c.view, aperture=lens) for c in ring(8)]
    source = capture(tmp_path / "sharp", cameras)
    own, other = (found_of(source, aperture=radius)[1] for radius in (0.05, 0.5))
    assert own == other and 0 < own[1]["depth_of_field"] < math.inf


@pytest.mark.full
def test_one_camera_still_gets_an_answer(tmp_path, capsys):
    source = capture(tmp_path / "alone", ring(1))
    center = [f"{x}" for x in MIDDLE_OF_RING]
    assert analyze(source, tmp_path / "out", "--center", *center, "--diameter", 1, "--add", 1) == 0
    found, page = metrics_of(tmp_path / "out"), page_of(tmp_path / "out")
    assert found["views"] == 1 and found["missing"][1]["share"] > 0.5
    assert "A single view" in page
    assert found["limits"][0]["limited_by"] == "number of views"
    assert analyze(source, tmp_path / "guessed", "--dry-run") == 0
    assert "A single camera" in capsys.readouterr().err


@pytest.mark.full
def test_a_parallel_scan_has_directions_and_no_cameras(scan, tmp_path, capsys):
    assert analyze(scan.integrals, tmp_path / "all") == 0
    found = metrics_of(tmp_path / "all")
    assert found["views"] == 150 and found["tuy"] is None
    assert found["largest_gap_degrees"] == pytest.approx(180 / 150)
    # pi D / d with d two bins.
    assert found["crowther"]["needed"] == math.ceil(math.pi * 96 / 2)
    assert page_of(tmp_path / "all").count("<img") == 3
    assert not (tmp_path / "all" / "views.csv").exists()
    printed = " ".join(capsys.readouterr().out.split())
    assert "Crowther" in printed and "To add:" in printed
    # Crowther's own pi D / K is of all directions, and a ninth longer.
    (period,) = re.findall(r"and resolve (\S+) .+ in nine tenths of all directions", printed)
    own = math.pi * found["target"]["diameter"] / 150
    assert float(period) == pytest.approx(0.9 * own, rel=0.02)


def test_the_axis_of_counts_is_searched_in_their_line_integrals(scan, tmp_path, capsys):
    lone = tmp_path / "lone.h5"
    with h5py.File(scan.counts) as file, h5py.File(lone, "w") as copy:
        for name, named in (("data", "seen"), ("data_white", "beam"), ("data_dark", "none")):
            copy[named] = file[f"exchange/{name}"][:]
        copy["turn"] = file["exchange/theta"][:]
    asked = AnalyzeSettings(lone, dataset="seen", theta="turn")
    sampled = open_sampled(asked)
    assert sampled.scan.center == (96 - 1) / 2
    assert "there are no flats" in sampled.notes[-2]
    sampled = open_sampled(replace(asked, flats="beam", darks="none"))
    assert sampled.scan.center == pytest.approx(45, abs=0.1)
    for more in (("--flats", "no-beam"), ("--background", 1000)):
        named = ("--dataset", "seen", "--theta", "turn", *more)
        assert analyze(lone, tmp_path / "out", *named) == 3
        assert str(more[1]) in capsys.readouterr().err


def test_a_wedge_of_a_scan_is_missing_and_its_middle_is_suggested(scan):
    sampled = open_sampled(AnalyzeSettings(scan.integrals, theta="0:120"))
    hole = missing(sampled).figures["missing"][1]
    assert hole["half_angle_degrees"] == pytest.approx(30.4, abs=0.1)
    gap, added = angles_to_add(sampled.scan.angles, 3)
    assert gap == pytest.approx(60.8)
    np.testing.assert_allclose(added, [149.6, 134.4, 164.8])


def test_a_displaced_detector_shows_more_on_one_side(tmp_path):
    """Its axis is at bin 20 of 80: it shows a disc of 119 bins, most of it in some views alone."""
    path = tmp_path / "scan.npz"
    angles, random = 2 * np.pi * np.arange(360) / 360, np.random.default_rng(0)
    rows = 0
    for x, y in random.uniform(-35, 35, (12, 2)):
        places = np.arange(80) - 20 - (np.cos(angles) * x + np.sin(angles) * y)[:, None]
        rows = rows + np.exp(-((places / 3) ** 2))
    np.savez(path, projections=rows[:, None].astype(np.float32), angles=angles)
    sampled = open_sampled(AnalyzeSettings(path, kind="attenuation"))
    assert sampled.scan.center == pytest.approx(20, abs=0.1)
    assert sampled.target.diameter == pytest.approx(119, abs=0.2)
    assert list(sampled.named_points)[1:] == [
        f"off the middle, {w}" for w in ("x", "y", "-x", "-y")
    ]
    seen = sampled.observations().weight.mean(axis=0)
    assert seen[0] == 1 and all(0.5 < share < 0.8 for share in seen[1:])


def test_a_fan_is_taken_as_it_is():
    angle = 0.7
    fan = Fan([angle], 64, 0.5, 400.0, 600.0, 30.0)
    point = np.array([[12.0, -9.0, 0]])
    observations = Observations.of(scan_cameras(fan).cameras, point)
    source = 400 * np.array([np.sin(angle), -np.cos(angle), 0])
    way = source - point[0]
    np.testing.assert_allclose(observations.direction[0, 0], way / np.linalg.norm(way), atol=1e-12)
    depth = 400 - point[0, 0] * np.sin(angle) + point[0, 1] * np.cos(angle)
    assert observations.pixel[0, 0] == pytest.approx(0.5 * depth / 600)
    assert observations.weight[0, 0] == 1


def test_a_dry_run_writes_nothing_and_says_what_would_be_done(ringed, tmp_path, capsys):
    assert analyze(ringed, tmp_path / "out", "--dry-run", "--diameter", 2) == 0
    printed = capsys.readouterr().out
    assert "48 of ring" in printed and "1500 up to 8 cycles" in printed
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--center", 500, 500, 500), "outside every picture"),
        (("--center", "nan", 0, 0), "--center is"),
        (("--diameter", 0), "--diameter is 0"),
        (("--diameter", -3), "--diameter is -3"),
        (("--aperture", 0), "--aperture is 0"),
        (("--aperture", -0.1), "--aperture is -0.1"),
        (("--focus", 3), "--focus"),
        (("--wavelength", 0), "--wavelength is 0"),
        (("--unit", "inf"), "--unit is inf"),
        (("--add", -1), "--add is -1"),
        (("--theta", "0:180"), "--theta"),
        (("--flats", "air"), "--flats applies to scans"),
        (("--reversed",), "--reversed applies to scans"),
    ],
)
def test_what_makes_no_sense_is_named_and_leaves_nothing(ringed, tmp_path, capsys, more, words):
    assert analyze(ringed, tmp_path / "out", *more) == 3
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error
    assert not (tmp_path / "out").exists()


def test_what_is_no_capture_and_no_scan_is_named(scan, tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("nothing")
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken.json").write_text("{")
    for name, words in (("notes.txt", ".txt"), ("empty", "empty"), ("nowhere", "nowhere"),
                        ("broken.json", "broken.json")):  # fmt: skip
        assert analyze(tmp_path / name, tmp_path / "out") == 3
        assert words in capsys.readouterr().err
    assert analyze(scan.integrals, tmp_path / "out", "--aperture", 1) == 3
    assert "--aperture" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["a.png", "images/a.jpg", "walk.mp4"])
def test_photographs_without_cameras_are_sent_to_a_fit(tmp_path, capsys, name):
    source = tmp_path / "holiday"
    (source / name).parent.mkdir(parents=True)
    (source / name).write_bytes(b"a header is not looked at")
    source = source / name if name == "walk.mp4" else source
    for mode in ("volume", "surface"):
        assert analyze(source, tmp_path / "out", "--mode", mode) == 3
        said = capsys.readouterr().err
        assert "without cameras: run 'rift fit' first, then 'rift analyze FIT'" in said


def test_a_folder_of_tiff_is_taken_for_a_scan_as_before(tmp_path, capsys):
    (tmp_path / "scan/raw").mkdir(parents=True)
    for name in ("scan/preview.png", "scan/raw/a.tif"):
        (tmp_path / name).write_bytes(b"damaged")
    assert analyze(tmp_path / "scan", tmp_path / "out") == 3
    said = capsys.readouterr().err
    assert "without cameras" not in said and "a.tif" in said


def test_of_a_narrow_wedge_the_detail_within_it_is_said_and_the_share_outside(scan):
    sampled = open_sampled(AnalyzeSettings(scan.integrals, theta="0:30"))
    found = resolution(sampled, ("middle", "b", "c"))
    first = found.figures["limits"][0]
    # Slices at 8 cycles per diameter reach asin(1 / 16) beyond the wedge, to either side.
    seen = 30 * 149 / 150 + 2 * math.degrees(math.asin(1 / 16))
    assert first["unsampled"] == pytest.approx(1 - seen / 180, abs=0.005)
    assert 1 / first["within_seen"] < 0.1 * sampled.target.diameter
    assert 1 / first["reached"] > sampled.target.diameter
    words = " ".join(found.sentences)
    assert "Within those that are" in words and f"{1 / first['reached']:.3g}" not in words


@pytest.mark.full
def test_a_cone_beam_is_a_volume_whose_source_misses_planes(tmp_path, capsys):
    path, angles = tmp_path / "cone.npz", np.linspace(0, 2 * np.pi, 40, endpoint=False)
    lengths = {"source_to_axis": 30.0, "source_to_detector": 60.0, "pitch": 1.0}
    np.savez(path, projections=np.ones((40, 24, 24), np.float32), angles=angles, **lengths)
    out = tmp_path / "out"
    assert analyze(path, out, "--add", "2") == 0
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["tuy"]["unmet"] > 0
    assert len(metrics["add"]) == 2 and metrics["largest_gap_degrees"] == pytest.approx(9)
    assert "never crossed" in (out / "report.html").read_text()
