"""What ``rift reconstruct`` cannot do is told in a sentence, and leaves nothing behind."""

import h5py
import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.reconstruct import slice_input

DEVICE, INPUT, OUTPUT = 4, 3, 5


def run(*arguments):
    return main([str(argument) for argument in arguments])


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


@pytest.mark.full
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_nan, ("broken.h5", "view 4, row 2, bin 7")),
        (_no_flats, ("broken.h5", "no brighter than the darks", "--flats")),
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
        (("--exponent", "0.5"), INPUT, "--filter high-pass"),
        (("--filter", "high-pass", "--cutoff", "0.5"), INPUT, "--cutoff"),
        (("--method", "sirt", "--filter", "hann"), INPUT, "--filter"),
        (("--method", "cgls", "--nonnegative"), INPUT, "--nonnegative"),
        (("--method", "backproject", "--compensate", "voronoi"), INPUT, "--compensate"),
        (("--steps", "5"), INPUT, "--method sirt or cgls or tv"),
        (("--method", "sirt", "--weight", "1"), INPUT, "--weight"),
        (("--method", "sirt", "--steps", "0"), INPUT, "--steps"),
        (("--method", "cgls", "--noise", "-1"), INPUT, "--noise"),
        (("--method", "tv", "--weight", "nan"), INPUT, "--weight"),
        (("--pixel", "0"), INPUT, "--pixel"),
        (("--error", "0"), INPUT, "error is 0"),
        (("--error", "1e-3", "--footprint", "joseph"), INPUT, "--footprint joseph"),
        (("--size", "0"), INPUT, "--size"),
        (("--roi", "5", "4", "0", "9"), INPUT, "--roi"),
        (("--roi", "0", "97", "0", "9"), INPUT, "0 to 96"),
        (("--background", "60"), INPUT, "--background"),
        (("--resume", "--overwrite"), INPUT, "give one of them"),
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


@pytest.mark.parametrize("how", [(), ("--dry-run",), ("--method", "sirt", "--steps", 2)])
def test_a_memory_too_small_is_told_before_the_axis_is_looked_for(
    scan, tmp_path, capsys, monkeypatch, how
):
    searched = []
    monkeypatch.setattr(slice_input, "find_axis", lambda *_: searched.append(1))
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, *how, "--out", out, "--memory", "100K") == INPUT
    assert "one slice needs" in capsys.readouterr().err
    assert not searched and not out.exists()


def test_debug_shows_the_traceback(tmp_path, capsys):
    assert run("reconstruct", tmp_path / "none.h5", "--debug") == INPUT
    assert "Traceback" in capsys.readouterr().err


def test_usage_is_status_2(capsys):
    with pytest.raises(SystemExit) as exit:
        run("reconstruct", "--no-such-flag")
    assert exit.value.code == 2
    assert capsys.readouterr().err


def test_a_dry_run_tells_of_an_output_that_cannot_be(scan, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out, "--dry-run") == OUTPUT
    assert "no folder" in capsys.readouterr().err


def test_angles_that_leave_a_gap_have_no_center_to_be_found(tmp_path, capsys):
    path = tmp_path / "one.npz"
    np.savez(path, sinogram=np.random.default_rng(0).random((1, 32)), angles=[0.1])
    assert run("reconstruct", path, "--out", tmp_path / "out") == INPUT
    assert "holds one view, and a slice wants several directions" in capsys.readouterr().err
    values = np.random.default_rng(0).random((2, 32))
    np.savez(path, sinogram=values, angles=[0.1, 0.2])
    options = ("--kind", "attenuation", "--out", tmp_path / "out")
    assert run("reconstruct", path, *options) == INPUT
    assert "a search takes 4 views" in capsys.readouterr().err
