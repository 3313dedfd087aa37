"""Modes and optical depths as they are trained: Adam, ridge, what is held, copies and halves."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss
from test_parameters import FREE, RATES, raw_values

from rift_cl.basis.indices import graded
from rift_cl.errors import InputError
from rift_cl.reference.training import activate, adam_step
from rift_cl.splat.orders import count_of
from rift_cl.train.densify import densify
from rift_cl.train.parameters import GROUPS, MORE, Parameters
from rift_cl.train.quaternions import rotated
from rift_cl.train.renewal import renew, renew_densities
from rift_cl.train.settings import Densification, Renewal

MORE_RATES = RATES | {"shape_modes": 3e-3, "color_modes": 2e-3, "lobes": 1e-2}
COUNT = 37


def with_modes(count=COUNT, shape=2, color=1, lobes=0, seed=0):
    random = np.random.default_rng((seed, 1))
    raw = raw_values(count, 1, seed)
    more = {
        "shape_modes": random.normal(0, 0.3, (count, count_of(shape) - 1)),
        "color_modes": random.normal(0, 0.3, (count, count_of(color) - 1, 3)),
        "lobes": random.normal(size=(count, lobes)),
    }
    kept = {name: value for name, value in more.items() if value.shape[1]}
    return raw | {name: value.astype(np.float32) for name, value in kept.items()}


def gradients_of(device, raw, seed=1):
    """Random gradients by what is drawn of raw values: on the host, and as a renderer's."""
    random = np.random.default_rng(seed)
    host = {n: random.normal(size=v.shape).astype(np.float32) for n, v in raw.items()}
    names = {"log_scales": "scales", "logits": "opacities"}
    sent = {names.get(n, n): device.array(v) for n, v in host.items()}
    splats = SimpleNamespace(**{n: sent.pop(n) for n in ("means", "quats", "scales", "opacities")})
    return host, SimpleNamespace(splats=splats, **sent)


@pytest.mark.parametrize("band", [None, 0.1])
def test_optical_depths_and_their_gradient_are_the_twins(device, band):
    raw = raw_values(seed=3)
    raw["logits"][:4] = -60, 60, 200, 0
    lengths = None if band is None else np.full(COUNT, band, np.float32)
    parameters = Parameters.of(device, raw, amplitude=True, band=lengths)
    log_scales, logits = raw["log_scales"].astype(float), raw["logits"].astype(float)
    wide = 0.0 if band is None else band

    def drawn(scales, depths):
        return activate(scales, depths, band=wide, amplitude=True)

    scales, depths = drawn(log_scales, logits)
    np.testing.assert_allclose(device.get(parameters.drawn.scales), scales, rtol=1e-5)
    np.testing.assert_allclose(device.get(parameters.drawn.opacities), depths, rtol=1e-5)
    host, found = gradients_of(device, raw)
    parameters.update(found, RATES, **FREE | {"opacity_penalty": 2.0})
    first = parameters.host()[1]
    hidden = 1 / (1 + np.exp(-logits))
    step = 1e-6
    slope = (drawn(log_scales, logits + step)[1] - drawn(log_scales, logits - step)[1]) / (2 * step)
    by_logit = slope * host["logits"] + 2.0 / COUNT * hidden * (1 - hidden)
    np.testing.assert_allclose(first["logits"], 0.1 * by_logit, rtol=2e-4, atol=1e-6)
    for k in range(3):
        one = step * np.eye(3)[k]
        up, down = drawn(log_scales + one, logits), drawn(log_scales - one, logits)
        by = sum(
            ((a - b) / (2 * step) * g).reshape(COUNT, -1).sum(axis=1)
            for a, b, g in zip(up, down, (host["log_scales"], host["logits"]), strict=True)
        )
        np.testing.assert_allclose(first["log_scales"][:, k], 0.1 * by, rtol=2e-3, atol=2e-4)


def test_a_plain_peak_hides_what_its_logit_says(device):
    raw = raw_values()
    depths = device.get(Parameters.of(device, raw, amplitude=True).drawn.opacities).astype(float)
    hidden = device.get(Parameters.of(device, raw).drawn.opacities)
    np.testing.assert_allclose(1 - np.exp(-depths), hidden, rtol=1e-5, atol=1e-7)


def test_modes_and_lobes_take_the_steps_of_the_twin(device):
    raw = with_modes(lobes=5)
    parameters = Parameters.of(device, raw)
    assert parameters.groups == (*GROUPS, *MORE)
    wanted = {n: (raw[n].astype(float), 0 * raw[n], 0 * raw[n]) for n in MORE}
    for step in range(1, 4):
        host, found = gradients_of(device, raw, step)
        parameters.update(found, MORE_RATES, **FREE, ridge=0.5)
        for name in MORE:
            by = host[name].astype(float)
            if name != "lobes":
                by += 2 * 0.5 / COUNT * wanted[name][0]
            wanted[name] = adam_step(*wanted[name], by, rate=MORE_RATES[name], step=step)
    for found, part in zip(parameters.host(), range(3), strict=True):
        for name in MORE:
            np.testing.assert_allclose(found[name], wanted[name][part], rtol=2e-4, atol=2e-6)
            if part == 0:
                drawn = device.get(getattr(parameters.drawn, name))
                assert np.array_equal(drawn, found[name])


def test_a_ridge_alone_leads_to_zero(device):
    raw = with_modes()
    parameters = Parameters.of(device, raw)
    for _ in range(30):
        found = gradients_of(device, raw)[1]
        still = {n: device.zeros(v.shape) for n, v in vars(found.splats).items()}
        zero = {n: device.zeros(v.shape) for n, v in vars(found).items() if n != "splats"}
        still = SimpleNamespace(splats=SimpleNamespace(**still), **zero)
        parameters.update(still, MORE_RATES, **FREE, ridge=1e-3)
    after = parameters.host()[0]
    for name in ("shape_modes", "color_modes"):
        assert np.abs(after[name]).sum() < 0.8 * np.abs(raw[name]).sum()
    assert np.array_equal(after["sh"], raw["sh"])


def test_what_is_held_stays(device):
    raw = with_modes()
    parameters = Parameters.of(device, raw)
    free = (np.random.default_rng(0).random(raw["shape_modes"].shape) > 0.5).astype(np.float32)
    parameters.free = {"shape_modes": device.array(free)}
    for seed in range(3):
        parameters.update(gradients_of(device, raw, seed)[1], MORE_RATES, **FREE)
    moved = parameters.host()[0]["shape_modes"] != raw["shape_modes"]
    assert np.array_equal(moved, free > 0)


@pytest.mark.parametrize("name", ["shape_modes", "color_modes"])
def test_an_order_joins_with_zeros_and_moves_nothing_else(device, name):
    parameters = Parameters.of(device, raw_values(coefficients=1))
    for order in (1, 3):
        if name in parameters.raw:
            parameters.update(gradients_of(device, parameters.host()[0])[1], MORE_RATES, **FREE)
        before = parameters.host()
        parameters.widen(name, count_of(order) - 1)
        for old, new in zip(before, parameters.host(), strict=True):
            had = old[name].shape[1] if name in old else 0
            assert new[name].shape[:2] == (COUNT, count_of(order) - 1)
            assert had == 0 or np.array_equal(new[name][:, :had], old[name])
            assert not new[name][:, had:].any()
            assert all(np.array_equal(new[n], old[n]) for n in old if n != name)
        assert getattr(parameters.drawn, name).shape == parameters.raw[name].shape


def test_splats_that_share_a_place_have_the_depth_of_the_one_before(device):
    """Depths add up, so that a copy and its host show exactly what the host did."""
    raw = with_modes(60)
    raw["logits"] = np.linspace(-2, 6, 60).astype(np.float32)
    raw["logits"][:9] = -9
    before = Parameters.of(device, raw, step=600, amplitude=True)
    after = renew(before, Renewal(), most=60, seed=1, growth=0.0)
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
    after = renew_densities(before, Renewal(faint=0.05), np.ones(12, np.float32), seed=4)
    new = after.host()[0]
    assert (new["logits"] > -10).all()
    one, other = moments_of(raw, 3), moments_of(new, 3)
    np.testing.assert_allclose(other, one, atol=1e-4 * np.abs(one).max())
    # The fourth moments tell that they are halves.
    assert not np.allclose(moments_of(new, 4), moments_of(raw, 4), rtol=1e-4)


def test_clones_copy_modes_and_lobes(device):
    raw = with_modes(lobes=6)
    raw["log_scales"][:] = -6
    parameters = Parameters.of(device, raw, step=600)
    statistics = np.zeros((COUNT, 3), np.float32)
    statistics[:5, :2] = 1.0
    after = densify(
        parameters, statistics, Densification(), extent=1.0, most=100, seed=0, prune_large=False
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
        Parameters.of(device, raw, step=600), np.zeros((COUNT, 3), np.float32), Densification(),
        extent=1.0, most=100, seed=0, prune_large=False,
    )  # fmt: skip
    assert len(after) == COUNT - 1


def test_arrays_that_fit_no_order_are_refused(device):
    raw = raw_values(coefficients=1) | {"shape_modes": np.zeros((COUNT, 4), np.float32)}
    with pytest.raises(InputError, match="shape_modes"):
        Parameters.of(device, raw)
