"""``rift reconstruct``: a scan goes in, quantitative slices come out, and faults are told."""

import json

import h5py
import numpy as np
import pytest

from rift_cl.cli import main
from rift_cl.io import read_volume
from rift_cl.jobs.reconstruct import Reconstruction, ReconstructSettings

INPUT, DEVICE, OUTPUT, INTERRUPTED = 3, 4, 5, 130
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
    assert page.count("data:image/png;base64,") >= 1
    assert "http://" not in page
    assert "https://" not in page
    config = json.loads((tmp_path / "out" / "config.json").read_text())
    assert config["settings"]["center"] == 45
    assert config["environment"]["device"]


def test_two_runs_give_the_same_bits(scan, tmp_path):
    for name in "ab":
        assert run("reconstruct", scan.counts, "--out", tmp_path / name, "--quiet") == 0
    first, second = (read_volume(tmp_path / name / "slices") for name in "ab")
    np.testing.assert_array_equal(first, second)


def test_a_small_budget_gives_the_same_bits(scan, tmp_path, monkeypatch):
    whole = Reconstruction(ReconstructSettings(scan.counts, out=tmp_path / "whole", center=45))
    list(whole.run())
    need = whole._projector(1, None).scratch + 4 * (5 * 150 * 96 + 2 * 96 * 96) * 3 // 2
    small = ReconstructSettings(scan.counts, out=tmp_path / "small", center=45, memory=str(need))
    pieces = Reconstruction(small)
    assert len(pieces.slabs) == 3
    list(pieces.run())
    a, b = (read_volume(tmp_path / name / "slices") for name in ("whole", "small"))
    np.testing.assert_array_equal(a, b)


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


def test_progress_is_plain_where_there_is_no_terminal(scan, tmp_path, capsys):
    assert run("reconstruct", scan.counts, "--center", 45, "--out", tmp_path) == 0
    captured = capsys.readouterr()
    assert "3/3 slices" in captured.err
    assert "\x1b" not in captured.err
    assert "slices/s" in captured.err


def test_an_earlier_run_is_kept_unless_told(scan, tmp_path, capsys):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    assert run(*arguments) == 0
    assert run(*arguments) == OUTPUT
    assert "--overwrite" in capsys.readouterr().err
    assert run(*arguments, "--overwrite") == 0


def test_other_peoples_files_are_kept(scan, tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert run("reconstruct", scan.counts, "--out", tmp_path, "--overwrite") == OUTPUT
    assert "other things" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def broken(path, tmp_path, change):
    """A copy of a scan with one thing changed."""
    copy = tmp_path / "broken.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "r+") as file:
        change(file["exchange"])
    return copy


def _nan(group):
    group["data"][4, 2, 7] = np.nan


def _no_flats(group):
    group["data_white"][...] = group["data_dark"][...]


def _few_angles(group):
    theta = group["theta"][:-1]
    del group["theta"]
    group["theta"] = theta


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_nan, ("broken.h5", "view 4, row 2, bin 7")),
        (_no_flats, ("row 0",)),
        (_few_angles, ("149", "150")),
    ],
)
def test_bad_scans_are_told_and_leave_nothing(scan, tmp_path, capsys, change, words):
    path = broken(scan.counts, tmp_path, change)
    out = tmp_path / "out"
    assert run("reconstruct", path, "--center", 45, "--out", out, "--memory", "600M") == INPUT
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert message.startswith("rift: ")
    assert all(word in message for word in words)
    assert not out.exists()


@pytest.mark.parametrize(
    ("extra", "status", "words"),
    [
        (("--rows", "2", "9"), INPUT, "rows"),
        (("--pitch", "-1"), INPUT, "pitch"),
        (("--pitch", "0"), INPUT, "pitch"),
        (("--center", "1e9"), INPUT, "--center"),
        (("--cutoff", "0"), INPUT, "cutoff"),
        (("--exponent", "-1", "--filter", "high-pass"), INPUT, "exponent"),
        (("--memory", "lots"), INPUT, "memory"),
        (("--memory", "1K"), INPUT, "budget"),
        (("--dataset", "nothing/here"), INPUT, "nothing/here"),
        (("--device", "voodoo"), DEVICE, "voodoo"),
        (("--out", "/dev/null/x"), OUTPUT, "/dev/null"),
    ],
)
def test_bad_arguments_are_told(scan, tmp_path, capsys, extra, status, words):
    out = () if "--out" in extra else ("--out", tmp_path / "out")
    center = () if "--center" in extra else ("--center", 45)
    assert run("reconstruct", scan.counts, *center, *out, *extra) == status
    captured = capsys.readouterr()
    assert words in captured.err
    assert "Traceback" not in captured.err
    assert not (tmp_path / "out").exists()


def test_debug_shows_the_traceback(tmp_path, capsys):
    assert run("reconstruct", tmp_path / "none.h5", "--debug") == INPUT
    assert "Traceback" in capsys.readouterr().err


def test_usage_is_status_2(capsys):
    with pytest.raises(SystemExit) as exit:
        run("reconstruct", "--no-such-flag")
    assert exit.value.code == 2
    assert capsys.readouterr().err


def test_interruption_leaves_nothing(scan, tmp_path, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("rift_cl.jobs.reconstruct.Preview.take", interrupt)
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out) == INTERRUPTED
    assert not out.exists()


def test_a_run_cut_off_in_its_report_can_be_repeated(scan, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    with monkeypatch.context() as patch:
        patch.setattr("rift_cl.jobs.reconstruct.reconstruction_page", interrupt)
        assert run(*arguments) == INTERRUPTED
    assert run(*arguments) == OUTPUT
    assert run(*arguments, "--overwrite") == 0


def test_a_failed_overwrite_loses_nothing(scan, tmp_path):
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out) == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    bad = broken(scan.counts, tmp_path, _nan)
    assert run("reconstruct", bad, "--center", 45, "--out", out, "--overwrite") == INPUT
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_another_format_replaces_the_first(scan, tmp_path):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    assert run(*arguments) == 0
    assert run(*arguments, "--overwrite", "--format", "h5") == 0
    assert not (tmp_path / "out" / "slices").exists()
    assert (tmp_path / "out" / "volume.h5").exists()


def test_a_dry_run_tells_of_an_output_that_cannot_be(scan, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out, "--dry-run") == OUTPUT
    assert "no folder" in capsys.readouterr().err


def test_angles_that_leave_a_gap_have_no_center_to_be_found(tmp_path, capsys):
    path = tmp_path / "one.npz"
    np.savez(path, sinogram=np.random.default_rng(0).random((1, 32)), angles=[0.1])
    assert run("reconstruct", path, "--out", tmp_path / "out") == INPUT
    assert "gap of 180 degrees" in capsys.readouterr().err


def test_real_tooth(shared_data, tmp_path):
    tooth = shared_data / "tooth" / "tooth.h5"
    assert run("reconstruct", tooth, "--out", tmp_path / "out") == 0
    volume = read_volume(tmp_path / "out" / "slices")
    assert volume.shape == (2, 640, 640)
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["center"] == pytest.approx(296, abs=0.5)
    # Enamel and dentine stand out of the air about them, which is zero.
    air, tooth_part = volume[0, 50:150, 50:150], volume[0, 280:340, 240:300]
    assert abs(air.mean()) < 2e-4
    assert tooth_part.mean() > 2e-3
