"""``rift fit`` with modes and lobes: options, and every command on what it leaves behind."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.view.job import ViewJob
from rift_cl.commands.view.settings import ViewSettings
from rift_cl.errors import StoppedError
from rift_cl.io.scenes.splat_scene import XrayScene
from rift_cl.io.volumes import read_volume

KINDS = {
    "laguerre exp": ["--basis", "laguerre", "--order", "2", "--activation", "exp"],
    "lg": ["--angular", "lg", "--modes", "4"],
    "asg": ["--angular", "asg", "--modes", "2", "--basis", "hermite", "--color-order", "0"],
}


def settings(capture, out, **more):
    given = {"steps": 60, "splats": 60, "hold_out": 4, "checkpoint_every": 25}
    return FitPhotosSettings.of(capture, out, **(given | more))


def broken_off(given, after):
    """Run a fit until a step, as Ctrl-C would break it off; what is said then."""
    job = Fit(given)
    with pytest.raises(StoppedError, match="rift fit") as caught:
        for report in job.run():
            if report.done >= after:
                job.stop()
    return str(caught.value)


def fit(capture, out, *more, splats="60"):
    arguments = ["fit", str(capture), "--out", str(out), "--steps", "24", "--splats", splats]
    return main([*arguments, "--hold-out", "4", "--quiet", *more])


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_a_fit_is_drawn_by_every_command_as_it_was_scored(capture, tmp_path, kind):
    out = tmp_path / "fit"
    assert fit(capture, out, *KINDS[kind]) == 0
    scene = rift.SplatScene.load(out / "scene.ply")
    given = dict(zip(KINDS[kind][::2], KINDS[kind][1::2], strict=True))
    assert scene.activation == given.get("--activation", "clamp")
    assert scene.angular == given.get("--angular", "sh")
    order = given.get("--order", "1")
    orders = {"shape_modes": order, "color_modes": given.get("--color-order", order)}
    for name, order in orders.items():
        modes = getattr(scene, name)
        wanted = int(order) if "--basis" in given else 0
        assert (0 if modes is None else modes.shape[1]) == {0: 0, 1: 3, 2: 9}[wanted]
    metrics = json.loads((out / "metrics.json").read_text())
    config = json.loads((out / "config.json").read_text())
    assert metrics["basis"] and metrics["basis"] in (out / "report.html").read_text()
    assert config["settings"]["training"]["angular"]["kind"] == scene.angular
    scored = ["eval", str(out), str(capture), "--hold-out", "4", "--out", str(tmp_path / "eval")]
    assert main([*scored, "--train", str(capture), "--quiet"]) == 0
    again = json.loads((tmp_path / "eval" / "metrics.json").read_text())["scores"]
    (found,) = again.values()
    assert found["fit_psnr"] == pytest.approx(metrics["scores"]["held out"]["fit_psnr"], abs=2e-3)
    drawn = ["render", str(out), "--out", str(tmp_path / "render"), "--frames", "2"]
    assert main([*drawn, "--size", "32", "24", "--depth", "--quiet"]) == 0
    assert len(list((tmp_path / "render" / "frames").glob("*.png"))) == 2
    assert main(["analyze", str(tmp_path / "render"), "--out", str(tmp_path / "a"), "--quiet"]) == 0
    pytest.importorskip("viser", reason="viser is not installed")
    with ViewJob(ViewSettings(out, port=0)) as job:
        assert job.url.startswith("http://127.0.0.1:")


@pytest.mark.full
@pytest.mark.parametrize(
    "more",
    [{"basis": "hermite", "order": 1, "activation": "exp"}, {"angular": "sg", "modes": 2}],
)
def test_a_fit_that_was_broken_off_goes_on_to_the_same_bits(capture, tmp_path, more):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    list(Fit(settings(capture, whole, **more)).run())
    words = broken_off(settings(capture, cut, **more), 25)
    assert all(f"--{name} {value}" in words for name, value in more.items())
    list(Fit(settings(capture, cut, resume=True, **more)).run())
    assert (cut / "scene.ply").read_bytes() == (whole / "scene.ply").read_bytes()


@pytest.mark.full
def test_another_basis_cannot_go_on(capture, tmp_path, capsys):
    broken_off(settings(capture, tmp_path / "fit"), 25)
    more = ["--steps", "60", "--resume", "--activation", "exp"]
    assert fit(capture, tmp_path / "fit", *more) == 3
    assert "had activation 'clamp', now it is 'exp'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "orders"),
    [
        ({}, (0, 0)),
        ({"basis": "hermite"}, (1, 1)),
        ({"basis": "hermite", "order": 2}, (2, 2)),
        ({"basis": "laguerre", "order": 2, "color_order": 0}, (2, 0)),
        ({"basis": "hermite", "order": 0, "color_order": 3}, (0, 3)),
    ],
)
def test_one_order_is_that_of_shape_and_colour(options, orders):
    found = FitPhotosSettings.of(Path("capture"), Path("out"), **options).decided(9).training.basis
    assert (found.order, found.color_order) == orders
    options.pop("color_order", None)
    found = FitXraySettings.of(Path("scan"), Path("out"), **options).decided(9).training.basis
    assert (found.order, found.color_order) == (orders[0], 0)


def test_words_say_what_splats_are():
    def words(**options):
        return FitPhotosSettings.of(Path("capture"), Path("out"), **options).basis_words()

    assert words() == ""
    found = words(basis="hermite", order=2, color_order=1, activation="exp")
    assert found == "hermite splats of shape order 2, colour order 1, activation exp"
    assert words(angular="lg", modes=5) == "5 lg functions"


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--order", "1"], "order is 1"),
        (["--color-order", "1"], "color-order is 1"),
        (["--basis", "hermite", "--order", "9"], "order is 9, wanted 0 to 8"),
        (["--basis", "hermite", "--order", "-1"], "order is -1"),
        (["--modes", "4"], "--modes counts lobes: add --angular"),
        (["--angular", "lg", "--modes", "36"], "modes is 36, wanted 1 to 35"),
        (["--angular", "lg", "--sh-degree", "2"], "--sh-degree is about harmonics"),
        (
            ["--basis", "hermite", "--strategy.absgrad", "--strategy", "default"],
            "absgrad wants magnitudes",
        ),
    ],
)
def test_what_makes_no_sense_is_named_and_leaves_nothing(capture, tmp_path, capsys, more, words):
    assert fit(capture, tmp_path / "fit", *more) == 3
    assert words in capsys.readouterr().err
    assert not (tmp_path / "fit").exists()


@pytest.mark.full
def test_a_dry_run_says_what_splats_would_be(capture, tmp_path, capsys):
    assert fit(capture, tmp_path / "fit", "--basis", "hermite", "--dry-run") == 0
    printed = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "hermite splats of shape order 1, colour order 1" in printed


@pytest.mark.full
@pytest.mark.parametrize("rows", [1, 3])
def test_densities_of_x_rays_have_modes_too(tmp_path, rows):
    size, pitch = 24, 0.5
    grid = rift.Grid((rows, size, size), pitch)
    scan = rift.Parallel(np.arange(18) * np.pi / 18, size, pitch)
    values = 0.2 * rift.phantom.shepp_logan_sinogram(grid, scan)
    np.savez(tmp_path / "scan.npz", projections=values, angles=scan.angles, pitch=pitch)
    more = ["--center", str((size - 1) / 2), "--basis", "hermite", "--order", "2"]
    out = tmp_path / "fit"
    assert fit(tmp_path / "scan.npz", out, *more, splats="80") == 0
    scene = rift.SplatScene.load(out / "scene.ply")
    assert isinstance(scene, XrayScene) and scene.shape_modes.shape == (80, 9)
    assert scene.shape_modes.any() and scene.color_modes is None
    # (x, y, z), then xx, xy, xz, yy, yz, zz.
    across = np.array([0, 0, 1, 0, 0, 1, 0, 1, 1], bool)
    assert scene.shape_modes[:, across].any() == (rows > 1)
    slices = read_volume(out / "slices")
    assert slices.shape == (rows, size, size)
    truth = 0.2 * rift.phantom.shepp_logan(grid)
    assert slices.sum() == pytest.approx(truth.sum(), rel=0.1)
    assert "hermite splats of shape order 2" in (out / "report.html").read_text()
