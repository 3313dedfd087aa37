"""A step of Adam, activations and random walks: the twins' numbers, on every driver."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl.reference.training import activate, adam_step, noise, surface_loss
from rift_cl.train.parameters import GROUPS, Parameters
from rift_cl.train.surface_settings import SurfacePenalties

pytestmark = pytest.mark.dealt

RATES = {"means": 1e-3, "quats": 2e-3, "log_scales": 5e-3, "logits": 5e-2, "sh": 2.5e-3}
FREE = {"sh_rest": 0.2, "opacity_penalty": 0.0, "scale_penalty": 0.0}


def raw_values(count=37, coefficients=4, seed=0):
    random = np.random.default_rng(seed)
    values = {
        "means": random.normal(size=(count, 3)),
        "quats": random.normal(size=(count, 4)),
        "log_scales": random.normal(-3, 1, (count, 3)),
        "logits": random.normal(0, 2, count),
        "sh": random.normal(size=(count, coefficients, 3)),
    }
    return {name: value.astype(np.float32) for name, value in values.items()}


def gradients(device, count=37, coefficients=4, seed=1):
    """Gradients by what is drawn: on the host by name, and as the renderer gives them."""
    random = np.random.default_rng(seed)
    shapes = {
        "means": (3,),
        "quats": (4,),
        "scales": (3,),
        "opacities": (),
        "sh": (coefficients, 3),
    }
    host = {n: random.normal(size=(count, *s)).astype(np.float32) for n, s in shapes.items()}
    sent = {name: device.array(value) for name, value in host.items()}
    return host, SimpleNamespace(splats=SimpleNamespace(**sent), sh=sent["sh"])


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_steps_of_adam_are_the_twins(device, coefficients):
    raw = raw_values(coefficients=coefficients)
    parameters = Parameters.of(device, raw)
    wanted = {
        n: (v.astype(float), 0 * v.astype(float), 0 * v.astype(float)) for n, v in raw.items()
    }
    for step in range(1, 6):
        host, found = gradients(device, coefficients=coefficients, seed=step)
        scales, opacities = activate(wanted["log_scales"][0], wanted["logits"][0])
        by = {
            "means": host["means"], "quats": host["quats"], "sh": host["sh"],
            "log_scales": host["scales"] * scales,
            "logits": host["opacities"] * opacities * (1 - opacities),
        }  # fmt: skip
        parameters.update(found, RATES, **FREE)
        for name in GROUPS:
            rate = RATES[name]
            if name == "sh":
                rate = RATES[name] * np.where(np.arange(coefficients) > 0, 0.2, 1.0)[:, None]
            wanted[name] = adam_step(*wanted[name], by[name].astype(float), rate=rate, step=step)
    raw, first, second = parameters.host()
    for name in GROUPS:
        np.testing.assert_allclose(raw[name], wanted[name][0], rtol=2e-4, atol=2e-5, err_msg=name)
        np.testing.assert_allclose(first[name], wanted[name][1], rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(second[name], wanted[name][2], rtol=1e-4, atol=1e-6)
    assert parameters.step == 5


def test_what_is_drawn_follows_what_is_trained(device):
    parameters = Parameters.of(device, raw_values())
    parameters.update(gradients(device)[1], RATES, **FREE)
    raw = parameters.host()[0]
    scales, opacities = activate(raw["log_scales"].astype(float), raw["logits"].astype(float))
    drawn = parameters.drawn
    np.testing.assert_allclose(device.get(drawn.scales), scales, rtol=1e-5)
    np.testing.assert_allclose(device.get(drawn.opacities), opacities, rtol=1e-5)
    assert np.array_equal(device.get(drawn.means), raw["means"])
    assert np.array_equal(device.get(drawn.sh), raw["sh"])


def test_penalties_are_those_of_the_means(device):
    parameters = Parameters.of(device, raw_values())
    options = FREE | {"opacity_penalty": 0.3, "scale_penalty": 0.7}
    scales, opacities = (device.get(getattr(parameters.drawn, n)) for n in ("scales", "opacities"))
    parameters.update(still(device), RATES, **options)
    _, first, _ = parameters.host()
    count = len(parameters)
    by_logit = 0.3 / count * opacities * (1 - opacities)
    np.testing.assert_allclose(first["logits"], 0.1 * by_logit, rtol=1e-4)
    np.testing.assert_allclose(first["log_scales"], 0.1 * 0.7 / (3 * count) * scales, rtol=1e-4)
    assert not first["means"].any()


@pytest.mark.parametrize("amplitude", [False, True])
def test_priors_for_surfaces_are_the_gradient_of_the_twins(device, amplitude):
    raw = raw_values()
    sheet = np.random.default_rng(5).normal(size=(37, 3))
    sheet /= np.linalg.norm(sheet, axis=1, keepdims=True)
    weights = SurfacePenalties(0.7, 0.3, 0.5)
    parameters = Parameters.of(device, raw, amplitude=amplitude, sheet=sheet.astype(np.float32))
    found = still(device)
    parameters.update(found, RATES, **FREE, surface=weights)
    first = parameters.host()[1]
    at = {name: raw[name].astype(float) for name in ("quats", "log_scales", "logits")}
    for name, values in at.items():
        wanted = differences(
            lambda x, n=name: surface_loss(**at | {n: x}, normals=sheet, weights=weights), values
        )
        np.testing.assert_allclose(first[name], 0.1 * wanted, rtol=2e-3, atol=2e-7, err_msg=name)
        assert np.abs(wanted).max() > 1e-4
    assert not device.get(found.splats.quats).any()


def test_turns_have_a_prior_where_there_are_sheets_alone(device):
    moved = []
    for sheet in (None, np.tile(np.float32([0, 0, 1]), (37, 1))):
        parameters = Parameters.of(device, raw_values(), sheet=sheet)
        surface = SurfacePenalties(normal_consistency=0.5)
        parameters.update(still(device), RATES, **FREE, surface=surface)
        moved.append(parameters.host()[1]["quats"].any())
    assert moved == [False, True]


def test_turns_that_are_none_have_no_prior(device):
    raw = raw_values()
    raw["quats"][3], raw["quats"][5] = 0, 1e25
    parameters = Parameters.of(device, raw, sheet=np.tile(np.float32([0, 0, 1]), (37, 1)))
    parameters.update(still(device), RATES, **FREE, surface=SurfacePenalties(0.0, 0.0, 0.5))
    found = parameters.host()[0]["quats"]
    np.testing.assert_array_equal(found[[3, 5]], raw["quats"][[3, 5]])
    assert np.isfinite(found).all()


def still(device):
    """A loss that nothing changes, so that what moves are penalties."""
    by = vars(gradients(device)[1].splats)
    zero = {name: device.zeros(array.shape) for name, array in by.items()}
    return SimpleNamespace(splats=SimpleNamespace(**zero), sh=zero["sh"])


def differences(loss, at, step=1e-5):
    """The gradient of a function of an array, by central differences."""
    found = np.empty(at.shape)
    for place in np.ndindex(at.shape):
        aside = np.zeros(at.shape)
        aside[place] = step
        found[place] = (loss(at + aside) - loss(at - aside)) / (2 * step)
    return found


def test_random_walks_are_the_twins(device):
    raw = raw_values(500)
    raw["logits"] = np.linspace(-8, -2, 500).astype(np.float32)
    parameters = Parameters.of(device, raw, step=7)
    scales, opacities = activate(raw["log_scales"].astype(float), raw["logits"].astype(float))
    wanted = noise(raw["quats"].astype(float), scales, opacities, amount=3.0, seed=5, step=7)
    parameters.shake(3.0, 5)
    moved = device.get(parameters.drawn.means) - raw["means"].astype(float)
    np.testing.assert_allclose(moved, wanted, rtol=1e-3, atol=2e-6)
    spread = np.abs(wanted).mean(axis=1)
    assert spread[:100].mean() > 2 * spread[-100:].mean()


def test_random_walks_have_the_covariance_of_the_splat(device):
    """Many splats alike: their moves spread by Sigma^2, and on average stay where they are."""
    count = 40_000
    one = raw_values(1)
    raw = {name: np.repeat(value, count, axis=0) for name, value in one.items()}
    raw["means"] = np.zeros((count, 3), np.float32)
    raw["logits"][:] = -20
    parameters = Parameters.of(device, raw)
    parameters.shake(1.0, 3)
    moves = device.get(parameters.drawn.means).astype(float)
    from rift_cl.reference.splat_projection import covariances

    scales = np.exp(one["log_scales"].astype(float))
    covar = covariances(one["quats"].astype(float), scales)[0]
    gate = 1 / (1 + np.exp(-0.5))
    wanted = gate**2 * covar @ covar
    found = moves.T @ moves / count
    assert np.linalg.norm(found - wanted) < 0.03 * np.linalg.norm(wanted)
    assert np.abs(moves.mean(axis=0)).max() < 0.02 * np.sqrt(np.trace(wanted))


def test_another_degree_changes_no_colour(device):
    parameters = Parameters.of(device, raw_values(coefficients=4))
    parameters.update(gradients(device)[1], RATES, **FREE)
    before = parameters.host()
    parameters.add_degree()
    for old, new in zip(before, parameters.host(), strict=True):
        assert new["sh"].shape == (37, 9, 3)
        assert np.array_equal(new["sh"][:, :4], old["sh"]) and not new["sh"][:, 4:].any()
        assert all(np.array_equal(new[name], old[name]) for name in GROUPS[:-1])
    assert parameters.drawn.sh.shape == (37, 9, 3)


def test_two_runs_give_the_same_bits(device):
    runs = []
    for _ in range(2):
        parameters = Parameters.of(device, raw_values(5000, 16))
        for step in range(3):
            parameters.update(gradients(device, 5000, 16, seed=step)[1], RATES, **FREE)
            parameters.shake(0.1, 9)
        runs.append(parameters.host())
    for first, second in zip(*runs, strict=True):
        assert all(first[name].tobytes() == second[name].tobytes() for name in GROUPS)


def test_extreme_values_stay_drawable(device):
    raw = raw_values(4)
    raw["log_scales"][:] = [[-1e3, 1e3, 0], [90, -90, 0], [0, 0, 0], [30, -30, 1]]
    raw["logits"][:] = [-1e4, 1e4, -200, 200]
    drawn = Parameters.of(device, raw).drawn
    assert np.isfinite(device.get(drawn.scales)).all() and (device.get(drawn.scales) > 0).all()
    opacities = device.get(drawn.opacities)
    assert ((opacities >= 0) & (opacities <= 1)).all()


@pytest.mark.parametrize("count", [1, 7, 65])
def test_numbers_that_are_none_are_their_own_splats_alone(device, count):
    """Activated, updated and moved: what is no number stays so, and spoils no other splat."""
    raw = raw_values(count)
    bad = {name: value.copy() for name, value in raw.items()}
    bad["log_scales"][-1, 1] = bad["logits"][-1] = np.nan
    found = []
    for values in (raw, bad):
        parameters = Parameters.of(device, values)
        parameters.update(gradients(device, count)[1], RATES, **FREE)
        parameters.shake(0.1, 9)
        drawn = parameters.drawn
        found.append([device.get(a) for a in (drawn.scales, drawn.opacities, drawn.means)])
    for right, spoilt in zip(*found, strict=True):
        assert right[:-1].tobytes() == spoilt[:-1].tobytes() and np.isfinite(right).all()
    assert np.isnan(found[1][0][-1, 1]) and np.isnan(found[1][1][-1])
