"""Modes and lobes where splats become more or fewer: copies, halves, clones, what is pruned."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss
from test_basis_parameters import COUNT, with_modes

from rift_cl.basis.indices import graded
from rift_cl.train.parameters import MORE, Environment, Parameters
from rift_cl.train.per_view.quaternions import rotated
from rift_cl.train.strategy.default import DefaultSettings, densify
from rift_cl.train.strategy.mcmc import relocate
from rift_cl.train.strategy.xray import relocate_densities

pytestmark = pytest.mark.once


def test_splats_that_share_a_place_have_the_depth_of_the_one_before(device):
    """Depths add up, so that a copy and its host show exactly what the host did."""
    raw = with_modes(60)
    raw["logits"] = np.linspace(-2, 6, 60).astype(np.float32)
    raw["logits"][:9] = -9
    before = Parameters.of(device, raw, step=600, amplitude=True)
    after = relocate(before, min_opacity=0.005, most=60, seed=1, growth=0.0)
    assert after.amplitude
    new = after.host()[0]
    assert np.array_equal(new["log_scales"][9:], raw["log_scales"][9:])
    depths = np.logaddexp(0, new["logits"].astype(float))
    for host in range(9, 60):
        same = [k for k in range(60) if np.array_equal(new["means"][k], raw["means"][host])]
        assert depths[same].sum() == pytest.approx(np.logaddexp(0, raw["logits"][host]), rel=2e-4)
        for name in ("shape_modes", "color_modes"):
            assert all(np.array_equal(new[name][k], raw[name][host]) for k in same)
    assert sum(np.array_equal(new["means"][k], raw["means"][k]) for k in range(9)) == 0


def moments_of(raw, degree):
    """Moments of the sum of densities up to a degree, by quadrature that is exact for them."""
    nodes, weights = hermegauss(12)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    each = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    order = {3: 1, 9: 2, 19: 3, 34: 4}[raw["shape_modes"].shape[1]]
    total = np.zeros([degree + 1] * 3)
    for k in range(len(raw["means"])):
        scale = np.exp(raw["log_scales"][k].astype(float))
        values = np.ones(len(grid))
        for index, mode in zip(graded(order, 3)[1:], raw["shape_modes"][k], strict=True):
            values = values + mode * np.prod(
                [hermite(n, grid[:, a]) for a, n in enumerate(index)], axis=0
            )
        values = values * each * np.exp(float(raw["logits"][k])) * scale.prod()
        quats = np.tile(raw["quats"][k].astype(float), (len(grid), 1))
        places = raw["means"][k] + rotated(quats, grid * scale)
        for powers in np.ndindex(*total.shape):
            if sum(powers) <= degree:
                total[powers] += (values * np.prod(places**powers, axis=1)).sum()
    return total


def hermite(n, x):
    """The normalised He_n."""
    before, now = np.zeros_like(x), np.ones_like(x)
    for k in range(n):
        before, now = now, (x * now - np.sqrt(k) * before) / np.sqrt(k + 1)
    return now


@pytest.mark.parametrize("order", [1, 2, 4])
def test_halves_of_x_ray_splats_keep_all_moments_to_the_third(device, order):
    raw = with_modes(12, order, 0)
    raw["log_scales"] = np.random.default_rng(5).normal(0, 0.5, (12, 3)).astype(np.float32)
    raw["logits"] = np.linspace(0, 1, 12).astype(np.float32)
    raw["logits"][:3] = -40
    before = Parameters.of(device, raw, step=100, density=True)
    after = relocate_densities(before, np.ones(12, np.float32), min_mass=0.05, seed=4)
    new = after.host()[0]
    assert (new["logits"] > -10).all()
    one, other = moments_of(raw, 3), moments_of(new, 3)
    np.testing.assert_allclose(other, one, atol=1e-4 * np.abs(one).max())
    # The fourth moments tell that they are halves.
    assert not np.allclose(moments_of(new, 4), moments_of(raw, 4), rtol=1e-4)


def test_clones_copy_modes_lobes_and_reflectance(device):
    raw = with_modes(lobes=6, lit=True)
    raw["log_scales"][:] = -6
    light = Environment.of(device, np.zeros((8, 3), np.float32))
    parameters = Parameters.of(device, raw, step=600, environment=light)
    statistics = np.zeros((COUNT, 3), np.float32)
    statistics[:5, :2] = 1.0
    after = densify(
        parameters, statistics, DefaultSettings(), extent=1.0, most=100, seed=0, prune_large=False
    )
    new, first, _ = after.host()
    grown = len(after) - COUNT
    assert grown > 0
    for name in MORE:
        assert np.array_equal(new[name][:COUNT], raw[name])
        assert all((new[name][k] == raw[name][:5]).reshape(5, -1).all(1).any() for k in
                   range(COUNT, COUNT + grown))  # fmt: skip
        assert not first[name][COUNT:].any()


def test_splats_without_finite_modes_are_pruned(device):
    raw = with_modes()
    raw["log_scales"][:] = -6
    raw["logits"][:] = 1
    raw["shape_modes"][7, 2] = np.nan
    after = densify(
        Parameters.of(device, raw, step=600), np.zeros((COUNT, 3), np.float32), DefaultSettings(),
        extent=1.0, most=100, seed=0, prune_large=False,
    )  # fmt: skip
    assert len(after) == COUNT - 1
