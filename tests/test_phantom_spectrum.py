"""The exact spectrum of ellipsoids: mass at zero, the slice theorem, and sums over voxels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl import phantom
from rift_cl.errors import ShapeError
from rift_cl.geometry import Grid, Parallel
from rift_cl.phantom import Ellipsoid

TILTED = Ellipsoid((0.3, -0.7, 1.1), (1.5, 2.0, 3.1), 0.4, 1.7)
ROUND = Ellipsoid((0.0, 0.0, 0.0), (2.0, 2.0, 2.0), 1.0, 0.5)


def test_at_zero_it_is_the_mass():
    volume = 4 / 3 * math.pi * 1.5 * 2.0 * 3.1 * 1.7
    assert phantom.spectrum([TILTED], np.zeros(3)) == pytest.approx(volume, rel=1e-12)
    assert phantom.spectrum([TILTED], np.zeros(2)) == pytest.approx(math.pi * 2 * 3.1 * 1.7)


def test_near_zero_it_does_not_lose_digits():
    near = phantom.spectrum([ROUND], np.array([[0.0, 0.0, k] for k in (1e-9, 1e-6, 1e-5, 1e-4)]))
    q = 2 * np.pi * 2 * np.array([1e-9, 1e-6, 1e-5, 1e-4])
    np.testing.assert_allclose(near.real, 0.5 * 4 / 3 * math.pi * 8 * (1 - q**2 / 10), rtol=1e-12)


def test_the_other_sign_of_frequency_is_the_conjugate():
    k = np.random.default_rng(0).normal(size=(20, 3))
    np.testing.assert_allclose(
        phantom.spectrum([TILTED], -k), phantom.spectrum([TILTED], k).conj(), rtol=1e-12
    )


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.4])
def test_a_radial_line_is_the_transform_of_the_projection(angle):
    """The Fourier slice theorem, with the projection's own closed form as the other side."""
    pitch, bins = 0.004, 4001
    scan = Parallel([angle], bins, pitch)
    view = phantom.project([TILTED, ROUND], Grid((4, 4)), scan)[0].astype(float)
    radius = np.array([0.0, 0.05, 0.2, 0.4])
    line = np.stack([radius * math.sin(angle), radius * math.cos(angle)], axis=1)
    turns = np.exp(-2j * np.pi * radius[:, None] * scan.coordinates())
    np.testing.assert_allclose(
        phantom.spectrum([TILTED, ROUND], line), turns @ view * pitch, atol=2e-3
    )


def test_it_is_the_sum_over_the_voxels():
    grid = Grid((40, 44, 48), spacing=0.2)
    body = phantom.render([TILTED], grid).astype(float) * 0.2**3
    k = np.array([[0.1, 0.05, -0.1], [0.0, 0.2, 0.0], [-0.15, 0.0, 0.1]])
    z, y, x = (np.exp(-2j * np.pi * k[:, a, None] * grid.coordinates(a)) for a in range(3))
    sums = np.einsum("zyx,nz,ny,nx->n", body, z, y, x)
    # A voxel's mean blurs: the sum is the spectrum times the voxel's own.
    box = np.prod(np.sinc(0.2 * k), axis=1)
    np.testing.assert_allclose(sums, phantom.spectrum([TILTED], k) * box, atol=0.05)


@pytest.mark.parametrize("shape", [(), (5,), (3, 4)])
def test_frequencies_of_no_space_are_refused(shape):
    with pytest.raises(ShapeError, match=r"spectrum: frequencies"):
        phantom.spectrum([TILTED], np.zeros(shape))
