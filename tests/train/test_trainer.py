"""Fitting: it learns, does the same twice, and keeps to its schedule."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from test_start import ring

from rift_cl.errors import InputError
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import GROUPS, Parameters
from rift_cl.train.schedules import LearningRateSchedule
from rift_cl.train.settings import LearningRates, TrainSettings
from rift_cl.train.start.points import hull_points, random_points, start_splats
from rift_cl.train.strategy import McmcSettings, Strategy, StrategySettings
from rift_cl.train.trainer import Trainer

pytestmark = pytest.mark.once

MIDDLE = np.array([0.3, -0.2, 0.1])
SETTINGS = TrainSettings(
    steps=120,
    splats=150,
    sh_degree=1,
    sh_every=1 / 3,
    seed=3,
    # The walk goes with the rate of positions.
    learning_rates=LearningRates(means=1.6e-4, quats=1e-3, log_scales=5e-3),
    strategy=McmcSettings(first=40, every=20, noise=5e5),
)


class Ball:
    """Pictures of a coloured ball of splats before grey."""

    def __init__(self, device):
        self.device, self.cameras, self.begun = device, ring(8), []
        random = np.random.default_rng(0)
        points = random.normal(size=(300, 3))
        points = MIDDLE + points / np.linalg.norm(points, axis=1, keepdims=True)
        raw = start_splats(points, 0.5 + 0.4 * np.sin(3 * points), seed=0)
        raw["logits"][:] = 3
        self.raw = raw
        scene = Parameters.of(device, raw).drawn
        renderer = Renderer(SplatSettings(), device=device)
        self.grey = device.array(np.full(3, 0.5, np.float32))
        self.images = [
            device.get(renderer.forward(scene, camera, background=self.grey).image)
            for camera in self.cameras
        ]

    def begin(self, step):
        self.begun.append(step)

    def target(self, number):
        return self.device.array(self.images[number])

    def weights(self, number):
        return None

    def background(self, number):
        return self.grey


def trainer_of(device, settings=SETTINGS):
    pictures = Ball(device)
    raw = start_splats(random_points(pictures.cameras, 100, 1), None, seed=1)
    return Trainer(pictures, Parameters.of(device, raw), settings)


def test_the_loss_falls_and_reports_say_so(device):
    trainer = trainer_of(device, replace(SETTINGS, steps=240))
    reports = list(trainer.run())
    losses = [report.values["loss"] for report in reports]
    assert reports[-1].done == reports[-1].total == 240
    assert losses[-1] < 0.85 * losses[0]
    assert 100 < len(trainer.parameters) <= 150
    assert trainer.parameters.raw["sh"].shape[1] == 4
    assert trainer.pictures.begun == list(range(240))


def test_two_runs_give_the_same_splats_bit_by_bit(device):
    found = []
    for _ in range(2):
        trainer = trainer_of(device)
        list(trainer.run())
        found.append(trainer.parameters.host())
    for first, second in zip(*found, strict=True):
        assert all(first[name].tobytes() == second[name].tobytes() for name in GROUPS)


@dataclass(frozen=True)
class Watching(StrategySettings):
    """Nothing changes; what is seen of the harmonics' gradient is kept."""

    wants: bool

    def begin(self, parameters, run):
        return Watcher(run, self.wants)


class Watcher(Strategy):
    def __init__(self, run, wants):
        super().__init__(run)
        self.wants_sh_gradient, self.seen = wants, []

    def after_step(self, parameters, frame, gradients, learning_rate):
        self.seen.append(None if gradients.sh is None else gradients.sh.shape)
        return parameters


def test_a_strategy_that_wants_the_harmonics_gradient_has_it_and_the_same_bits(device):
    found = []
    for wants in (False, True):
        trainer = trainer_of(device, replace(SETTINGS, strategy=Watching(wants)))
        for _ in range(3):
            trainer.step()
        assert trainer.strategy.seen == [(100, 1, 3) if wants else None] * 3
        found.append(trainer.parameters.host())
    for first, second in zip(*found, strict=True):
        assert all(first[name].tobytes() == second[name].tobytes() for name in GROUPS)


class Counter(Strategy):
    """Counts its steps in an attribute, which ``state`` holds if the class says so."""

    keeps = False

    def __init__(self, run):
        super().__init__(run)
        self.count, self.sizes, self.begun_with = 0, [], np.zeros(3)

    def after_step(self, parameters, frame, gradients, learning_rate):
        self.count += 1
        self.sizes.append((len(parameters), np.ones(2)))
        return parameters

    def state(self):
        return {"count": np.array(self.count)} if self.keeps else {}


class KeptCounter(Counter):
    keeps = True


@dataclass(frozen=True)
class Counts(StrategySettings):
    kind: type[Strategy] = Counter

    def begin(self, parameters, run):
        return self.kind(run)


def test_a_strategy_that_counts_and_keeps_no_count_is_warned_of_once(device):
    trainer = trainer_of(device, replace(SETTINGS, strategy=Counts()))
    trainer.state()
    trainer.step()
    with pytest.warns(UserWarning, match="Counter: count and sizes changed") as caught:
        trainer.state()
    assert len(caught) == 1
    trainer.state()


def test_a_strategy_that_keeps_its_count_is_not_warned_of(device):
    trainer = trainer_of(device, replace(SETTINGS, strategy=Counts(KeptCounter)))
    trainer.step()
    assert trainer.state()["strategy.count"] == 1


def test_every_picture_is_looked_at_once_before_any_is_again(device):
    trainer = trainer_of(device)
    order = [trainer.view_at(step) for step in range(24)]
    assert all(sorted(order[k : k + 8]) == list(range(8)) for k in (0, 8, 16))
    assert order[:8] != order[8:16]


def test_learning_rates_fall_and_fall_further_in_the_cooldown():
    rates = LearningRates(means=1e-3, means_last=0.01, shapes_last=0.5)
    settings = TrainSettings(steps=1000, cooldown=0.2, learning_rates=rates)
    schedule = LearningRateSchedule(settings, extent=2.0)
    assert schedule.cooldown == 800
    first, middle, last = (schedule.learning_rates(step) for step in (0, 800, 1000))
    assert first["means"] == pytest.approx(2 * 1e-3)
    assert middle["means"] == pytest.approx(0.01 * first["means"])
    assert middle["quats"] == pytest.approx(0.5 * first["quats"])
    assert middle["log_scales"] == pytest.approx(0.5 * first["log_scales"])
    assert middle["logits"] == first["logits"]
    for name in GROUPS:
        assert last[name] == pytest.approx(0.05 * middle[name]), name


@pytest.mark.parametrize(("steps", "views"), [(700, 7), (3000, 60), (3000, 250)])
def test_poses_reach_as_far_whatever_the_steps_and_views(steps, views):
    settings = TrainSettings(steps=steps, learning_rates=LearningRates(pose_reach=0.01))
    schedule = LearningRateSchedule(settings, extent=2.0, views=views)
    rates = [schedule.learning_rates(step)["poses"] for step in range(steps)]
    assert sum(rates) / views == pytest.approx(0.01)
    assert schedule.pose_reach == pytest.approx(0.01)
    assert rates[0] == 0 and rates[-1] < 0.01 * max(rates)


def test_poses_of_short_runs_are_not_thrown_about():
    schedule = LearningRateSchedule(TrainSettings(steps=20), extent=2.0, views=6)
    assert schedule.pose_reach < 0.01
    assert LearningRateSchedule(TrainSettings(steps=1), extent=2.0).pose_reach == 0


@pytest.mark.full
def test_the_hull_is_where_every_mask_agrees():
    cameras = ring(16)
    masks = []
    for camera in cameras:
        y, x = np.mgrid[: camera.height, : camera.width] + 0.5
        masks.append(np.hypot(x - 40, y - 30) < 12)
    points = hull_points(cameras, masks, 400, 2)
    away = np.linalg.norm(points - MIDDLE, axis=1)
    # A disc of 12 pixels at focal length 90, five away: a ball of radius 0.7 or a little more.
    assert points.shape == (400, 3) and away.max() < 1.0
    assert np.median(away) > 0.5
    assert hull_points(cameras, [np.zeros((60, 80), bool)] * 16, 400, 2) is None
    # What is hidden from a few cameras carves nothing: the hull is that of the others.
    hidden = [np.zeros((60, 80), bool)] * 4
    counted = [*hidden, *[None] * 12]
    some = hull_points(cameras, [*hidden, *masks[4:]], 400, 2, counted=counted)
    assert some.tobytes() != points.tobytes()
    assert np.linalg.norm(some - MIDDLE, axis=1).max() < 1.0
    assert hull_points(cameras, [*hidden, *masks[4:]], 400, 2) is None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"steps": 0}, "steps is 0"),
        ({"splats": 1.5}, "splats is 1.5"),
        ({"sh_degree": 5}, "sh_degree is 5"),
        ({"ssim_weight": 1.2}, "ssim_weight is 1.2"),
        ({"cooldown": float("nan")}, "cooldown is nan"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_settings_out_of_range_are_named(changes, words):
    with pytest.raises(InputError, match=words):
        TrainSettings(**changes)
