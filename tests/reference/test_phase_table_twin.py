"""How near the phase tables come to the transform that they approximate, and where exactly."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.geometry import Grid, Parallel
from rift_cl.reference import phase_table, phase_table_matrix, radon, radon_matrix


@pytest.mark.parametrize(
    ("grid", "angles"),
    [
        (Grid((9, 12)), [0, np.pi / 2, np.pi, -np.pi / 2, 5 * np.pi / 2]),
        (Grid((9, 12)), [np.pi / 4, 3 * np.pi / 4, -np.pi / 4, 5 * np.pi / 4]),
        (Grid((9, 12), spacing=(2, 0.5)), [np.arctan(1 / 4), np.pi - np.arctan(1 / 4), 0]),
        (Grid((9, 12)), [np.arctan(1 / 8), np.arctan(5 / 8), np.arctan(8)]),
        (Grid((1, 12)), [0.1, 0.7]),
        (Grid((9, 1)), [1.1, 1.7]),
    ],
)
def test_exact_where_rows_fall_on_phases(grid, angles):
    scan = Parallel(angles, bins=31, pitch=0.9, center=14.3)
    difference = phase_table_matrix(grid, scan) - radon_matrix(grid, scan)
    assert abs(difference).max() < 1e-12


def test_the_error_on_noise_falls_by_phases_to_three_halves():
    """It is sqrt(step^3 / (10 phases^3)), step in bins per column.

    A view of white noise has kinks of mean square 6 at its bins. A straight line across a kink
    errs by a triangle; over all places in its interval the mean square is 6 s^3 / 90 for samples s
    bins apart, and a view's interpolant itself has 2 / 3.
    """
    grid, scan = Grid((48, 48)), Parallel(np.linspace(0, np.pi, 40, endpoint=False) + 0.01, 72)
    y = np.random.default_rng(1).standard_normal((40, 72))
    truth = radon(grid, scan, "linear").backproject(y)
    step = np.maximum(abs(np.cos(scan.angles)), abs(np.sin(scan.angles)))
    for phases in (2, 4, 8, 16):
        value = phase_table(grid, scan, "linear", phases=phases).backproject(y)
        error = np.linalg.norm(value - truth) / np.linalg.norm(truth)
        assert error == pytest.approx(np.sqrt(np.mean(step**3) / 10 / phases**3), rel=0.1)


def test_a_strip_errs_by_the_square_of_phases_unless_its_edges_are_steep():
    """Slanted shadows have no kinks; where bins are far narrower, shadows along an axis have."""
    grid = Grid((48, 48))
    slanted = np.linspace(0.3, np.pi / 2 - 0.3, 20)
    for pitch, angles, order in ((1.0, slanted, 4), (0.02, np.array([0.004, 0.006]), 2**0.5)):
        scan = Parallel(angles, int(70 / pitch), pitch)
        y = np.random.default_rng(2).standard_normal((len(angles), scan.bins))
        truth = radon(grid, scan, "strip").backproject(y)
        errors = [
            np.linalg.norm(phase_table(grid, scan, "strip", phases=n).backproject(y) - truth)
            for n in (4, 8)
        ]
        assert errors[0] / errors[1] == pytest.approx(order, rel=0.25)


@pytest.mark.parametrize("footprint", ["linear", "joseph", "strip"])
def test_no_mass_is_lost(footprint):
    grid, scan = Grid((13, 10)), Parallel(np.linspace(-4, 4, 11), bins=40)
    table, exact = (make(grid, scan, footprint) for make in (phase_table_matrix, radon_matrix))
    if footprint == "joseph":
        # A pixel's mass differs from view to view, and the phases blunt the difference.
        np.testing.assert_allclose(table.sum(), exact.sum(), rtol=2e-3)
    else:
        np.testing.assert_allclose(table.sum(axis=0), exact.sum(axis=0), rtol=1e-12)
