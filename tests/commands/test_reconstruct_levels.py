"""``rift reconstruct --method levels``: one material in a disc, from a sixth of a half turn."""

import json

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.io import read_volume
from rift_cl.phantom import Ellipsoid, project, render

INPUT, MU = 3, 0.03


def run(*arguments):
    return main([str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def disc(tmp_path_factory):
    """A disc with three holes seen over 40 degrees, and which pixels are material."""
    path = tmp_path_factory.mktemp("disc") / "scan.npz"
    grid, angles = rift.Grid((64, 64)), np.deg2rad(np.arange(70, 110, 0.8))
    holes = [((0, 8, -8), 5), ((0, -10, 2), 4), ((0, 4, 12), 6)]
    parts = [Ellipsoid((0, 0, 0), (99, 26, 26), 0.0, MU)]
    parts += [Ellipsoid(center, (99, size, size), 0.0, -MU) for center, size in holes]
    integrals = project(parts, grid, rift.Parallel(angles, 72))
    np.savez(path, projections=integrals[:, None], angles=angles)
    return path, render(parts, grid) > MU / 2


def agreement(image, truth):
    return np.mean((image > MU / 2) == truth)


@pytest.mark.full
def test_holes_are_found_that_other_methods_smear(disc, tmp_path):
    path, truth = disc
    common = ("--center", 35.5, "--size", 64, "--kind", "attenuation")
    images = {}
    for method in ("levels", "tv"):
        out = tmp_path / method
        assert run("reconstruct", path, "--out", out, "--method", method, *common) == 0
        images[method] = read_volume(out / "slices")[0]
    assert agreement(images["levels"], truth) > 0.94
    assert agreement(images["levels"], truth) > agreement(images["tv"], truth) + 0.02
    assert images["levels"].max() == pytest.approx(MU, rel=0.05)
    noted = " ".join(json.loads((tmp_path / "levels/metrics.json").read_text())["assumed"])
    assert "a disc of one material" in noted


def test_what_is_no_disc_is_told(tmp_path, capsys):
    path = tmp_path / "scan.npz"
    angles = np.deg2rad(np.arange(70, 110, 0.8))
    chance = np.random.default_rng(0)
    np.savez(path, projections=chance.random((len(angles), 1, 72)), angles=angles)
    options = ("--center", 35.5, "--method", "levels", "--kind", "attenuation")
    assert run("reconstruct", path, "--out", tmp_path / "out", *options) == INPUT
    assert "disc" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
