"""The laws of density: slopes of -1, and what rings and spheres of views measure."""

from __future__ import annotations

import numpy as np
import pytest
from observations_of_all_kinds import ring_directions

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Parallel
from rift_cl.sampling.coverage.density import (
    density,
    half_sphere,
    mean_density,
    power_slope,
    ring_density,
    sphere_density,
    window_width,
)
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

VIEWS = 512
RADII = np.geomspace(2, 32, 9)
SPACE = Target((0, 0, 0), 1.0)


def test_the_window_is_its_integral():
    u = np.linspace(-4, 4, 40001)
    assert window_width(2.0) == pytest.approx(np.exp(-2 * (u / 0.25) ** 2).sum() * (u[1] - u[0]))


def test_in_the_plane_the_slope_is_minus_one(device):
    scan = Parallel(np.arange(VIEWS) * np.pi / VIEWS, bins=1000, pitch=1e-4)
    found = mean_density(scan, Target.flat(1.0), RADII, device=device)
    assert power_slope(RADII, found) == pytest.approx(-1, abs=0.02)
    np.testing.assert_allclose(found, VIEWS / (np.pi * RADII), rtol=0.01)


def test_over_the_sphere_the_slope_is_minus_one(device):
    observations = Observations.along(half_sphere(VIEWS))
    found = mean_density(observations, SPACE, RADII, samples=4096, device=device)
    assert power_slope(RADII, found) == pytest.approx(-1, abs=0.02)
    np.testing.assert_allclose(found, VIEWS / (2 * RADII), rtol=0.01)


def test_random_views_keep_the_law_of_the_sphere(device):
    directions = np.random.default_rng(0).normal(size=(4096, 3))
    k = 12.0 * half_sphere(512)
    found = density(Observations.along(directions), SPACE, k, device=device)[0]
    assert found.mean() == pytest.approx(4096 / 24, rel=0.01)
    np.testing.assert_allclose(sphere_density(4096, k), 4096 / 24)


def test_a_ring_is_dense_about_its_axis_and_not_about_zero(device):
    """K / (pi sqrt(kx^2 + ky^2)), at every height above the ring's plane."""
    observations = Observations.along(ring_directions(4 * VIEWS))
    turn = np.linspace(0, np.pi, 7)
    for height in (0.0, 5.0, 30.0):
        k = np.stack([9 * np.cos(turn), 9 * np.sin(turn), np.full(7, height)], axis=1)
        found = density(observations, SPACE, k, device=device)[0]
        np.testing.assert_allclose(found, ring_density(4 * VIEWS, k), rtol=0.01)


def test_a_weight_counts_as_so_many_views(device):
    observations, k = Observations.along(ring_directions(64)), [[5.0, 1, 0]]
    heavy = Observations(
        observations.direction,
        3 * observations.weight,
        observations.pixel,
        observations.cutoff,
        observations.blur,
    )
    found = [density(some, SPACE, k, device=device) for some in (observations, heavy)]
    np.testing.assert_allclose(found[1], 3 * found[0], rtol=1e-6)


def test_the_laws_are_infinite_where_all_slices_meet():
    np.testing.assert_array_equal(sphere_density(4, [[0, 0, 0], [1, 0, 0]]), [np.inf, 2])
    np.testing.assert_allclose(ring_density(4, [[0, 0, 9], [1, 0, 9]]), [np.inf, 4 / np.pi])


def test_bad_arguments_are_refused():
    for radii in ([0.0, 1.0], [], [np.inf], [np.nan], "wide"):
        with pytest.raises(InputError, match="radii"):
            mean_density(Observations.along([[1, 0, 0]]), SPACE, radii)
    for samples in (0, 2.5, "many"):
        with pytest.raises(InputError, match="samples"):
            mean_density(Observations.along([[1, 0, 0]]), SPACE, [1.0], samples=samples)
    with pytest.raises(InputError, match="views is 'few'"):
        ring_density("few", [1, 0, 0])
    with pytest.raises(ShapeError, match="two or more"):
        power_slope([1.0], [1.0])
    with pytest.raises(InputError, match="positive"):
        power_slope([1.0, 2.0], [0.0, 1.0])
    with pytest.raises(ShapeError, match="k has shape"):
        sphere_density(3, [1.0, 2.0])
    with pytest.raises(InputError, match="not all zero"):
        sphere_density(3, [np.nan, 0, 0])
