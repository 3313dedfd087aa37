"""Fits in which modes and lobes join: when they do, and that they can be resumed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_trainer import SETTINGS, Ball

from rift_cl.errors import CheckpointError
from rift_cl.geometry import Grid, Parallel
from rift_cl.splat.orders import count_of
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.basis_settings import AngularSettings, BasisSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.start.points import random_points, start_splats
from rift_cl.train.strategy import DefaultSettings, McmcSettings
from rift_cl.train.trainer import Trainer
from rift_cl.train.xray.settings import XrayTrainSettings
from rift_cl.train.xray.trainer import XrayTrainer, volume_extent

pytestmark = pytest.mark.once

STEPS = 30
BOTH = BasisSettings("hermite", 1, 1, first=0, ridge=0)
KINDS = {
    "shape": {"basis": BasisSettings("hermite", 2, 0, first=0.2, every=0.2)},
    "color": {"basis": BasisSettings("laguerre", 0, 1, first=0.2), "strategy": DefaultSettings()},
    "exp": {"basis": BasisSettings("hermite", 1, 1, "exp", first=0.2)},
    "square": {"basis": BasisSettings(activation="square")},
    "lg": {"angular": AngularSettings("lg", 5, first=0.2)},
    "asg": {"angular": AngularSettings("asg", 2, first=0.2), "strategy": DefaultSettings()},
}


def trainer_of(device, kind, ball=None, **more):
    pictures = ball or Ball(device)
    raw = start_splats(random_points(pictures.cameras, 60, 1), None, seed=1)
    strategy = McmcSettings(first=10, every=10)
    settings = replace(SETTINGS, steps=STEPS, splats=80, **({"strategy": strategy} | KINDS[kind]))
    return Trainer(pictures, Parameters.of(device, raw), replace(settings, **more))


def run_to(trainer, step):
    while trainer.parameters.step < step:
        trainer.step()


def same(first, second):
    assert all(one.keys() == other.keys() for one, other in zip(first, second, strict=True))
    return all(
        one[name].tobytes() == other[name].tobytes()
        for one, other in zip(first, second, strict=True)
        for name in one
    )


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_a_fit_goes_on_from_any_state_to_the_same_bits(device, kind):
    ball = Ball(device)
    whole = trainer_of(device, kind, ball)
    run_to(whole, 4)
    early = whole.state()
    run_to(whole, 20)
    late = whole.state()
    run_to(whole, STEPS)
    for state in (early, late):
        again = trainer_of(device, kind, ball)
        again.restore(state)
        run_to(again, STEPS)
        assert same(whole.parameters.host(), again.parameters.host())
        assert again.renderer.settings == whole.renderer.settings
    assert all(np.isfinite(array).all() for array in whole.parameters.host()[0].values())


@pytest.mark.full
def test_orders_join_at_their_steps(device):
    trainer = trainer_of(device, "shape")
    assert "shape_modes" not in trainer.parameters.raw
    counts = []
    for step in (5, 6, 11, 12, STEPS):
        run_to(trainer, step)
        raw = trainer.parameters.raw
        counts.append(raw["shape_modes"].shape[1] if "shape_modes" in raw else 0)
    assert counts == [0, count_of(1) - 1, count_of(1) - 1, count_of(2) - 1, count_of(2) - 1]
    assert "color_modes" not in trainer.parameters.raw
    assert trainer.parameters.host()[0]["shape_modes"].any()


@pytest.mark.full
def test_what_joins_changes_no_picture(device):
    trainer = trainer_of(device, "exp")
    run_to(trainer, 5)
    before = Parameters.of(device, trainer.parameters.host()[0], amplitude=True)
    camera = trainer.camera(0)
    one = device.get(trainer.renderer.forward(before.drawn, camera).image)
    for name in ("shape_modes", "color_modes"):
        before.widen(name, count_of(2) - 1)
    other = device.get(trainer.renderer.forward(before.drawn, camera).image)
    away = np.abs(other - one).max(axis=2)
    # Splats with modes have an exponential of their own: a few may pass the threshold of alpha.
    assert (away > 1e-5).sum() <= 3 and away.max() < 2 / 255


@pytest.mark.full
def test_lobes_join_with_their_own_geometry(device):
    trainer = trainer_of(device, "lg")
    run_to(trainer, 5)
    assert trainer.renderer.settings.angular == "sh"
    run_to(trainer, 6)
    raw = trainer.parameters.host()[0]
    assert trainer.renderer.settings.angular == "lg"
    assert raw["lobes"].shape[1] == 5 and raw["sh"].shape[1:] == (6, 3)
    assert not raw["sh"][:, 1:].any()
    run_to(trainer, STEPS)
    assert trainer.parameters.host()[0]["sh"][:, 1:].any()


def test_a_state_of_splats_without_modes_is_one_to_begin_with(device):
    """Checkpoints from before there were modes hold five groups and go on as they did."""
    ball = Ball(device)
    raw = start_splats(random_points(ball.cameras, 60, 1), None, seed=1)
    trainer = Trainer(ball, Parameters.of(device, raw), replace(SETTINGS, steps=STEPS))
    run_to(trainer, 3)
    state = trainer.state()
    assert not any("modes" in name or "lobes" in name for name in state)
    trainer.restore(state)
    damaged = {name: array for name, array in state.items() if name != "raw.sh"}
    with pytest.raises(CheckpointError, match="of another run"):
        trainer.restore(damaged)


@pytest.mark.full
def test_flat_scans_have_no_modes_across_their_slice(device):
    pictures = Row(device)
    random = np.random.default_rng(0)
    means = random.uniform(-3, 3, (30, 3))
    means[:, 2] = 0
    raw = start_splats(means, np.ones((30, 3)), seed=0)
    basis = BasisSettings("hermite", 2, first=0, every=0, ridge=0)
    settings = XrayTrainSettings(steps=STEPS, splats=30, basis=basis)
    rendering = SplatSettings(mode="xray")
    trainer = XrayTrainer(
        pictures,
        Parameters.of(device, raw, density=True),
        settings,
        rendering,
        flat=True,
        extent=volume_extent(6.0),
    )
    run_to(trainer, 12)
    modes = trainer.parameters.host()[0]["shape_modes"]
    # (x, y, z), then xx, xy, xz, yy, yz, zz.
    across = np.array([0, 0, 1, 0, 0, 1, 0, 1, 1], bool)
    assert not modes[:, across].any() and modes[:, ~across].all(axis=0).any()


class Row:
    """Projections of one detector row: what a trainer looks at."""

    light = "display"

    def __init__(self, device):
        from rift_cl.commands.fit_xray.input import Projections

        angles = np.arange(8) * np.pi / 8
        values = np.random.default_rng(1).random((8, 1, 12)).astype(np.float32)
        self.device = device
        self.projections = Projections(Parallel(angles, 12), values, 1.0, Grid((1, 12, 12)))
        self.cameras = self.projections.views.cameras

    def begin(self, step):
        pass

    def target(self, number):
        values = self.projections.values[number][..., None]
        return self.device.array(np.ascontiguousarray(values))

    def weights(self, number):
        return None

    def background(self, number):
        return None
