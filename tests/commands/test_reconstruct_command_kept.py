"""What ``rift reconstruct`` must not lose, mix up or keep to itself."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import tiff_files as made
from mat_files import write_mat

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.commands.reconstruct import report as reconstruct_report
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.io import read_volume

INPUT, INTERRUPTED, OUTPUT = 3, 130, 5
HALF, FULL = np.arange(90) * np.pi / 90, np.arange(180) * np.pi / 90


def run(*arguments):
    return main([str(argument) for argument in arguments])


def assumed(out):
    return " ".join(json.loads((out / "metrics.json").read_text())["assumed"])


def cut_off(monkeypatch, arguments, slabs=1):
    """Interrupt the command when it keeps one slice more than these."""
    save, kept = SlabFolder.save, []

    def counted(self, start, slices):
        if len(kept) == slabs:
            raise KeyboardInterrupt
        kept.append(start)
        save(self, start, slices)

    with monkeypatch.context() as patch:
        patch.setattr(SlabFolder, "save", counted)
        patch.setattr("rift_cl.commands.reconstruct.inversion._SLAB", 1)
        assert run(*arguments) == INTERRUPTED


def save_phantom(path, angles, bins, center=None, size=64):
    grid, scan = rift.Grid((size, size)), rift.Parallel(angles, bins, center=center)
    integrals = 0.2 * rift.phantom.shepp_logan_sinogram(grid, scan)
    np.savez(path, projections=integrals[:, None], angles=angles)


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.full
@pytest.mark.parametrize(
    "mistake", [("--rows", 0, 2), ("--size", 10), ("--center", 44), ("--filter", "hann")]
)
def test_a_mistyped_resume_loses_nothing(scan, tmp_path, monkeypatch, capsys, mistake):
    out = tmp_path / "out"
    arguments = ("reconstruct", scan.counts, "--out", out)
    cut_off(monkeypatch, arguments, 2)
    before = contents(out)
    assert len(before) == 4
    assert run(*arguments, "--resume", *mistake) == INPUT
    assert "repeat its options" in capsys.readouterr().err
    assert contents(out) == before
    assert run(*arguments, "--resume") == 0
    assert "Gone on after 2 of 3 slices" in assumed(out)


def test_a_failure_of_a_run_that_went_on_loses_nothing(scan, tmp_path, monkeypatch):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    cut_off(monkeypatch, arguments)
    before = contents(tmp_path / "out")
    cut_off(monkeypatch, (*arguments, "--resume"), 0)
    assert contents(tmp_path / "out") == before


@pytest.mark.full
def test_what_a_killed_run_left_of_another_format_goes(scan, tmp_path, monkeypatch):
    out = tmp_path / "out"
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", out)
    cut_off(monkeypatch, (*arguments, "--format", "h5"))
    # As after SIGKILL, when nothing is removed any more.
    (out / "volume.h5.part").write_bytes(b"half a volume")
    (out / "volume.zarr.part").mkdir()
    (out / "volume.zarr.old").mkdir()
    assert run(*arguments, "--resume", "--format", "tiff") == 0
    assert (out / "slices").is_dir() and not list(out.glob("volume.*"))


@pytest.mark.full
def test_a_run_that_goes_on_begins_to_count_where_it_stands(scan, tmp_path, monkeypatch):
    """So that its pace is its own: the first report is what the rate is counted from."""
    out = tmp_path / "out"
    cut_off(monkeypatch, ("reconstruct", scan.counts, "--center", 45, "--out", out), 2)
    settings = ReconstructSettings(scan.counts, out=out, center=45.0, resume=True)
    assert [report.done for report in Reconstruction(settings).run()] == [2, 3]
    again = ReconstructSettings(scan.counts, out=tmp_path / "new", center=45.0, resume=True)
    assert [report.done for report in Reconstruction(again).run()][-1] == 3


def tiff_scan(folder):
    """Eight projections of three rows in a folder, and two flats among them."""
    frames = 100 + made.frames(8).astype("u2")[:, :3]
    made.write_series(folder, "proj_{:04}.tif", frames)
    made.write_series(folder, "flat_{:04}.tif", 0 * frames[:2] + 500)
    return folder


@pytest.mark.parametrize("name", ["proj_0003.tif", "flat_0001.tif"])
def test_another_frame_makes_another_scan(tmp_path, monkeypatch, capsys, name):
    folder = tiff_scan(tmp_path / "scan")
    arguments = ("reconstruct", folder, "--center", 11.5, "--out", folder / "out")
    cut_off(monkeypatch, arguments)
    frame = folder / name
    state, written = frame.stat(), frame.read_bytes()
    frame.write_bytes(written[:-1] + bytes([written[-1] ^ 1]))
    os.utime(frame, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert run(*arguments, "--resume") == INPUT
    assert f"{folder}, which was changed since" in capsys.readouterr().err
    frame.write_bytes(written)
    (folder / "diary.txt").write_text("beside the frames")
    assert run(*arguments, "--resume") == 0


def test_a_scan_that_was_moved_or_touched_is_the_same(tmp_path, monkeypatch, capsys):
    """With its flats and its run, which are called by another name then."""
    frames = 100 + made.frames(8).astype("u2")[:, :3]
    made.write_series(tmp_path / "day/scan", "proj_{:04}.tif", frames)
    made.write_series(tmp_path / "day/flats", "flat_{:04}.tif", 0 * frames[:2] + 500)
    words = ("--center", 11.5, "--out")

    def arguments(day):
        return "reconstruct", day / "scan", "--flats", day / "flats", *words, day / "out"

    cut_off(monkeypatch, arguments(tmp_path / "day"))
    (tmp_path / "day").rename(tmp_path / "night")
    os.utime(tmp_path / "night/scan/proj_0003.tif", ns=(10**18, 10**18))
    monkeypatch.chdir(tmp_path)
    assert run(*arguments(Path("night")), "--resume") == 0
    assert "Gone on after 1 of 3 slices" in assumed(tmp_path / "night/out")
    assert run(*arguments(tmp_path / "night"), "--resume") == 0
    assert "complete already" in capsys.readouterr().err


def test_a_scan_that_changes_while_it_is_read_gives_no_volume(tmp_path, monkeypatch, capsys):
    folder, out, save = tiff_scan(tmp_path / "scan"), tmp_path / "out", SlabFolder.save
    arguments = ("reconstruct", folder, "--center", 11.5, "--out", out)
    frame = folder / "proj_0003.tif"
    written = frame.read_bytes()

    def changed(self, start, slices):
        save(self, start, slices)
        (tmp_path / "other.tif").write_bytes(written[:-1] + bytes([written[-1] ^ 1]))
        (tmp_path / "other.tif").replace(frame)

    monkeypatch.setattr("rift_cl.commands.reconstruct.inversion._SLAB", 1)
    with monkeypatch.context() as patch:
        patch.setattr(SlabFolder, "save", changed)
        assert run(*arguments) == INPUT
    assert f"{folder}: was changed while it was read" in capsys.readouterr().err
    assert not (out / "slices").exists()
    assert run(*arguments, "--resume") == INPUT
    # What was kept is of the scan as it was.
    frame.write_bytes(written)
    assert run(*arguments, "--resume") == 0
    assert run(*arguments[:-1], tmp_path / "whole") == 0
    whole, found = (read_volume(each / "slices") for each in (tmp_path / "whole", out))
    assert found.tobytes() == whole.tobytes()


def test_other_angles_make_another_scan(tmp_path, monkeypatch, capsys):
    folder = tiff_scan(tmp_path / "scan")
    (folder / "angles.txt").write_text("\n".join(str(20 * k) for k in range(8)))
    arguments = ("reconstruct", folder, "--center", 11.5, "--out", tmp_path / "out")
    cut_off(monkeypatch, arguments)
    (folder / "angles.txt").write_text("\n".join(str(21 * k) for k in range(8)))
    assert run(*arguments, "--resume") == INPUT
    assert "had angles 8 with the hash" in capsys.readouterr().err


def test_what_was_assumed_is_announced(tmp_path, capsys):
    folder = tiff_scan(tmp_path / "scan")
    assert run("reconstruct", folder, "--center", 11.5, "--out", tmp_path / "out") == 0
    captured = capsys.readouterr()
    assert "No angles were found" in captured.out + captured.err


@pytest.mark.full
def test_a_part_of_an_offset_slice_may_lie_beyond_the_detector(tmp_path, capsys):
    path = tmp_path / "scan.npz"
    save_phantom(path, FULL, 40, 6.4)
    arguments = ("reconstruct", path, "--out")
    assert run(*arguments, tmp_path / "whole") == 0
    part = ("--roi", 0, 67, 30, 60)
    for center in ((), ("--center", 6.4)):
        out = tmp_path / f"part{len(center)}"
        assert run(*arguments, out, *part, *center) == 0
        assert read_volume(out / "slices").shape == (1, 30, 67)
    whole, found = (read_volume(tmp_path / n / "slices") for n in ("whole", "part0"))
    np.testing.assert_allclose(found, whole[:, 30:60], atol=2e-3)
    assert run(*arguments, tmp_path / "no", "--roi", 0, 68, 30, 60) == INPUT
    assert "0 to 67" in capsys.readouterr().err
    assert not (tmp_path / "no").exists()


@pytest.mark.full
def test_a_found_axis_is_told_with_its_interval(tmp_path):
    path = tmp_path / "scan.npz"
    save_phantom(path, HALF, 40, size=80)
    for name, center in (("found", ()), ("given", ("--center", 19.5))):
        options = ("--kind", "attenuation", "--out", tmp_path / name)
        assert run("reconstruct", path, *options, *center) == 0
        assert ("at 95 % confidence" in assumed(tmp_path / name)) == (not center)
    axis = json.loads((tmp_path / "found/config.json").read_text())["axis"]
    assert axis["interval"][0] < axis["center"] < axis["interval"][1]
    assert axis["center"] == pytest.approx(19.5, abs=0.5)


@pytest.mark.parametrize("background", [None, 0, 3])
def test_a_background_that_is_given_takes_the_place_of_the_layouts(tmp_path, background):
    values = {"sinoRD": np.ones((100, 5)), "anglesRad": np.arange(5)[:, None] * 0.1}
    path = write_mat(tmp_path / "a.mat", values, "5")
    scan = ScanInput(path, background=background).open_scan()
    assert scan.background == (20 if background is None else background)


@pytest.mark.full
def test_curves_and_pictures_are_named_by_the_same_rows(scan, tmp_path, monkeypatch):
    settings = ReconstructSettings(
        scan.integrals, out=tmp_path / "out", center=45, rows=(1, 3), method="cgls", steps=2
    )
    draw, drawn = reconstruct_report.curves, []

    def noted(series, **options):
        drawn.extend(series)
        return draw(series, **options)

    monkeypatch.setattr(reconstruct_report, "curves", noted)
    list(Reconstruction(settings).run())
    # Each figure is drawn twice, for telephones as well.
    assert list(dict.fromkeys(drawn)) == ["slice 1", "slice 2", "samples"]


def test_a_series_named_after_a_dark_object_is_the_projections(tmp_path, capsys):
    frames = made.frames(8)
    folder = made.write_series(tmp_path / "scan", "dark_rock_{:04}.tif", frames)
    scan = ScanInput(folder, kind="attenuation").open_scan()
    assert scan.shape == frames.shape
    assert "'dark_rock_0001.tif', ...): they are taken for the projections" in scan.notes[1]
    made.write_series(tmp_path / "darks", "dark_{:04}.tif", frames)
    assert run("reconstruct", tmp_path / "darks", "--out", tmp_path / "out") == INPUT
    assert "flats or darks alone" in capsys.readouterr().err


@pytest.mark.full
@pytest.mark.parametrize("format", ["tiff", "h5"])
def test_a_foreign_file_among_the_slices_stops_before_the_work(scan, tmp_path, monkeypatch, format):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    assert run(*arguments) == 0
    (tmp_path / "out/slices/thesis.tex").write_text("years of work")
    before = contents(tmp_path / "out")
    monkeypatch.setattr("rift_cl.commands.reconstruct.slice_input.SliceInput.read", None)
    assert run(*arguments, "--overwrite", "--format", format) == OUTPUT
    assert contents(tmp_path / "out") == before


@pytest.mark.full
def test_an_earlier_runs_picture_goes_with_its_slices(scan, tmp_path):
    arguments = ("reconstruct", scan.counts, "--center", 45, "--out", tmp_path / "out")
    assert run(*arguments, "--method", "sirt", "--steps", 2) == 0
    before = (tmp_path / "out/preview.png").read_bytes()
    assert run(*arguments, "--overwrite") == 0
    assert (tmp_path / "out/preview.png").read_bytes() != before


def test_the_disk_must_hold_slabs_and_volume_together(scan, tmp_path, monkeypatch, capsys):
    usage = type("Usage", (), {"free": 2 * 4 * 3 * 96 * 96 - 1})
    monkeypatch.setattr("rift_cl.io.output.shutil.disk_usage", lambda path: usage)
    out = tmp_path / "out"
    assert run("reconstruct", scan.counts, "--center", 45, "--out", out) == OUTPUT
    assert "the disk has" in capsys.readouterr().err
    assert not out.exists()
