"""``rift reconstruct``: a scan goes in, quantitative slices come out."""

import json

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.io import read_volume

NAMES = {"tiff": "slices", "zarr": "volume.zarr", "h5": "volume.h5"}


def run(*arguments):
    return main([str(argument) for argument in arguments])


@pytest.mark.parametrize("format", NAMES)
@pytest.mark.parametrize("kind", ["counts", "integrals"])
def test_slices_are_quantitative(scan, tmp_path, format, kind):
    out = tmp_path / "out"
    path = getattr(scan, kind)
    assert run("reconstruct", path, "--out", out, "--format", format, "--pitch", 0.2) == 0
    volume = read_volume(out / NAMES[format])
    assert volume.shape == (3, *scan.truth.shape)
    for image in volume:
        assert np.corrcoef(image.ravel(), scan.truth.ravel())[0, 1] > 0.9
    inside = (slice(36, 60), slice(44, 52))
    assert volume[0][inside].mean() == pytest.approx(scan.truth[inside].mean(), rel=0.02)
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["center"] == pytest.approx(45, abs=0.3)


def test_the_report_stands_alone(scan, tmp_path):
    assert run("reconstruct", scan.counts, "--out", tmp_path / "out", "--center", 45) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/jpeg;base64,") == 3
    assert "http://" not in page
    assert "https://" not in page
    config = json.loads((tmp_path / "out" / "config.json").read_text())
    assert config["settings"]["center"] == 45
    assert config["environment"]["device"]


@pytest.mark.full
def test_two_runs_give_the_same_bits(scan, tmp_path):
    for name in "ab":
        assert run("reconstruct", scan.counts, "--out", tmp_path / name, "--quiet") == 0
    first, second = (read_volume(tmp_path / name / "slices") for name in "ab")
    np.testing.assert_array_equal(first, second)


@pytest.mark.full
def test_a_small_budget_gives_the_same_bits(scan, tmp_path):
    whole = Reconstruction(ReconstructSettings(scan.counts, out=tmp_path / "whole", center=45))
    list(whole.run())
    need = whole.inversion.fixed() + whole.inversion.need * 3 // 2
    small = ReconstructSettings(scan.counts, out=tmp_path / "small", center=45, memory=str(need))
    pieces = Reconstruction(small)
    assert len(pieces.slabs) == 3
    list(pieces.run())
    a, b = (read_volume(tmp_path / name / "slices") for name in ("whole", "small"))
    np.testing.assert_array_equal(a, b)


@pytest.mark.full
def test_rows_and_methods(scan, tmp_path):
    common = ("reconstruct", scan.counts, "--center", 45, "--rows", 1, 2)
    for method in ("fbp", "backproject"):
        assert run(*common, "--method", method, "--out", tmp_path / method) == 0
    filtered = read_volume(tmp_path / "fbp" / "slices")
    unfiltered = read_volume(tmp_path / "backproject" / "slices")
    assert filtered.shape[0] == 1
    assert unfiltered.min() > 0 > filtered.min()


@pytest.mark.parametrize("name", ["shepp-logan", "cosine", "hamming", "hann", "high-pass"])
def test_filters(scan, tmp_path, name):
    assert run("reconstruct", scan.counts, "--center", 45, "--filter", name, "--out", tmp_path) == 0


def test_dry_run_writes_nothing(scan, tmp_path, capsys):
    assert run("reconstruct", scan.counts, "--out", tmp_path / "out", "--dry-run") == 0
    assert not (tmp_path / "out").exists()
    printed = capsys.readouterr().out
    for word in ("projections", "volume", "slabs", "device", "time"):
        assert word in printed


@pytest.mark.full
def test_progress_is_plain_where_there_is_no_terminal(scan, tmp_path, capsys):
    assert run("reconstruct", scan.counts, "--center", 45, "--out", tmp_path) == 0
    captured = capsys.readouterr()
    assert "3/3 slices" in captured.err
    assert "\x1b" not in captured.err
    assert "slices/s" in captured.err


def test_what_is_assumed_is_told_before_the_axis_cannot_be_found(tmp_path, capsys):
    path = tmp_path / "flat.npz"
    np.savez(path, projections=np.zeros((40, 2, 30), np.float32), angles=np.arange(40) * 4.5)
    options = ["--kind", "attenuation", "--out", str(tmp_path / "out")]
    assert main(["reconstruct", str(path), *options]) == 3
    said = " ".join(capsys.readouterr().err.split())
    assert said.index("angles in degrees over") < said.index("the rotation axis cannot be found")
