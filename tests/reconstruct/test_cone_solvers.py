"""Every solver takes a cone: it comes closer to the head with each step, and knows its views."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Cone, Grid, Projector, cgls, fbp, phantom, sirt, tv
from rift_cl.geometry import Parallel, at_axis
from rift_cl.reconstruct import MeasuredRays, poisson_weights
from rift_cl.reconstruct.solvers.view_subsets import restricted, view_subsets

pytestmark = pytest.mark.once

N = 24
GRID = Grid((N, N, N))
ANGLES = np.arange(40) * 2 * np.pi / 40
SCAN = Cone(ANGLES, N, N, 1.6, 3.0 * N, 4.5 * N)
HEAD = phantom.shepp_logan(GRID)
AWAY = np.arange(N) - (N - 1) / 2
INSIDE = AWAY[:, None, None] ** 2 + AWAY[:, None] ** 2 + AWAY**2 < (0.48 * N) ** 2


@pytest.fixture(scope="module")
def problem(device):
    A = Projector(GRID, SCAN, device=device)
    return A, A(HEAD)


def psnr(volume):
    return -10 * np.log10(np.mean((volume - HEAD)[INSIDE].astype(float) ** 2))


METHODS = {
    "cgls": lambda A, y, **given: cgls(A, y, 8, **given),
    "sirt": lambda A, y, **given: sirt(A, y, 20, nonnegative=True, **given),
    "ordered subsets": lambda A, y, **given: sirt(A, y, 4, subsets=8, **given),
    "ramp": lambda A, y, **given: sirt(A, y, 5, precondition="ramp", **given),
    "capped ramp": lambda A, y, **given: cgls(A, y, 4, precondition="capped-voronoi", **given),
    "tv": lambda A, y, **given: tv(A, y, 0.02, 30, **given),
}


@pytest.mark.each
@pytest.mark.parametrize("method", METHODS)
def test_every_solver_reconstructs_a_cone(problem, method):
    assert psnr(METHODS[method](*problem)) > psnr(fbp(*problem)) - 1.5


def test_weights_by_counts_are_those_of_every_ray(problem):
    A, y = problem
    weights = poisson_weights(0.1 * y, 1e4).weights
    spoiled = y.copy()
    spoiled[:, 7, 9] = np.nan
    weights[:, 7, 9] = 0
    with_holes = cgls(A, np.nan_to_num(spoiled), 8, weights=weights)
    assert psnr(with_holes) > psnr(cgls(A, y, 8)) - 1.0


def test_rays_that_were_not_measured_pull_at_nothing(problem):
    A, y = problem
    seen = np.ones(A.range, bool)
    seen[::3, 5] = False
    M = MeasuredRays(A, seen)
    np.testing.assert_array_equal(M(HEAD)[~seen], 0)
    assert psnr(cgls(M, np.where(seen, y, 0), 8)) > psnr(fbp(A, y)) - 1.5


def test_subsets_are_projectors_of_their_views(problem):
    A, y = problem
    subsets = view_subsets(A, 5)
    np.testing.assert_array_equal(np.sort(np.concatenate(subsets)), np.arange(40))
    # Views of a full turn from a point are all different: a subset goes round evenly.
    np.testing.assert_array_equal(np.diff(subsets[0]), 5)
    part = restricted(A, subsets[1])
    assert type(part) is type(A)
    np.testing.assert_array_equal(part(HEAD), y[subsets[1]])


def test_a_helix_is_solved_for(device):
    heights = np.linspace(-6, 6, 40)
    scan = Cone(2 * ANGLES, 14, N, 1.6, 3.0 * N, 4.5 * N, heights=heights)
    A = Projector(GRID, scan, device=device)
    assert psnr(cgls(A, A(HEAD), 10)) > 16


def test_bins_at_the_axis_are_the_pitch_over_the_magnification():
    for scan in (SCAN, SCAN.fan(), SCAN.vectors()):
        found = at_axis(scan)
        assert found.pitch == pytest.approx(1.6 / 1.5)
        np.testing.assert_allclose(np.mod(found.angles, 2 * np.pi), ANGLES, atol=1e-9)
    parallel = Parallel(ANGLES, 9)
    assert at_axis(parallel) is parallel
