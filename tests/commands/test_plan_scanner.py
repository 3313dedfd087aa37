"""``rift plan --have SCAN``: further places of a scanner's source, where those it has miss most."""

from __future__ import annotations

import csv
import json
import shutil

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.plan.scanner import vectors_of
from rift_cl.geometry import Camera, Cone
from rift_cl.geometry.leaning import leaning
from rift_cl.geometry.pose import look_at
from rift_cl.geometry.seen_grid import seen_grid
from rift_cl.io.scans.geometries.astra_vectors import read_vectors

R, S, ROWS, BINS, PITCH = 60.0, 90.0, 12, 16, 3.0
SEEN = np.deg2rad(np.arange(0, 120, 8))


def scan_file(path, **changes):
    """A scan of a third of a turn, its values of no matter."""
    given = {"source_to_axis": R, "source_to_detector": S, "pitch": PITCH, **changes}
    rows = given.pop("rows", ROWS)
    given = {name: value for name, value in given.items() if value is not None}
    np.savez(path, projections=np.ones((len(SEEN), rows, BINS), np.float32), angles=SEEN, **given)
    return path


@pytest.fixture(scope="module")
def cone(tmp_path_factory):
    return scan_file(tmp_path_factory.mktemp("scan") / "cone.npz")


def plan(scan, out, *more):
    words = ["plan", "--have", scan, "--out", out, "--views", 3, "--quiet", *more]
    return main([str(word) for word in words])


def views_of(out):
    with (out / "views.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def on_orbit(cone, tmp_path_factory):
    out = tmp_path_factory.mktemp("plans") / "orbit"
    assert plan(cone, out, "--elevation", 0, 0) == 0
    return out


@pytest.mark.full
def test_a_scan_is_read_as_options_say(tmp_path, capsys):
    """Its angles are degrees, and over so short an arc nothing tells."""
    path = tmp_path / "short.npz"
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": PITCH}
    angles = np.rad2deg(SEEN) / 20
    np.savez(path, frames=np.ones((len(SEEN), ROWS, BINS), np.float32), turn=angles, **lengths)
    words = ("--dataset", "frames", "--theta", "turn", "--angle-unit", "degrees", "--dry-run")
    assert plan(path, tmp_path / "out", *words) == 0
    for have in ((), ("--have", tmp_path)):
        assert main(["plan", "--views", "3", "--angle-unit", "degrees", *map(str, have)]) == 3
        assert "--angle-unit applies to" in capsys.readouterr().err or have


@pytest.mark.full
def test_views_on_the_orbit_fill_the_widest_gap(on_orbit):
    """Sources were at azimuths from -90 to 22 degrees, and opposite ones are as good."""
    for view in views_of(on_orbit):
        azimuth = float(view["azimuth, degrees"])
        behind = (azimuth + 90) % 180
        assert 112 < behind < 180
        assert float(view["elevation, degrees"]) == pytest.approx(0, abs=1e-6)
        assert float(view["distance, mm"]) == pytest.approx(R)
        assert view["camera"] == "the scanner"


def test_focal_lengths_are_the_detectors_distance_in_its_bins(on_orbit):
    for frame in json.loads((on_orbit / "transforms.json").read_text())["frames"]:
        assert [frame["fl_x"], frame["fl_y"]] == pytest.approx([S / PITCH] * 2, rel=1e-7)


def test_vectors_are_those_of_the_scanner_at_these_places(on_orbit):
    found = read_vectors(on_orbit / "vectors.txt")
    azimuths = np.deg2rad([float(view["azimuth, degrees"]) for view in views_of(on_orbit)])
    wanted = Cone(azimuths + np.pi / 2, ROWS, BINS, PITCH, R, S).vectors()
    for name in ("source", "middle", "across", "down"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-3)


def test_planned_views_hold_the_detector_as_the_scanner_does():
    """Aside, off the orbit's plane and rolled: those of further views of the same scanner."""
    more = np.deg2rad([130.0, 145.0])
    first, further = (
        leaning(Cone(angles, ROWS, BINS, PITCH, R, S, (2.0, 11.0)), 0.05) for angles in (SEEN, more)
    )
    middle = seen_grid(first).center[::-1]
    cameras = tuple(
        Camera((ROWS, BINS), np.eye(3), look_at(source, middle, (0, 0, 1)))
        for source in further.source
    )
    planned = vectors_of(cameras, first)
    for name in ("source", "middle", "across", "down"):
        np.testing.assert_allclose(getattr(planned, name), getattr(further, name), atol=1e-9)


@pytest.mark.full
def test_a_plan_of_no_scanner_keeps_no_vectors_of_an_earlier_one(on_orbit, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(on_orbit, out)
    words = ["plan", "--mode", "volume", "--views", 2, "--band", 0.03, "--out", out]
    words += ["--overwrite", "--quiet"]
    assert main([str(word) for word in words]) == 0
    assert (out / "transforms.json").exists() and not (out / "vectors.txt").exists()


@pytest.mark.full
def test_tilts_cross_planes_that_the_orbit_does_not(cone, on_orbit, tmp_path, capsys):
    assert plan(cone, tmp_path / "a", "--elevation", 0, 90) == 0
    assert "vectors.txt" in capsys.readouterr().out
    flat, tilted = (
        json.loads((out / "metrics.json").read_text()) for out in (on_orbit, tmp_path / "a")
    )
    before = flat["planes_never_crossed"]["before"]
    assert 0 < flat["planes_never_crossed"]["after"] <= before
    assert tilted["planes_never_crossed"]["after"] < 0.5 * before
    assert "never crosses" in tilted["verdict"]


@pytest.mark.full
def test_a_fan_is_planned_in_its_plane(tmp_path):
    fan = scan_file(tmp_path / "fan.npz", rows=1)
    assert plan(fan, tmp_path / "out") == 0
    for view in views_of(tmp_path / "out"):
        assert float(view["elevation, degrees"]) == pytest.approx(0, abs=1e-6)
    assert not (tmp_path / "out" / "vectors.txt").exists()


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--mode", "surface"), "--mode surface"),
        (("--center", 0, 0, 1), "--center"),
        (("--camera", "mine.json"), "--camera"),
        (("--cover", 0.5), "--cover"),
    ],
)
def test_options_of_photographs_are_refused(cone, tmp_path, capsys, options, word):
    assert plan(cone, tmp_path / "out", *options) == 3
    assert word in capsys.readouterr().err


def test_parallel_rays_have_no_place_to_plan(tmp_path, capsys):
    lengths = {"source_to_axis": None, "source_to_detector": None}
    scan = scan_file(tmp_path / "parallel.npz", **lengths)
    assert plan(scan, tmp_path / "out") == 3
    assert "parallel rays" in capsys.readouterr().err
