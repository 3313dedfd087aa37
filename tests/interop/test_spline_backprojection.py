"""Backprojected splines are SciPy's, wherever grid and detector lie, and end with the detector."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import rift_cl as rift
from rift_cl.interop.spline_backprojection import backproject_spline

GRID = rift.Grid((13, 19), (0.7, 0.9), (1.5, -2.25))
SCAN = rift.Parallel([0.1, 1.3, -2.2, 9.0], 11, 0.8, center=6.3)


def expected(sinogram, degree):
    """Every view's spline at every pixel, by SciPy."""
    y, x = GRID.coordinates(0)[:, None], GRID.coordinates(1)
    image = np.zeros(GRID.shape)
    for view, angle in zip(sinogram, SCAN.angles, strict=True):
        bins = (x * np.cos(angle) + y * np.sin(angle)) / SCAN.pitch + SCAN.center
        values = map_coordinates(view, bins[None], order=degree, mode="mirror")
        image += np.where((bins >= 0) & (bins <= SCAN.bins - 1), values, 0)
    return image


@pytest.mark.parametrize("degree", [0, 3])
def test_every_pixel_reads_the_spline_of_every_view(degree, device):
    sinogram = np.random.default_rng(4).standard_normal((4, 11)).astype(np.float32)
    A = rift.Projector(GRID, SCAN, device=device)
    found = backproject_spline(A, sinogram, degree)
    assert np.allclose(found, expected(sinogram, degree), atol=1e-5)


@pytest.mark.parametrize("degree", [0, 3])
def test_a_constant_stays_one_inside_the_detector(degree, device):
    A = rift.Projector(rift.Grid((6, 6)), rift.Parallel([0.0, 0.7], 12), device=device)
    assert np.allclose(backproject_spline(A, np.ones((2, 12), np.float32), degree), 2, atol=1e-6)
