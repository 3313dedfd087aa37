"""The limited-angle comparison: its phantoms, its score, its table and pictures."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from rift_cl.reconstruct import find_disc


@pytest.fixture
def limited_angle(tool):
    return tool("limited_angle")


@pytest.mark.parametrize("kind", ["holes", "struts", "openings"])
def test_phantoms_are_discs_with_holes_inside_a_solid_rim(limited_angle, kind):
    truth = limited_angle.phantom(kind, np.random.default_rng(4))
    filled = ndimage.binary_fill_holes(truth)
    radius = np.sqrt(filled.sum() / np.pi)
    depth = ndimage.distance_transform_edt(filled)
    assert 0.03 < np.mean(filled & ~truth) / filled.mean() < 0.8
    assert truth[(depth > 0) & (depth < 10)].all()
    assert depth.max() == pytest.approx(radius, rel=0.02)


def test_a_simulated_scan_shows_its_disc(limited_angle):
    scan = limited_angle.simulated(1)
    filled = ndimage.binary_fill_holes(scan.truth)
    disc = find_disc(scan.sinogram, scan.geometry, seen=scan.seen)
    assert disc.radius == pytest.approx(np.sqrt(filled.sum() / np.pi) * 0.14832, abs=0.05)


def test_the_score_is_the_matthews_correlation(limited_angle):
    truth = np.zeros((64, 64), bool)
    truth[8:40, 16:48] = True
    assert limited_angle.score(truth.astype(np.float32), 0.5, truth) == pytest.approx(1)
    assert limited_angle.score(1 - truth.astype(np.float32), 0.5, truth) == pytest.approx(-1)
    coarse = truth.reshape(16, 4, 16, 4).mean(axis=(1, 3)).astype(np.float32)
    assert limited_angle.score(coarse, 0.5, truth) > 0.98
    image = np.where(truth, 0.9, 0.2) + 0.02 * np.random.default_rng(0).standard_normal((64, 64))
    assert np.array_equal(image > limited_angle.otsu(image.astype(np.float32)), truth)


def test_the_table_and_its_pictures(limited_angle, tmp_path, monkeypatch, capsys):
    out = tmp_path / "pictures"
    options = ["--out", str(out), "--seeds", "1", "--size", "32", "--steps", "2"]
    monkeypatch.setattr("sys.argv", ["limited_angle.py", *options])
    assert limited_angle.main() == 0
    printed = capsys.readouterr().out
    assert "struts 1" in printed and "Matthews" in printed
    assert len(list(out.glob("struts_1_*.png"))) == 8
