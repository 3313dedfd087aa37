"""Samples that no object has are told, and beads, needles, edges and noise are not."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.commands.fit_xray.job import XrayFit
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.inputs.stray_samples import stray_samples
from rift_cl.commands.reconstruct.clean_rows import CleanRows
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.settings import ReconstructSettings

BINS = 48
AWAY = np.arange(BINS) - (BINS - 1) / 2


def ellipse(angles, middle, radii, value):
    """Exact line integrals (view, bin) of a slanted ellipse, each the mean of five across a bin."""
    x, y = middle
    width = np.hypot(radii[0] * np.cos(angles), radii[1] * np.sin(angles))[:, None, None]
    t = AWAY[:, None] + np.linspace(-0.4, 0.4, 5)
    t = t - (x * np.cos(angles) + y * np.sin(angles))[:, None, None]
    chords = 2 * value * np.prod(radii) * np.sqrt(np.maximum(width**2 - t**2, 0)) / width**2
    return chords.mean(axis=2)


def body(angles):
    return ellipse(angles, (2, -3), (16, 14), 0.02) + ellipse(angles, (8, 2), (4, 4), 0.03)


def half(views):
    return np.arange(views) * np.pi / views


def random():
    return np.random.default_rng(5)


@pytest.mark.parametrize("value", [5.0, -5.0, 2.0])
def test_single_samples_are_told_wherever_they_are(value):
    angles = half(60)[::-1]
    lines = body(angles)
    wrong = random().random(lines.shape) < 0.003
    # Ends of a row have no neighbours.
    wrong[:, [0, -1]] = False
    lines[wrong] = value
    found = stray_samples(lines, angles)
    assert wrong.sum() > 5 and not (found & ~wrong).any()
    assert found.sum() >= wrong.sum() - 2


OBJECTS = {
    "clean": body,
    "bead": lambda a: body(a) + ellipse(a, (9, 6), (0.5, 0.5), 20),
    "beads": lambda a: (
        body(a) + sum(ellipse(a, random().uniform(-14, 14, 2) * k, (0.4, 0.4), 20) for k in (1, -1))
    ),
    "needles": lambda a: body(a) + sum(ellipse(a, (k, -k), (0.3, 14), 2) for k in range(-8, 9, 4)),
    "needle alone": lambda a: ellipse(a, (0, 3), (18, 0.3), 1),
    "two levels": lambda a: 100 * ellipse(a, (3, 2), (9, 9), 1),
    "air": lambda a: 0 * body(a),
}


@pytest.mark.parametrize("views", [60, 12, 5, 2])
@pytest.mark.parametrize("name", OBJECTS)
def test_no_object_strays(name, views):
    angles = half(views)
    lines = OBJECTS[name](angles)
    assert not stray_samples(lines, angles).any()
    # Of a detector that the object is wider than, parts come and go.
    assert not stray_samples(lines[:, 14:-14], angles).any()


@pytest.mark.parametrize("beam", [3, 12, 100, 1000])
@pytest.mark.parametrize("thick", [1, 4, 10])
def test_logarithms_of_few_counts_do_not_stray(beam, thick):
    angles = half(60)
    counts = random().poisson(beam * np.exp(-thick * body(angles)))
    assert not stray_samples(-np.log(np.maximum(counts, 0.5) / beam), angles).any()


def test_slices_and_fits_tell_stray_samples_and_what_helps(tmp_path):
    path, angles = tmp_path / "scan.npz", half(60)
    lines = body(angles)
    lines[7::11, 20] = 5
    np.savez(path, projections=lines[:, None], angles=angles)
    given = {"center": 23.5, "kind": "attenuation"}
    slices = Reconstruction(ReconstructSettings(path, out=tmp_path / "out", **given))
    fitted = XrayFit(FitXraySettings.of(path, tmp_path / "out", **given)).input
    fitted.read()
    told = {"--zingers 6": slices.plan()["assumed"], "--loss l1": " ".join(fitted.notes)}
    for remedy, words in told.items():
        assert "Doubt: 5 samples of row 0" in words and remedy in words


def test_zingers_are_taken_out_of_line_integrals_to_either_side(tmp_path, device):
    path, angles = tmp_path / "scan.npz", half(60)
    clean = body(angles)
    lines = clean.copy()
    lines[7::11, 20], lines[9::11, 30] = 5, -3
    np.savez(path, projections=lines[:, None], angles=angles)
    given = ReconstructSettings(path, out=tmp_path / "out", kind="attenuation", zingers=6)
    rows = CleanRows(given.open_scan(), given, None, device)
    found = rows.read(0, 1).projections[:, 0]
    assert rows.zingers == np.count_nonzero(lines != clean)
    np.testing.assert_allclose(found, clean, atol=0.1 * clean.max())
