"""A fit that solves for its densities: what moves when, and that it goes on to the same bits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from density_scenes import DRAWING, SIZE, pictures_of, scene

from rift_cl.basis.indices import graded
from rift_cl.train.basis_settings import BasisSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start.points import start_splats
from rift_cl.train.strategy import XraySettings
from rift_cl.train.xray.settings import XrayTrainSettings
from rift_cl.train.xray.solve_settings import SolveSettings
from rift_cl.train.xray.trainer import XrayTrainer, volume_extent

pytestmark = pytest.mark.once

STEPS = 24


def trainer_of(device, pictures, *, rows, every=5, first=4):
    random = np.random.default_rng(2)
    means = random.uniform(-8, 8, (30, 3)) * (1, 1, rows > 1)
    raw = start_splats(means, np.ones((30, 3)), seed=1)
    raw["logits"] -= 2
    settings = XrayTrainSettings(
        steps=STEPS,
        seed=4,
        splats=30,
        basis=BasisSettings("hermite", 2, first=0.2, every=0.2),
        solve=SolveSettings(every, views=4),
    )
    # Relocated between solves and just before one.
    strategy = XraySettings(first=first, every=6, min_mass=0.5)
    return XrayTrainer(
        pictures,
        Parameters.of(device, raw, density=True),
        replace(settings, strategy=strategy),
        DRAWING,
        flat=rows == 1,
        extent=volume_extent(SIZE / 2),
    )


def run_to(trainer, step):
    while trainer.parameters.step < step:
        trainer.step()


@pytest.mark.full
@pytest.mark.parametrize("rows", [1, SIZE])
def test_a_fit_goes_on_from_any_state_to_the_same_bits(device, rows):
    pictures = pictures_of(device, scene(0, flat=rows == 1), rows=rows)
    whole, states = trainer_of(device, pictures, rows=rows), []
    for step in (5, 17):
        run_to(whole, step)
        states.append(whole.state())
    run_to(whole, STEPS)
    for state in states:
        again = trainer_of(device, pictures, rows=rows)
        again.restore(state)
        run_to(again, STEPS)
        for one, other in zip(whole.parameters.host(), again.parameters.host(), strict=True):
            assert all(one[name].tobytes() == other[name].tobytes() for name in one)
    raw = whole.parameters.host()[0]
    assert all(np.isfinite(array).all() for array in raw.values())
    modes, across = raw["shape_modes"], graded(2, 3)[1:, 2] > 0
    assert modes[:, ~across].any() and modes[:, across].any() == (rows > 1)


@pytest.mark.full
def test_between_solves_densities_stay_and_the_last_one_ends_the_fit(device):
    pictures = pictures_of(device, scene(0))
    trainer = trainer_of(device, pictures, rows=SIZE, every=10, first=STEPS)

    def densities():
        return trainer.parameters.host()[0]["logits"].copy()

    found = {0: densities()}
    for step in range(1, STEPS + 1):
        trainer.step()
        found[step] = densities()
    changed = [step for step in range(1, STEPS + 1) if (found[step] != found[step - 1]).any()]
    # Before the steps 0, 10, 20 and after the last.
    assert changed == [1, 11, 21, STEPS]


@pytest.mark.full
def test_solves_serve_short_fits(device):
    pictures, losses = pictures_of(device, scene(1), views=9), []
    for every in (0, 6):
        trainer = trainer_of(device, pictures, rows=SIZE, every=every)
        run_to(trainer, STEPS)
        images = [trainer.renderer.forward(trainer.parameters.drawn, k) for k in pictures.cameras]
        drawn = np.stack([device.get(frame.image)[..., 0] for frame in images])
        losses.append(np.square(drawn - pictures.projections.values).mean())
    assert losses[1] < 0.5 * losses[0]


def test_settings_say_what_moves():
    assert XrayTrainSettings().decided(9).learning_rates.logits > 0
    rates = XrayTrainSettings(solve=SolveSettings(3)).decided(9).learning_rates
    assert rates.logits == rates.shape_modes == 0 < rates.means
    assert TrainSettings().solve == SolveSettings(0)
