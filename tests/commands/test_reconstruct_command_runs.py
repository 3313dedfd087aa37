"""Runs that are repeated, cut off, gone on with, or only looked at first."""

import json

import h5py
import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.io import read_volume

INPUT, INTERRUPTED, OUTPUT = 3, 130, 5


def run(*arguments):
    return main([str(argument) for argument in arguments])


STEPS = ("--method", "sirt", "--steps", 6)


def interrupted_after(patch, slabs):
    """Let the command be interrupted when it keeps one slab more than these."""
    save, kept = SlabFolder.save, []

    def counted(self, start, slices):
        if len(kept) == slabs:
            raise KeyboardInterrupt
        kept.append(start)
        save(self, start, slices)

    patch.setattr(SlabFolder, "save", counted)
    patch.setattr("rift_cl.commands.reconstruct.inversion._SLAB", 1)
    patch.setattr("rift_cl.commands.reconstruct.inversion._ITERATIVE_SLAB", 1)


@pytest.mark.parametrize("options", [(), STEPS, (*STEPS, "--rows", 1, 3)])
def test_a_run_that_was_cut_off_goes_on_to_the_same_bits(
    scan, tmp_path, monkeypatch, capsys, options
):
    arguments = ("reconstruct", scan.counts, *options)
    assert run(*arguments, "--out", tmp_path / "whole") == 0
    cut = ("--out", tmp_path / "cut")
    with monkeypatch.context() as patch:
        interrupted_after(patch, 1)
        assert run(*arguments, *cut) == INTERRUPTED
    assert "1 of" in capsys.readouterr().err
    assert run(*arguments, *cut) == OUTPUT
    assert "--resume" in capsys.readouterr().err
    assert run(*arguments, *cut, "--resume", "--format", "h5") == 0
    whole, again = read_volume(tmp_path / "whole/slices"), read_volume(tmp_path / "cut/volume.h5")
    np.testing.assert_array_equal(whole, again)
    assert not (tmp_path / "cut/slabs").exists()


@pytest.mark.full
def test_what_belongs_to_another_run_is_not_gone_on_with(scan, tmp_path, monkeypatch, capsys):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    with monkeypatch.context() as patch:
        interrupted_after(patch, 2)
        assert run(*arguments) == INTERRUPTED
    assert run(*arguments, "--resume", "--filter", "hann") == INPUT
    assert "filter None, this one has hann" in capsys.readouterr().err
    assert run(*arguments, "--resume") == 0


@pytest.mark.parametrize("damage", [b"", b"no array", "run"])
def test_damaged_slabs_are_told(scan, tmp_path, monkeypatch, capsys, damage):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    with monkeypatch.context() as patch:
        interrupted_after(patch, 1)
        assert run(*arguments) == INTERRUPTED
    slabs = tmp_path / "out/slabs"
    if damage == "run":
        (slabs / "run.json").write_text("{]")
    else:
        next(slabs.glob("*.npy")).write_bytes(damage)
    assert run(*arguments, "--resume") == INPUT
    message = capsys.readouterr().err
    assert "slabs" in message
    assert "Traceback" not in message
    assert run(*arguments, "--overwrite") == 0


def test_to_go_on_with_nothing_is_to_begin(scan, tmp_path, capsys):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out", "--resume")
    assert run(*arguments) == 0
    capsys.readouterr()
    assert run(*arguments[:-1]) == OUTPUT
    assert "holds an earlier run" in capsys.readouterr().err


def test_to_go_on_with_a_finished_run_changes_nothing(scan, tmp_path, capsys):
    arguments = ("reconstruct", scan.counts, "--out", tmp_path / "out", "--resume")
    assert run(*arguments) == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert run(*arguments) == 0
    assert "complete already" in capsys.readouterr().err
    after = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert after == before
    assert run(*arguments, "--filter", "hann") == INPUT
    assert "the finished run had filter None, this one has hann" in capsys.readouterr().err
    assert run(*arguments, "--format", "h5") == OUTPUT


def test_interruption_before_the_first_slice_leaves_nothing(scan, tmp_path, monkeypatch):
    interrupted_after(monkeypatch, 0)
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out) == INTERRUPTED
    assert not out.exists()


def test_a_preview_is_a_picture_of_the_middle_slice(scan, tmp_path):
    out, said = tmp_path / "out", []
    job = Reconstruction(ReconstructSettings(scan.counts, out=out, center=45, preview=True))
    job.announce = said.append
    reports = list(job.run())
    assert {path.name for path in out.iterdir()} == {"preview.png", "config.json"}
    assert (out / "preview.png").read_bytes().startswith(b"\x89PNG")
    assert "preview.png shows the middle slice; all take about" in said[-1]
    assert reports[-1].done == reports[-1].total
    assert "all 3 would take" in job.result
    # The slices may follow in the same folder.
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out) == 0


@pytest.mark.full
def test_a_long_run_shows_a_slice_first(scan, tmp_path):
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out, *STEPS) == 0
    assert (out / "preview.png").exists()
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["steps"] == 6
    assert "data:image/jpeg" in (out / "report.html").read_text()


@pytest.mark.full
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


@pytest.mark.full
def test_a_run_cut_off_in_its_report_can_be_repeated(scan, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    with monkeypatch.context() as patch:
        patch.setattr("rift_cl.commands.reconstruct.job.reconstruction_page", interrupt)
        assert run(*arguments) == INTERRUPTED
    assert run(*arguments) == OUTPUT
    assert run(*arguments, "--overwrite") == 0


@pytest.mark.full
def test_a_failed_overwrite_loses_nothing(scan, tmp_path):
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out) == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    bad = tmp_path / "bad.h5"
    bad.write_bytes(scan.counts.read_bytes())
    with h5py.File(bad, "r+") as file:
        file["exchange/data"][4, 2, 7] = np.nan
    assert run("reconstruct", bad, "--center", 45, "--out", out, "--overwrite") == INPUT
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


@pytest.mark.full
def test_another_format_replaces_the_first(scan, tmp_path):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    assert run(*arguments) == 0
    assert run(*arguments, "--overwrite", "--format", "h5") == 0
    assert not (tmp_path / "out" / "slices").exists()
    assert (tmp_path / "out" / "volume.h5").exists()
