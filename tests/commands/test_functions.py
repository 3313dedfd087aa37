"""The commands as functions: they make what the commands make, and give back what they made."""

from __future__ import annotations

import gc
import signal
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.errors import InputError, StoppedError, WrongTypeError

SMALL = {"steps": 20, "splats": 100, "hold_out": 4}


@pytest.fixture(scope="module")
def fitted(capture, tmp_path_factory):
    return rift.fit(capture, tmp_path_factory.mktemp("fits") / "fit", **SMALL)


@pytest.mark.full
def test_a_fit_is_the_commands_and_prints_nothing(fitted, capture, tmp_path, capsys):
    reports = []
    again = rift.fit(capture, tmp_path / "a", progress=reports.append, **SMALL)
    assert capsys.readouterr() == ("", "")
    words = [f"--{name.replace('_', '-')}={value}" for name, value in SMALL.items()]
    assert main(["fit", str(capture), "--out", str(tmp_path / "b"), *words, "--quiet"]) == 0
    files = [Path(made, "scene.ply").read_bytes() for made in (fitted, again, tmp_path / "b")]
    assert files[0] == files[1] == files[2]
    assert reports[-1].done == reports[-1].total
    assert len(fitted.scene) == fitted.metrics["splats"] == 100
    assert fitted.report.is_file()
    assert (
        fitted.settings.training.homogenisation.exponent == 0
    )  # decided: there are few photographs
    assert [score.name for score in fitted.scores["held out"]] == ["0.png", "4.png"]


def test_a_scan_file_is_fitted_as_x_rays(tmp_path):
    grid, scan = rift.Grid((24, 24)), rift.Parallel(np.arange(16) * np.pi / 16, 24)
    values = rift.phantom.shepp_logan_sinogram(grid, scan)
    np.savez(tmp_path / "scan.npz", sinogram=values, angles=scan.angles)
    made = rift.fit(tmp_path / "scan.npz", steps=5, splats=50, center=11.5)
    assert made.scene.mode == "xray"
    assert made.scores["held out"][0].truth.shape == (1, 24)
    assert "held out, fit_error" in made._repr_html_()


def test_the_kind_of_a_scans_values_says_that_it_is_one(tmp_path):
    """What the values are can be said to ``rift.fit`` as to its command and to other functions."""
    grid, scan = rift.Grid((24, 24)), rift.Parallel(np.arange(16) * np.pi / 16, 24)
    # No air at the ends of the detector says whether it is bright.
    values = rift.phantom.shepp_logan_sinogram(grid, scan)[:, 6:-6]
    path = tmp_path / "scan.npz"
    np.savez(path, projections=values / values.max(), angles=scan.angles)
    with pytest.raises(InputError, match="kind="):
        rift.fit(path, steps=5, splats=50, center=5.5)
    made = rift.fit(path, kind="attenuation", steps=5, splats=50, center=5.5)
    assert made.scene.mode == "xray" and made.settings.kind == "attenuation"


def test_cameras_of_another_program_are_no_scan(tmp_path):
    np.savez(tmp_path / "cameras.npz", world_mat_0=np.eye(4), scale_mat_0=np.eye(4))
    with pytest.raises(InputError, match="IDR"):
        rift.fit(tmp_path / "cameras.npz", steps=5)


def test_a_result_stands_for_its_folder(fitted, capture):
    scores = rift.evaluate(fitted)
    for given in ([capture], str(capture), capture):
        assert list(rift.evaluate(fitted, given).scores) == [capture.name]
    close = pytest.approx(fitted.metrics["scores"]["held out"]["fit_psnr"], abs=1e-3)
    assert scores.metrics["scores"]["held out"]["fit_psnr"] == close
    film = rift.render(fitted, frames=3, size=(40, 30), film="apng")
    again = rift.render(fitted, config=film.folder / "config.json", frames=2)
    assert again.read(0).shape == (30, 40, 3)
    assert len(again.frames) == 2
    assert film.read(2).shape == (30, 40, 3)
    assert len(film.frames) == len(film.cameras) == 3
    assert film.film == film.folder / "animation.png"
    assert film.film.is_file()


def test_an_export_gives_back_its_file(fitted, tmp_path):
    made = rift.export(fitted, tmp_path / "scene.spz", to="spz")
    assert made == tmp_path / "scene.spz"
    assert made.stat().st_size


def test_notebooks_show_pictures(fitted):
    for made in (fitted, rift.render(fitted, frames=2, size=(40, 30))):
        html = made._repr_html_()
        assert "<img src='data:image/" in html
        assert len(html) < 300_000
    assert "splats 100" in repr(fitted)


def test_a_temporary_folder_goes_with_its_record(fitted):
    film = rift.render(fitted, frames=1, size=(40, 30))
    folder = film.folder
    assert film.report.is_file()
    del film
    gc.collect()
    assert not folder.exists()


def test_views_are_analysed_and_planned(capture):
    analysed = rift.analyze(capture, add=np.int64(1), center=np.zeros(3))
    assert analysed.settings.center == (0, 0, 0)
    assert analysed.metrics["views"] == 8
    assert len(analysed.added) == 1
    assert "views to add" in analysed._repr_html_()
    camera = rift.CameraType("any", focal_length=50, f_number=11, pixel=0.004, size=(100, 150))
    target = rift.Target(np.zeros(3), diameter=60.0, band=0.1)
    html = rift.plan(target, 2, cameras=[camera], method="greedy", compare=False)._repr_html_()
    assert "data:image/svg+xml" in html


def test_an_axis_is_shown_by_its_curve():
    grid, angles = rift.Grid((32, 32)), np.linspace(0, np.pi, 60, endpoint=False)
    scan = rift.Parallel(angles, 48, center=22.5)
    found = rift.find_center(rift.phantom.shepp_logan_sinogram(grid, scan), angles)
    assert "data:image/svg+xml" in found._repr_html_()


def test_progress_that_cannot_be_called_is_refused(fitted, tmp_path):
    with pytest.raises(WrongTypeError, match="progress is 5"):
        rift.render(fitted, tmp_path / "film", progress=5)
    assert not (tmp_path / "film").exists()


def test_a_failed_command_leaves_no_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(InputError, match="nowhere"):
        rift.fit(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no setting 'speed'"):
        rift.plan_views(3, speed=2)
    for settings, words in (
        ({"steps": "many"}, "steps is 'many', wanted a whole number$"),
        ({"strategy": "best"}, "strategy is 'best', wanted one of residual"),
        ({"kind": "xrays"}, "kind"),
    ):
        with pytest.raises(InputError, match=words):
            rift.fit(tmp_path, **settings)
    assert capsys.readouterr() == ("", "")
    with pytest.raises(InputError, match=r"config\.json"):
        rift.plan_views(3, config=tmp_path / "config.json")
    with pytest.raises(InputError, match="dry_run"):
        rift.analyze(tmp_path, dry_run=True)
    assert not list(tmp_path.iterdir())


def steps_of(capture, out, at_step=lambda report: None, **given):
    """The steps that a fit reports, and what it gives back."""
    seen = []

    def progress(report):
        if report.what == "steps":
            seen.append(report.done)
            return at_step(report)
        return None

    return seen, rift.fit(capture, out, progress=progress, **{**SMALL, "steps": 60, **given})


def interrupted(report):
    """What Ctrl-C and a notebook's button do."""
    if report.done == 25:
        signal.raise_signal(signal.SIGINT)


@pytest.fixture
def plain_interrupt():
    """The handler is Python's own and stays it; a background job ignores Ctrl-C."""
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    after = signal.signal(signal.SIGINT, usual)
    assert after is signal.default_int_handler


@pytest.mark.full
@pytest.mark.usefixtures("plain_interrupt")
@pytest.mark.parametrize("at_step", [lambda report: False, interrupted], ids=["asked", "signal"])
def test_a_fit_that_is_broken_off_keeps_a_checkpoint(at_step, fitted, capture, tmp_path, capsys):
    out = tmp_path / "fit"
    with pytest.raises(StoppedError, match=r"after step 25 of 60; to go on: .*--resume"):
        steps_of(capture, out, at_step)
    assert ("stopping after this step" in capsys.readouterr().err) == (at_step is interrupted)
    seen, made = steps_of(capture, out, resume=True)
    assert seen == [50, 60]
    assert not any("no checkpoint" in note for note in made.notes)


@pytest.mark.full
def test_a_fit_without_a_checkpoint_to_go_on_from_says_so(fitted, capture, tmp_path):
    def fail(report):
        raise RuntimeError("a mistake of the caller's")

    with pytest.raises(RuntimeError):
        steps_of(capture, tmp_path / "fit", fail)
    seen, made = steps_of(capture, tmp_path / "fit", resume=True)
    assert seen == [25, 50, 60]
    assert any("no checkpoint to go on from" in note for note in made.notes)


@pytest.mark.full
def test_a_handler_of_the_caller_s_hears_the_interrupt(fitted, capture, tmp_path):
    heard = []
    usual = signal.signal(signal.SIGINT, lambda *_: heard.append(True))
    try:
        seen, _ = steps_of(capture, tmp_path / "fit", interrupted)
    finally:
        signal.signal(signal.SIGINT, usual)
    assert heard and seen == [25, 50, 60]


def test_any_function_is_broken_off_by_its_progress(fitted, tmp_path, monkeypatch):
    with pytest.raises(StoppedError, match="no file is half-written"):
        rift.render(
            fitted, tmp_path / "film", frames=3, size=(40, 30), progress=lambda report: False
        )
    assert not list(tmp_path.glob("**/*.part"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(StoppedError, match="no out was given"):
        rift.render(fitted, frames=3, size=(40, 30), progress=lambda report: False)
    assert [path.name for path in tmp_path.iterdir()] == ["film"]


def test_a_reconstruction_is_broken_off_by_its_progress_and_goes_on(tmp_path):
    grid, scan = rift.Grid((6, 24, 24)), rift.Parallel(np.arange(32) * np.pi / 32, 24)
    values = rift.phantom.shepp_logan_sinogram(grid, scan)
    path, out = tmp_path / "scan.npz", tmp_path / "out"
    np.savez(path, sinogram=values, angles=scan.angles)
    with pytest.raises(StoppedError, match="6 of 6 slices are kept"):
        rift.reconstruct_scan(path, out, center=11.5, progress=lambda report: report.done < 6)
    seen = []
    rift.reconstruct_scan(path, out, center=11.5, resume=True, progress=seen.append)
    assert all(report.done == 6 for report in seen)
