"""Fits with priors for surfaces: what they do, when they begin, and how they go on when resumed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_basis_joining import run_to, same
from test_trainer import SETTINGS, Ball

from rift_cl.errors import CheckpointError
from rift_cl.train.parameters import Parameters
from rift_cl.train.start.points import random_points, start_splats
from rift_cl.train.strategy import McmcSettings
from rift_cl.train.surface_settings import SurfacePenalties, SurfaceSettings
from rift_cl.train.trainer import Trainer

pytestmark = pytest.mark.once

STEPS = 24
ALL = SurfaceSettings(flatness=0.1, opacity_entropy=0.1, normal_consistency=0.1, first=0.25)


def trainer_of(device, surface=ALL):
    pictures = Ball(device)
    raw = start_splats(random_points(pictures.cameras, 60, 1), None, seed=1)
    strategy = McmcSettings(first=10, every=10)
    given = {"steps": STEPS, "splats": 80, "strategy": strategy, "surface": surface}
    return Trainer(pictures, Parameters.of(device, raw), replace(SETTINGS, **given))


def test_a_fit_goes_on_from_any_state_to_the_same_bits(device):
    whole = trainer_of(device)
    run_to(whole, 12)
    state = whole.state()
    assert state["sheet.normals"].shape == (len(whole.parameters), 3)
    run_to(whole, STEPS)
    again = trainer_of(device)
    again.restore(state)
    run_to(again, STEPS)
    assert same(whole.parameters.host(), again.parameters.host())


def test_priors_begin_with_their_share_of_the_steps(device):
    plain, ours = trainer_of(device, SurfaceSettings()), trainer_of(device)
    for trainer in (plain, ours):
        run_to(trainer, 6)
    assert same(plain.parameters.host(), ours.parameters.host())
    for trainer in (plain, ours):
        run_to(trainer, 7)
    assert not same(plain.parameters.host(), ours.parameters.host())


def test_priors_end_with_the_cooldown(device):
    trainer = trainer_of(device)
    end = trainer.schedule.cooldown
    assert STEPS * ALL.first < end < STEPS
    weights = [trainer._surface_penalties(step) for step in (5, 6, end - 1, end)]
    priors = (0.1 / trainer.size, 0.1, 0.1)
    assert weights == [SurfacePenalties(), priors, priors, SurfacePenalties()]
    assert ALL.wanted and not SETTINGS.surface.wanted


@pytest.mark.parametrize("name", SurfacePenalties._fields)
def test_each_prior_does_what_it_says(device, name):
    """Of a loss that is nothing but the prior, each makes its own measure smaller."""
    before, after = (
        measures(fitted(device, SurfaceSettings(**{name: weight}, first=0)))[name]
        for weight in (0.0, 1e3)
    )
    assert after < before


def fitted(device, surface):
    trainer = trainer_of(device, surface)
    run_to(trainer, STEPS)
    return trainer.parameters


def measures(parameters):
    """The smallest scales, the opacities' distances from 0 and 1, angles to the sheets."""
    from rift_cl.reference.training import surface_loss
    from rift_cl.train.start.normals import neighbour_normals

    raw = {name: array.astype(float) for name, array in parameters.host()[0].items()}
    given = raw["quats"], raw["log_scales"], raw["logits"], neighbour_normals(raw)
    return {
        name: surface_loss(*given, weights)
        for name, weights in zip(SurfacePenalties._fields, np.eye(3), strict=True)
    }


def test_a_checkpoint_of_another_prior_is_refused(device):
    plain, ours = trainer_of(device, SurfaceSettings()), trainer_of(device)
    run_to(plain, 12)
    run_to(ours, 12)
    with pytest.raises(CheckpointError):
        plain.restore(ours.state())
    with pytest.raises(CheckpointError):
        ours.restore(plain.state())
    with pytest.raises(CheckpointError, match=r"sheet\.normals"):
        ours.restore(ours.state() | {"sheet.normals": np.zeros((3, 3), np.float32)})
