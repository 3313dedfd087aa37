"""Modes and optical depths as they are trained: Adam, ridge, what is held, orders that join."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from test_parameters import FREE, RATES, raw_values

from rift_cl.errors import InputError
from rift_cl.reference.training import activate, adam_step
from rift_cl.splat.orders import count_of
from rift_cl.train.parameters import GROUPS, MODES, MORE, Environment, Parameters

pytestmark = pytest.mark.dealt

MORE_RATES = RATES | {"shape_modes": 3e-3, "color_modes": 2e-3, "lobes": 1e-2}
MORE_RATES |= {"normals": 1e-3, "reflectance": 5e-2, "environment": 1e-2}
COUNT = 37


def with_modes(count=COUNT, shape=2, color=1, lobes=0, seed=0, lit=False):
    random = np.random.default_rng((seed, 1))
    raw = raw_values(count, 1, seed)
    more = {
        "shape_modes": random.normal(0, 0.3, (count, count_of(shape) - 1)),
        "color_modes": random.normal(0, 0.3, (count, count_of(color) - 1, 3)),
        "lobes": random.normal(size=(count, lobes)),
        "normals": random.normal(size=(count, 3 * lit)),
        "reflectance": random.normal(size=(count, 7 * lit)),
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


def test_modes_lobes_and_light_take_the_steps_of_the_twin(device):
    raw, random = with_modes(lobes=5, lit=True), np.random.default_rng(7)
    light = random.normal(size=(9, 3)).astype(np.float32)
    by_light = random.normal(size=(9, 3)).astype(np.float32)
    parameters = Parameters.of(device, raw, environment=Environment.of(device, light))
    lit = (light.astype(float), 0 * light, 0 * light)
    assert parameters.groups == (*GROUPS, *MORE)
    wanted = {n: (raw[n].astype(float), 0 * raw[n], 0 * raw[n]) for n in MORE}
    for step in range(1, 4):
        host, found = gradients_of(device, raw, step)
        found.environment = device.array(by_light)
        parameters.update(found, MORE_RATES, **FREE, ridge=0.5)
        lit = adam_step(*lit, by_light, rate=MORE_RATES["environment"], step=step)
        for name in MORE:
            by = host[name].astype(float)
            if name in MODES:
                by += 2 * 0.5 / COUNT * wanted[name][0]
            wanted[name] = adam_step(*wanted[name], by, rate=MORE_RATES[name], step=step)
    for found, part in zip(parameters.host(), range(3), strict=True):
        for name in MORE:
            np.testing.assert_allclose(found[name], wanted[name][part], rtol=2e-4, atol=2e-6)
            if part == 0:
                drawn = device.get(getattr(parameters.drawn, name))
                assert np.array_equal(drawn, found[name])
    for found, wanted_light in zip(parameters.environment.state(device).values(), lit, strict=True):
        np.testing.assert_allclose(found, wanted_light, rtol=2e-4, atol=2e-6)


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


def test_arrays_that_fit_no_order_are_refused(device):
    raw = raw_values(coefficients=1) | {"shape_modes": np.zeros((COUNT, 4), np.float32)}
    with pytest.raises(InputError, match="shape_modes"):
        Parameters.of(device, raw)
