"""Strategies: when they do what, and that a run that was taken up again is the same run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_trainer import Ball

from rift_cl.errors import CheckpointError, InputError
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.loss.image_loss import ImageLoss
from rift_cl.train.parameters import GROUPS, Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start.points import random_points, scene_extent, start_splats
from rift_cl.train.strategy import (
    DefaultSettings,
    DefaultStrategy,
    McmcSettings,
    ResidualSettings,
    TrainingRun,
)

pytestmark = pytest.mark.once

RATES = {"means": 1e-3, "quats": 1e-3, "log_scales": 5e-3, "logits": 5e-2, "sh": 2.5e-3}
MCMC = TrainSettings(
    steps=40, splats=90, cooldown=0.25, strategy=McmcSettings(first=10, every=5, noise=5e5)
)
RESIDUAL = TrainSettings(
    steps=40, splats=90, cooldown=0.25, strategy=ResidualSettings(first=10, every=5, views=3)
)
# The scene is as large as its extent and its splats are few, so that size prunes none.
HOW = DefaultSettings(
    every=5, first=0.2, last=0.8, reset=0.1, min_reset=12, grow_gradient=3e-5, prune_scale=1
)
DEFAULT = TrainSettings(steps=40, splats=300, strategy=HOW)
ABSGRAD = replace(DEFAULT, strategy=replace(HOW, absgrad=True, grow_gradient=1e-4))


@pytest.fixture
def ball(device):
    return Ball(device)


def begun(ball, settings):
    """Parameters and strategy at the beginning of a run."""
    raw = start_splats(random_points(ball.cameras, 60, 1), None, seed=1)
    raw["logits"][::9] = -7
    return with_strategy(ball, settings, Parameters.of(ball.device, raw))


def with_strategy(ball, settings, parameters):
    cooldown = round(settings.steps * (1 - settings.cooldown))
    extent = scene_extent(ball.cameras)
    run = TrainingRun(settings.steps, settings.splats, settings.seed, extent, cooldown)
    return parameters, settings.strategy.begin(parameters, run)


def run(ball, parameters, strategy, steps):
    """A trainer's loop; the parameters, and how many splats there were after each step."""
    device, sizes = ball.device, []
    renderer = Renderer(strategy.render_settings(SplatSettings()), device=device)
    for step in range(parameters.step, parameters.step + steps):
        number = step % len(ball.cameras)
        frame = renderer.forward(
            parameters.drawn, ball.cameras[number], background=ball.background(number)
        )
        target = ball.target(number)
        by_image = ImageLoss(ssim_weight=0)(device, frame.image, target)[1]
        if strategy.looks_at(step):
            strategy.look(frame, frame.image, target, None)
        gradients = renderer.backward(frame, by_image)
        penalties = strategy.penalties(step)
        parameters.update(
            gradients,
            RATES,
            sh_rest=0.2,
            opacity_penalty=penalties.opacity,
            scale_penalty=penalties.scale,
        )
        parameters = strategy.after_step(parameters, frame, gradients, RATES["means"])
        sizes.append(len(parameters))
    return parameters, sizes


@pytest.mark.full
@pytest.mark.parametrize(
    "settings",
    [RESIDUAL, MCMC, DEFAULT, ABSGRAD],
    ids=["residual", "mcmc", "default", "absgrad"],
)
def test_a_run_taken_up_in_the_middle_is_the_same_run(ball, settings):
    straight, sizes = run(ball, *begun(ball, settings), 30)
    first, strategy = begun(ball, settings)
    first, _ = run(ball, first, strategy, 17)
    # What a checkpoint holds: host arrays alone.
    raw, m, v = first.host()
    kept = {name: np.array(array) for name, array in strategy.state().items()}
    again = Parameters.of(ball.device, raw, first=m, second=v, step=17)
    # A trainer is made for the splats that a run begins with, and restored later.
    strategy = begun(ball, settings)[1]
    strategy.restore(kept)
    again, rest = run(ball, again, strategy, 13)
    assert sizes[17:] == rest and sizes[-1] > 60
    for one, other in zip(straight.host(), again.host(), strict=True):
        assert all(one[name].tobytes() == other[name].tobytes() for name in GROUPS)


def test_a_short_run_gets_all_its_splats_by_its_middle(ball):
    _, sizes = run(ball, *begun(ball, replace(MCMC, splats=200)), 30)
    assert sizes[8] == 60 and 60 < sizes[9] < sizes[14] < 200
    assert sizes[19] == 200 == sizes[-1]
    still = replace(MCMC, splats=200, strategy=replace(MCMC.strategy, growth=0))
    assert run(ball, *begun(ball, still), 30)[1] == [60] * 30


def test_without_the_statistics_it_would_be_another_run(ball):
    straight, _ = run(ball, *begun(ball, DEFAULT), 22)
    first, strategy = begun(ball, DEFAULT)
    first, _ = run(ball, first, strategy, 17)
    raw, m, v = first.host()
    again = Parameters.of(ball.device, raw, first=m, second=v, step=17)
    again, _ = run(ball, *with_strategy(ball, DEFAULT, again), 5)
    assert not all(
        np.array_equal(straight.host()[0][name], again.host()[0][name]) for name in GROUPS
    )


def test_the_set_changes_within_its_part_of_the_run_alone(ball):
    parameters, strategy = begun(ball, DEFAULT)
    _, sizes = run(ball, parameters, strategy, 40)
    changed = [k + 1 for k, (a, b) in enumerate(zip([60, *sizes], sizes, strict=False)) if a != b]
    # Later than 0.2 of 40 steps, before 0.8 of them, every fifth.
    assert set(changed) <= {10, 15, 20, 25, 30} and changed[0] == 10
    assert max(sizes) <= 300 and sizes[-1] > 60


def test_opacities_are_reset_and_come_back(ball):
    parameters, strategy = begun(ball, DEFAULT)
    brightest = []
    for _ in range(26):
        parameters, _ = run(ball, parameters, strategy, 1)
        brightest.append(float(ball.device.get(parameters.drawn.opacities).max()))
    resets = [k + 1 for k, value in enumerate(brightest) if value < 0.0101]
    assert resets == [12, 24] and brightest[-1] > 0.0105


@pytest.mark.parametrize(
    ("steps", "how", "wanted"),
    [
        (30_000, DefaultSettings(), 3000),
        (2000, DefaultSettings(min_reset=700), 700),
        (2000, DefaultSettings(reset=0.0), 0),
    ],
)
def test_resets_scale_with_the_run_but_leave_time_to_come_back(ball, steps, how, wanted):
    settings = TrainSettings(steps=steps, strategy=how)
    strategy = begun(ball, settings)[1]
    assert isinstance(strategy, DefaultStrategy) and strategy.reset_every == wanted


def test_penalties_end_with_the_cooldown_and_densification_has_none(ball):
    chain, densify = begun(ball, MCMC)[1], begun(ball, DEFAULT)[1]
    assert chain.penalties(29) == (0.01, 0.05)
    assert chain.penalties(30) == (0, 0)
    assert all(densify.penalties(step) == (0, 0) for step in (0, 29, 39))


def test_densification_shakes_nothing(ball):
    parameters, strategy = begun(ball, DEFAULT)
    renderer = Renderer(device=ball.device)
    frame = renderer.forward(parameters.drawn, ball.cameras[0])
    gradients = renderer.backward(frame, ball.device.zeros(frame.image.shape))
    before = parameters.host()[0]["means"]
    parameters.step = 1
    after = strategy.after_step(parameters, frame, gradients, 1.0)
    assert after is parameters and np.array_equal(after.host()[0]["means"], before)
    assert strategy.state()["statistics"][:, 1].any()


def test_only_absgrad_asks_for_another_drawing(ball):
    plain, magnitudes = SplatSettings(eps2d=0.1), SplatSettings(eps2d=0.1, absgrad=True)
    for settings, wanted in ((MCMC, plain), (DEFAULT, plain), (ABSGRAD, magnitudes)):
        strategy = begun(ball, settings)[1]
        assert strategy.render_settings(plain) == wanted
        assert strategy.render_settings(magnitudes) == magnitudes


def test_statistics_of_other_splats_are_found_at_the_next_step(ball):
    parameters, strategy = begun(ball, DEFAULT)
    strategy.restore({"statistics": np.zeros((59, 3))})
    with pytest.raises(InputError, match=r"60 splats.*59"):
        run(ball, parameters, strategy, 1)


def test_densities_are_not_densified(ball):
    raw = start_splats(random_points(ball.cameras, 60, 1), None, seed=1)
    densities = Parameters.of(ball.device, raw, density=True)
    with pytest.raises(InputError, match="opacities"):
        with_strategy(ball, DEFAULT, densities)


@pytest.mark.parametrize(
    ("settings", "state", "words"),
    [
        (MCMC, {"statistics": np.zeros((60, 3))}, "holds statistics"),
        (DEFAULT, {}, "holds nothing"),
        (DEFAULT, {"statistics": np.zeros((60, 2))}, "shape"),
        (DEFAULT, {"statistics": np.full((60, 3), np.nan)}, "not finite"),
    ],
)
def test_a_state_of_another_run_is_refused(ball, settings, state, words):
    with pytest.raises(CheckpointError, match=words):
        begun(ball, settings)[1].restore(state)
