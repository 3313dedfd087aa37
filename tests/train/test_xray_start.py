"""Splats and voxels say the same: footprints, the start from a volume, halves of splats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.reference.splat_projection import covariances
from rift_cl.splat import Renderer, Splats, SplatSettings
from rift_cl.train.parameters import GROUPS, Parameters
from rift_cl.train.start.xray import density_splats
from rift_cl.train.strategy import DefaultSettings, McmcSettings, TrainingRun, XraySettings
from rift_cl.train.strategy.mcmc import relocate
from rift_cl.train.strategy.xray import relocate_densities
from rift_cl.train.xray.voxels import Footprints

pytestmark = pytest.mark.once

MIN_MASS = 0.05


def gaussians(count=12, flat=False):
    random = np.random.default_rng(3)
    values = {
        "means": random.uniform(-8, 8, (count, 3)),
        "quats": random.standard_normal((count, 4)),
        "scales": random.uniform(1.2, 3, (count, 3)),
    }
    return values, random.uniform(0.2, 2, count)


def mass(scales, densities):
    return (2 * np.pi) ** 1.5 * densities * scales.prod(axis=1)


@pytest.mark.parametrize("dilation", [0.0, 0.4])
def test_voxels_hold_the_mass_that_splats_have(dilation):
    values, densities = gaussians()
    grid = rift.Grid((50, 52, 54), (1.0, 0.9, 1.1), (0.3, 0, -0.2))
    volume = Footprints(grid, **values, dilation=dilation).sums(densities)
    found = volume.sum() * np.prod(grid.spacing)
    assert found == pytest.approx(mass(values["scales"], densities).sum(), rel=5e-3)


def test_voxels_are_the_gaussians_at_their_places():
    values, densities = gaussians(3)
    grid = rift.Grid((9, 20, 22), 0.8, (1.0, 0, 2))
    volume = Footprints(grid, **values).sums(densities)
    z, y, x = np.meshgrid(*map(grid.coordinates, range(3)), indexing="ij")
    away = np.stack([x, y, z], axis=-1)[..., None, :] - values["means"]
    inverses = np.linalg.inv(covariances(values["quats"], values["scales"]))
    wanted = np.exp(-0.5 * np.einsum("...ni,nij,...nj->...n", away, inverses, away)) @ densities
    assert np.abs(volume - wanted).max() < 5e-3 * wanted.max()


def test_both_ways_through_footprints_are_adjoint():
    values, densities = gaussians()
    footprints = Footprints(rift.Grid((7, 30, 28)), **values, dilation=0.1)
    volume = np.random.default_rng(0).standard_normal((7, 30, 28))
    one = (footprints.sums(densities) * volume).sum()
    assert one == pytest.approx(footprints.inner_products(volume) @ densities, rel=1e-10)


def test_slices_project_to_what_the_rasterizer_draws(device):
    """With the same dilation in both, by two roads that share no code."""
    values, densities = gaussians()
    grid, scan = rift.Grid((24, 40, 40)), rift.Parallel([0.3, 1.9], 41, center=20.3)
    volume = Footprints(grid, **values, dilation=0.3).sums(densities)
    by_voxels = rift.Projector(grid, scan, device=device)(volume.astype(np.float32))
    splats = Splats.upload(device, **values, opacities=densities, colors=np.ones((12, 1)))
    renderer = Renderer(SplatSettings(mode="xray", eps2d=0.3), device=device)
    for angle, wanted in zip(scan.angles, by_voxels, strict=True):
        cos, sin = np.cos(angle), np.sin(angle)
        view = np.eye(4)
        view[:3, :3], view[2, 3] = [[cos, sin, 0], [0, 0, 1], [sin, -cos, 0]], 60
        camera = rift.Camera((24, 41), [[1, 0, 20.8], [0, 1, 12], [0, 0, 1]], view, "ortho")
        image = device.get(renderer.forward(splats, camera).image)[..., 0]
        assert np.linalg.norm(image - wanted) < 0.02 * np.linalg.norm(wanted)


@pytest.mark.parametrize("slices", [1, 6])
def test_the_start_looks_like_the_volume_and_has_its_mass(slices):
    grid = rift.Grid((slices, 48, 48))
    volume = rift.phantom.shepp_logan(grid)
    raw = density_splats(volume, grid, 900, seed=1, dilation=0.1, size=0.8)
    names = ("means", "quats", "log_scales")
    means, quats, log_scales = (raw[name].astype(float) for name in names)
    splats = Footprints(grid, means, quats, np.exp(log_scales), dilation=0.1)
    found = splats.sums(np.exp(raw["logits"].astype(float)))
    assert found.sum() == pytest.approx(volume.sum(), rel=0.02)
    assert np.linalg.norm(found - volume) < 0.5 * np.linalg.norm(volume)
    assert (means[:, 2] == 0).all() == (slices == 1)
    again = density_splats(volume, grid, 900, seed=1, dilation=0.1, size=0.8)
    assert all(raw[name].tobytes() == again[name].tobytes() for name in GROUPS)


def test_nothing_but_air_is_no_start():
    with pytest.raises(InputError, match="nothing but air"):
        density_splats(np.full((1, 8, 8), -1.0), rift.Grid((1, 8, 8)), 5, seed=0, dilation=0.1)


def densities_of(device, faded=10, count=60):
    values, densities = gaussians(count)
    densities[:faded] *= 1e-4
    raw = {
        "means": values["means"],
        "quats": values["quats"],
        "log_scales": np.log(values["scales"]),
        "logits": np.log(densities),
        "sh": np.ones((count, 1, 3)),
    }
    raw = {name: np.asarray(array, np.float32) for name, array in raw.items()}
    moments = {name: np.ones_like(array) for name, array in raw.items()}
    return Parameters.of(device, raw, first=moments, second=moments, step=100, density=True)


def moments_of(parameters):
    """Mass, mean and second moments of all splats together."""
    raw = {name: array.astype(float) for name, array in parameters.host()[0].items()}
    scales = np.exp(raw["log_scales"])
    masses = mass(scales, np.exp(raw["logits"]))
    means, spreads = raw["means"], covariances(raw["quats"], scales)
    second = spreads + means[:, :, None] * means[:, None]
    return masses.sum(), masses @ means, np.tensordot(masses, second, 1)


def test_halves_keep_mass_mean_and_spread(device):
    before = densities_of(device)
    after = relocate_densities(before, np.ones(60, np.float32), min_mass=MIN_MASS, seed=4)
    assert len(after) == 60 and after.density and after.step == 100
    for one, other in zip(moments_of(before), moments_of(after), strict=True):
        np.testing.assert_allclose(one, other, rtol=2e-3, atol=2e-3 * np.abs(one).max())
    old, new = before.host()[0]["means"], after.host()[0]["means"]
    moved = (old != new).any(axis=1)
    assert moved[:10].all() and moved.sum() == 20
    assert not after.host()[1]["means"][moved].any() and after.host()[1]["means"][~moved].all()


def test_splats_that_nothing_pulls_at_are_not_halved(device):
    before, pull = densities_of(device), np.zeros(60, np.float32)
    assert relocate_densities(before, pull, min_mass=MIN_MASS, seed=4) is before
    pull[30:33] = 1, 2, np.nan
    after = relocate_densities(before, pull, min_mass=MIN_MASS, seed=4)
    moved = (before.host()[0]["means"] != after.host()[0]["means"]).any(axis=1)
    assert np.flatnonzero(moved).tolist() == [0, 1, 30, 31]


def test_opacities_and_densities_are_not_taken_for_each_other(device):
    densities = densities_of(device)
    opacities = replace(densities, density=False)
    with pytest.raises(InputError, match="wanted opacities"):
        relocate(densities, min_opacity=0.05, most=60, seed=0, growth=0.0)
    with pytest.raises(InputError, match="wanted densities"):
        relocate_densities(opacities, np.ones(60), min_mass=MIN_MASS, seed=0)


def test_each_strategy_says_which_splats_it_is_for(device):
    densities, run = densities_of(device), TrainingRun(100, 60, 0, 1.0, 90)
    for settings in (McmcSettings(), DefaultSettings()):
        with pytest.raises(InputError, match="use 'xray'"):
            settings.begin(densities, run)
    with pytest.raises(InputError, match=r"'mcmc'.*'default'"):
        XraySettings().begin(replace(densities, density=False), run)
    assert not any(XraySettings().begin(densities, run).penalties(0))
