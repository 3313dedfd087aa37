"""Fits with a light that splats share: from the first step on, resumed, relocated, and of use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_basis_joining import run_to, same
from test_trainer import SETTINGS, Ball

from rift_cl.errors import CheckpointError, InputError
from rift_cl.train.basis_settings import AngularSettings
from rift_cl.train.environment_settings import EnvironmentSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import LearningRates, TrainSettings
from rift_cl.train.start.normals import neighbour_normals
from rift_cl.train.start.points import random_points, start_splats
from rift_cl.train.strategy import DefaultSettings, McmcSettings
from rift_cl.train.trainer import Trainer

pytestmark = pytest.mark.once

STEPS = 24
SHARED = EnvironmentSettings("shared", lobes=16)
KINDS = {
    "mcmc": {"strategy": McmcSettings(first=10, every=10)},
    "default": {"strategy": DefaultSettings(every=10)},
    "lobes": {"angular": AngularSettings("sg", 2, first=0.2)},
}


def trainer_of(device, kind="mcmc", **more):
    pictures = Ball(device)
    raw = start_splats(random_points(pictures.cameras, 60, 1), None, seed=1)
    given = {"steps": STEPS, "splats": 80, "environment": SHARED} | KINDS[kind] | more
    return Trainer(pictures, Parameters.of(device, raw), replace(SETTINGS, **given))


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_a_fit_goes_on_from_any_state_to_the_same_bits(device, kind):
    whole = trainer_of(device, kind)
    run_to(whole, 12)
    state = whole.state()
    run_to(whole, STEPS)
    again = trainer_of(device, kind)
    again.restore(state)
    run_to(again, STEPS)
    assert same(whole.parameters.host(), again.parameters.host())
    first, second = (t.parameters.environment.state(device) for t in (whole, again))
    assert all(first[name].tobytes() == second[name].tobytes() for name in first)
    assert all(np.isfinite(array).all() for array in whole.parameters.host()[0].values())


def test_light_is_there_from_the_first_step_and_moves(device):
    trainer = trainer_of(device)
    before = device.get(trainer.parameters.environment.raw)
    reflectance = device.get(trainer.parameters.raw["reflectance"])
    assert before.shape == (16, 3) and (before == before[0, 0]).all()
    trainer.step()
    assert (device.get(trainer.parameters.environment.raw) != before).any()
    assert (device.get(trainer.parameters.raw["reflectance"]) != reflectance).any()


def test_a_checkpoint_without_a_light_is_of_another_run(device):
    plain = trainer_of(device, environment=EnvironmentSettings())
    with pytest.raises(CheckpointError):
        trainer_of(device).restore(plain.state())
    with pytest.raises(CheckpointError):
        plain.restore(trainer_of(device).state())
    state = trainer_of(device).state()
    for name in ("environment.first", "raw.normals", "raw.reflectance"):
        with pytest.raises(CheckpointError, match=name):
            trainer_of(device).restore({n: a for n, a in state.items() if n != name})
    with pytest.raises(CheckpointError, match="environment"):
        trainer_of(device).restore(state | {"environment.second": np.zeros((15, 3), np.float32)})


def test_splats_in_a_new_place_have_the_normals_and_reflectance_of_their_host(device):
    trainer = trainer_of(device)
    raw, first, second = trainer.parameters.host()
    raw["reflectance"][:] = np.arange(7 * len(raw["means"])).reshape(-1, 7)
    raw["logits"][:5] = -9
    trainer.parameters = trainer.parameters.replaced(raw, first, second)
    run_to(trainer, 10)
    new = trainer.parameters.host()[0]
    assert len(new["normals"]) == len(new["reflectance"]) == len(new["means"])
    # Seven numbers of one host, a few steps later.
    hosts = np.round(new["reflectance"] - np.arange(7)).mean(axis=1) / 7
    np.testing.assert_allclose(hosts, np.round(hosts), atol=0.15)
    assert trainer.parameters.environment is not None


def test_normals_of_a_sphere_point_outward_whatever_is_behind_it():
    random = np.random.default_rng(4)
    means = random.normal(size=(2000, 3))
    means /= np.linalg.norm(means, axis=1, keepdims=True)
    # Transparent splats inside count for nothing.
    inner = 0.9 * random.uniform(-0.6, 0.6, (500, 3))
    logits = np.concatenate([np.full(2000, 2.0), np.full(500, -20.0)])
    raw = {"means": np.concatenate([means, inner]).astype(np.float32), "logits": logits}
    normals = neighbour_normals(raw)[:2000]
    agree = (normals * means).sum(axis=1)
    assert np.median(agree) > 0.995 and agree.min() > 0.8


def test_normals_are_the_same_in_runs_of_any_length(monkeypatch):
    random = np.random.default_rng(5)
    raw = {
        "means": random.normal(size=(90, 3)).astype(np.float32),
        "logits": random.normal(size=90).astype(np.float32),
    }
    whole = neighbour_normals(raw)
    monkeypatch.setattr("rift_cl.train.start.normals._RUN", 7)
    np.testing.assert_allclose(neighbour_normals(raw), whole, atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_splats_have_normals_as_well(count):
    means = np.zeros((count, 3), np.float32)
    if count > 2:
        means[2] = np.nan
    normals = neighbour_normals({"means": means, "logits": np.zeros(count, np.float32)})
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), np.ones(count))


@pytest.mark.full
def test_a_light_that_nothing_reflects_is_no_harm(device):
    """A ball without a gloss is fitted as well as without a light."""
    losses = []
    for environment in (EnvironmentSettings(), replace(SHARED, own_degree=1)):
        trainer = trainer_of(device, steps=120, environment=environment)
        values = [device.get(trainer.step())[0] for _ in range(120)]
        losses.append(np.mean(values[-20:]))
    assert losses[1] < 1.15 * losses[0]


def test_settings_say_how_many_numbers_there_are_and_which_degrees_join():
    settings = TrainSettings(environment=EnvironmentSettings("shared"))
    assert settings.numbers == 11 + 3 * 4 + 3 + 7 and len(settings.degree_joins) == 1
    own = TrainSettings(environment=EnvironmentSettings("shared", own_degree=3))
    assert own.degree_joins == TrainSettings().degree_joins
    assert TrainSettings(environment=EnvironmentSettings(own_degree=2)).degree == 3


@pytest.mark.parametrize(
    "given, words",
    [
        ({"kind": "both"}, "kind"),
        ({"lobes": 7}, "lobes"),
        ({"lobes": 5000}, "lobes"),
        ({"own_degree": 5}, "own_degree"),
    ],
)
def test_settings_out_of_range_are_refused(given, words):
    with pytest.raises(InputError, match=words):
        EnvironmentSettings(**given)


def test_rates_of_a_light_may_be_none():
    rates = LearningRates(environment=0, reflectance=0, normals=0)
    assert rates.environment == 0
