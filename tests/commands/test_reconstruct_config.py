"""``config.json`` says what was decided, and ``--config`` repeats it."""

import json

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.run_folder.saved_settings import changes_a_run
from rift_cl.io import read_volume
from rift_cl.phantom import Ellipsoid

INPUT = 3


def run(*arguments):
    return main([str(argument) for argument in arguments])


def config_of(out):
    return json.loads((out / "config.json").read_text())


@pytest.fixture(scope="module")
def first(scan, tmp_path_factory):
    """A run that was told next to nothing."""
    out = tmp_path_factory.mktemp("first") / "out"
    assert run("reconstruct", scan.counts, "--out", out) == 0
    return out


def test_every_decision_is_recorded(first):
    config = config_of(first)
    settings = config["settings"]
    wanted = {"filter": "ram-lak", "cutoff": 1.0, "compensate": "voronoi", "rings": "vo"}
    wanted["kind"] = "counts"
    assert {name: settings[name] for name in wanted} == wanted
    open_ones = ("center", "rows", "pitch", "unit", "pixel", "size", "background", "pad")
    assert all(settings[name] not in (None, "auto") for name in open_ones)
    assert set(config["asked"]) == {"scan", "out"}
    assert config["axis"]["center"] == settings["center"]
    assert {"rift_cl", "numpy", "pyopencl", "driver"} <= set(config["environment"])


def test_the_report_names_filter_and_axis(first):
    page = (first / "report.html").read_text()
    assert "ram-lak filter, cut-off 1, voronoi view weights" in page
    assert f"bin {config_of(first)['settings']['center']:.2f}" in page


def test_a_repeated_run_makes_the_same_bits(first, tmp_path):
    again = tmp_path / "again"
    assert run("reconstruct", "--config", first / "config.json", "--out", again) == 0
    np.testing.assert_array_equal(read_volume(first / "slices"), read_volume(again / "slices"))
    same = {**config_of(again)["settings"], "out": None, "config": None}
    assert same == {**config_of(first)["settings"], "out": None}


def test_options_win_over_the_configuration(first, tmp_path):
    out = tmp_path / "out"
    options = ("--filter", "hann", "--rows", 1, 2, "--out", out)
    assert run("reconstruct", "--config", first / "config.json", *options) == 0
    settings = config_of(out)["settings"]
    assert (settings["filter"], settings["rows"]) == ("hann", [1, 2])
    assert settings["center"] == config_of(first)["settings"]["center"]


@pytest.fixture(scope="module")
def in_millimetres(scan, tmp_path_factory):
    """A run of one slice that was told its pitch."""
    out = tmp_path_factory.mktemp("millimetres") / "out"
    options = ("--rows", 1, 2, "--center", 45, "--pitch", 0.05, "--unit", "mm")
    assert run("reconstruct", scan.integrals, "--out", out, *options) == 0
    return out


@pytest.mark.full
@pytest.mark.parametrize(
    ("options", "voxel", "width", "value"),
    [
        (("--pitch", 50, "--unit", "um"), 50, 96, 1e-3),
        (("--binning", 2), 0.1, 48, 1),
        (("--pixel", 0.1), 0.1, 48, 1),
    ],
)
def test_what_follows_from_a_changed_option_is_decided_anew(
    in_millimetres, tmp_path, options, voxel, width, value
):
    """Samples in millimetres are none in micrometres."""
    config = ("--config", in_millimetres / "config.json")
    assert run("reconstruct", *config, "--out", tmp_path / "out", *options) == 0
    assert config_of(tmp_path / "out")["settings"]["pixel"] == pytest.approx(voxel)
    assert config_of(tmp_path / "out")["settings"]["center"] == 45
    before, now = (read_volume(path / "slices") for path in (in_millimetres, tmp_path / "out"))
    assert now.shape[1:] == (width, width)
    assert now.max() == pytest.approx(value * before.max(), rel=0.25)


@pytest.mark.full
def test_another_method_has_no_filter_left_over(in_millimetres, tmp_path, capsys):
    tv, fbp, again = (tmp_path / name for name in ("tv", "fbp", "again"))
    config = ("--config", in_millimetres / "config.json")
    assert run("reconstruct", *config, "--method", "tv", "--steps", 3, "--out", tv) == 0
    settings = config_of(tv)["settings"]
    assert (settings["method"], settings["filter"], settings["center"]) == ("tv", None, 45)
    # What was given stays, and is refused where it has no meaning; a repeated run decided nothing.
    assert run("reconstruct", "--config", tv / "config.json", "--method", "fbp", "--out", fbp) == 3
    assert "--steps" in capsys.readouterr().err
    assert run("reconstruct", *config, "--out", again) == 0
    assert config_of(again)["asked"] == config_of(in_millimetres)["asked"]
    config = ("--config", again / "config.json")
    assert run("reconstruct", *config, "--method", "cgls", "--out", fbp) == 0


@pytest.mark.full
def test_in_python_too_and_of_a_file_that_was_edited(in_millimetres, scan, tmp_path):
    given = {"config": in_millimetres / "config.json", "progress": False}
    found = rift.reconstruct_scan(scan.integrals, tmp_path / "out", binning=2, **given)
    assert found.settings.pixel == pytest.approx(0.1)
    record = config_of(in_millimetres)
    record["settings"]["size"] = 40
    given["config"] = tmp_path / "config.json"
    given["config"].write_text(json.dumps(record))
    found = rift.reconstruct_scan(scan.integrals, tmp_path / "edited", filter="hann", **given)
    assert (found.settings.size, found.settings.filter) == (40, "hann")


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        ("--config c.json --out x --overwrite", False),
        ("--config=c.json --no-overwrite --device cpu --preview", False),
        ("--config c.json --binning 2", True),
        ("other.h5 --config c.json", True),
        ("--config c.json other.h5", True),
        ("--config c.json --overwrite other.h5", True),
        ("--config c.json --preview other.h5", True),
    ],
)
def test_what_changes_a_run_is_told_from_where_it_is_left(words, changes):
    assert changes_a_run(words.split()) == changes


@pytest.mark.full
def test_steps_are_recorded(scan, tmp_path):
    out = tmp_path / "out"
    options = ("--method", "cgls", "--precondition", "ramp", "--center", 45)
    assert run("reconstruct", scan.counts, "--out", out, *options) == 0
    settings = config_of(out)["settings"]
    assert (settings["steps"], settings["filter"]) == (4, None)


def test_a_preview_is_always_left(first):
    assert (first / "preview.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", "cannot be read"),
        ("[]", "cannot be read"),
        ('{"job": "fit photos", "settings": {}}', "is of 'rift fit photos'"),
        ('{"job": "reconstruct", "settings": {"colour": 3}}', "no setting 'colour'"),
        (
            '{"job": "reconstruct", "settings": {"scan": "x", "method": "best"}}',
            "wanted one of fbp",
        ),
        ('{"job": "reconstruct", "settings": {"scan": "x", "steps": "many"}}', "wanted a whole"),
    ],
)
def test_a_configuration_that_cannot_be_used_is_told(text, sentence, tmp_path, capsys):
    path = tmp_path / "config.json"
    path.write_text(text)
    assert run("reconstruct", f"--config={path}") == INPUT
    message = capsys.readouterr().err
    assert sentence in message
    assert "Traceback" not in message


def test_a_configuration_that_is_not_there_is_told(tmp_path, capsys):
    assert run("reconstruct", "--config", tmp_path / "none.json") == INPUT
    assert "none.json" in capsys.readouterr().err


@pytest.mark.full
def test_integers_record_the_window_that_was_chosen(first, scan, tmp_path):
    out = tmp_path / "out"
    options = ("--dtype", "uint16", "--format", "h5", "--center", 45)
    assert run("reconstruct", scan.counts, "--out", out, *options) == 0
    low, high = config_of(out)["settings"]["window"]
    exact, coarse = read_volume(first / "slices"), read_volume(out / "volume.h5")
    np.testing.assert_allclose((low, high), (exact.min(), exact.max()), rtol=0.02)
    assert "the range of all slices" in (out / "report.html").read_text()
    again = tmp_path / "again"
    assert run("reconstruct", "--config", out / "config.json", "--out", again) == 0
    np.testing.assert_array_equal(coarse, read_volume(again / "volume.h5"))
    assert np.ptp(coarse) == pytest.approx(np.ptp(exact), rel=0.05)


def test_what_does_not_fit_the_window_is_counted(scan, tmp_path, capsys):
    out = tmp_path / "out"
    options = ("--dtype", "uint8", "--window", 0, 0.01, "--center", 45, "--format", "tiff-stack")
    assert run("reconstruct", scan.counts, "--out", out, *options) == 0
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["clipped_below"] > 0
    assert metrics["clipped_above"] > 0
    volume = read_volume(out / "volume.tif")
    assert (volume.min(), volume.max()) == (0, pytest.approx(0.01))
    said = capsys.readouterr().err
    assert f"{metrics['clipped_above']} values above 0.01" in said
    assert f"up to {metrics['maximum']:.4g}" in said


@pytest.mark.full
@pytest.mark.parametrize("beam", ["parallel", "cone"])
def test_the_densest_grain_keeps_its_value_in_16_bits(tmp_path, beam):
    """A small ball is less than a thousandth of the volume, and six times as dense as the rest."""
    balls = [Ellipsoid.ball(10, 0.01), Ellipsoid.ball(1.5, 0.05, (0, 4, 0))]
    angles = 2 * np.pi * np.arange(90) / 90
    lengths = {"source_to_axis": 200.0, "source_to_detector": 200.0, "pitch": 1.0}
    cone = rift.Cone(angles, 12, 40, 1.0, 200.0, 200.0)
    projections = rift.phantom.project(balls, rift.Grid((2, 2, 2)), cone)
    more = lengths if beam == "cone" else {}
    np.savez(tmp_path / "scan.npz", projections=projections, angles=angles, **more)
    common = {"kind": "attenuation", "center": 19.5, "format": "h5"}
    made = [
        rift.reconstruct_scan(tmp_path / "scan.npz", tmp_path / dtype, dtype=dtype, **common)
        for dtype in ("float32", "uint16")
    ]
    exact, stored = (volume.read() for volume in made)
    assert made[1].metrics["clipped_above"] == made[1].metrics["clipped_below"] == 0
    assert np.abs(stored - exact).max() < 1e-4 * np.ptp(exact)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--window", 0, 1), "add --dtype"),
        (("--dtype", "uint8", "--window", 1, 1), "window"),
        (("--dtype", "uint8", "--window", 2, 1), "window"),
        (("--dtype", "uint8", "--window", 0, "nan"), "window"),
        (("--dtype", "uint8", "--format", "mrc"), "uint16"),
    ],
)
def test_a_window_that_cannot_be_used_is_told(scan, tmp_path, capsys, options, sentence):
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, "--out", out, *options) == INPUT
    assert sentence in capsys.readouterr().err
    assert not out.exists()
