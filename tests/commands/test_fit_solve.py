"""``rift fit xray --solve``: densities by least squares, from the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.fit_xray.job import XrayFit
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.errors import StoppedError

SIZE, VIEWS = 32, 24


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """The head in two slices of 32 x 32, from 24 views."""
    path = tmp_path_factory.mktemp("scan") / "scan.npz"
    grid, scan = rift.Grid((2, SIZE, SIZE)), rift.Parallel(np.arange(VIEWS) * np.pi / VIEWS, SIZE)
    np.savez(path, projections=rift.phantom.shepp_logan_sinogram(grid, scan), angles=scan.angles)
    return path


def fit(path, out, *more):
    arguments = ["fit", "xray", str(path), "--out", str(out), "--steps", "60"]
    arguments += ["--splats", "200", "--center", str((SIZE - 1) / 2), "--quiet"]
    return main([*arguments, *more])


def settings(path, out, **more):
    center = (SIZE - 1) / 2
    given = {"steps": 90, "splats": 200, "center": center, "checkpoint_every": 20, "solve": 20}
    return FitXraySettings.of(path, out, basis="hermite", **(given | more))


@pytest.mark.full
def test_solving_serves_projections_that_were_not_looked_at(scan, tmp_path):
    found = []
    for every in ("0", "20"):
        assert fit(scan, tmp_path / every, "--solve", every) == 0
        metrics = json.loads((tmp_path / every / "metrics.json").read_text())
        found.append(metrics["scores"]["held out"]["fit_psnr"])
        config = json.loads((tmp_path / every / "config.json").read_text())
        assert config["settings"]["training"]["solve"]["every"] == int(every)
    assert found[1] > found[0] + 0.1


@pytest.mark.full
def test_a_fit_that_was_broken_off_goes_on_to_the_same_bits(scan, tmp_path):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    list(XrayFit(settings(scan, whole)).run())
    job = XrayFit(settings(scan, cut))
    with pytest.raises(StoppedError, match="--solve 20"):
        for report in job.run():
            if report.what == "steps" and report.done >= 50:
                job.stop()
    list(XrayFit(settings(scan, cut, resume=True)).run())
    assert (cut / "scene.ply").read_bytes() == (whole / "scene.ply").read_bytes()


def test_negative_steps_between_solves_are_refused(scan, tmp_path, capsys):
    assert fit(scan, tmp_path / "fit", "--solve", "-5") == 3
    assert "--solve is -5, wanted a whole number >= 0" in capsys.readouterr().err
    assert fit(scan, tmp_path / "fit", "--solve", "9" * 20) == 3
    assert "--solve is 99999999999999999999, wanted a whole number up to" in capsys.readouterr().err
    assert not (tmp_path / "fit").exists()
