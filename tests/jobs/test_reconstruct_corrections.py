"""What ``rift reconstruct`` corrects in projections, through the command, with truths known."""

import json

import h5py
import numpy as np
import pytest

import rift_cl as rift
from rift_cl.cli import main
from rift_cl.io import read_volume

INPUT = 3
VIEWS, BINS, ROWS = 120, 80, 12
ANGLES = np.arange(VIEWS) * np.pi / VIEWS


def run(*arguments):
    return main([str(argument) for argument in arguments])


def line_integrals(rows=ROWS, center=None, value=0.02):
    """A ball off the axis that is longer than the rows, (angle, row, bin)."""
    grid = rift.Grid((rows, 64, 64))
    ball = rift.phantom.Ellipsoid((0, 6, -9), (0.7 * rows, 15, 12), 0.0, value)
    return rift.phantom.project([ball], grid, rift.Parallel(ANGLES, BINS, center=center))


def write_counts(path, integrals, change=lambda counts: counts, **names):
    counts = change(1e4 * np.exp(-integrals))
    with h5py.File(path, "w") as file:
        file["exchange/data"] = counts.astype(np.float32)
        file["exchange/data_white"] = np.full((2, *counts.shape[1:]), 1e4, np.float32)
        file["exchange/theta"] = np.rad2deg(ANGLES)
    return path


def reconstruct(path, out, *options):
    assert run("reconstruct", path, "--out", out, "--format", "h5", *options) == 0
    return read_volume(out / "volume.h5")


def notes(out):
    return " ".join(json.loads((out / "metrics.json").read_text())["assumed"])


PHASE = ("--delta-beta", 200, "--energy", 20, "--propagation", 50, "--pitch", 3, "--unit", "um")


def test_phase_retrieval_blurs_as_its_formula_says_and_keeps_the_level(tmp_path):
    # Weak, so that the logarithm of what is blurred is what is blurred of the logarithm.
    path = write_counts(tmp_path / "scan.h5", line_integrals(value=0.002))
    plain = reconstruct(path, tmp_path / "plain", "--center", 39.5, "--rings", "off")
    phase = reconstruct(path, tmp_path / "phase", "--center", 39.5, "--rings", "off", *PHASE)
    assert "Phase was retrieved after Paganin" in notes(tmp_path / "phase")
    assert 3 * np.abs(np.diff(phase)).max() < 0.8 * np.abs(np.diff(plain)).max()
    assert 3 * phase.sum() == pytest.approx(plain.sum(), rel=0.01)


def test_slabs_do_not_show(tmp_path, monkeypatch):
    path = write_counts(tmp_path / "scan.h5", line_integrals())
    options = ("--center", 39.5, "--rings", "off", *PHASE)
    whole = reconstruct(path, tmp_path / "whole", *options)
    monkeypatch.setattr("rift_cl.jobs.reconstruct.inversion._SLAB", 3)
    slabs = reconstruct(path, tmp_path / "slabs", *options)
    np.testing.assert_allclose(slabs, whole, atol=1e-4 * whole.max())


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (PHASE[2:], "--delta-beta is missing"),
        ((*PHASE[:2], *PHASE[4:]), "--energy is missing"),
        (PHASE[:4], "--propagation is missing"),
        (PHASE[:6], "--pitch 0.65 --unit um"),
        ((*PHASE[:5], -50, *PHASE[6:]), "distance"),
        ((*PHASE[:3], 0, *PHASE[4:]), "energy"),
        ((*PHASE[:5], 5e12, *PHASE[6:]), "are pixel"),
    ],
)
def test_phase_retrieval_without_its_numbers_is_told(tmp_path, capsys, options, sentence):
    path = write_counts(tmp_path / "scan.h5", line_integrals(rows=2))
    assert run("reconstruct", path, "--out", tmp_path / "out", "--center", 39.5, *options) == INPUT
    message = capsys.readouterr().err
    assert sentence in message
    assert "Traceback" not in message
    assert not (tmp_path / "out").exists()


def test_phase_retrieval_of_a_single_row_is_told(tmp_path, capsys):
    path = write_counts(tmp_path / "scan.h5", line_integrals(rows=1))
    assert run("reconstruct", path, "--out", tmp_path / "out", "--center", 39.5, *PHASE) == INPUT
    assert "a single one" in capsys.readouterr().err
