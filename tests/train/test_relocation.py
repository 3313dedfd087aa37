"""MCMC relocation: transparent splats find new places, and the picture hardly changes."""

from __future__ import annotations

import numpy as np
from test_parameters import raw_values

from rift_cl.geometry import Camera
from rift_cl.splat.renderer import Renderer
from rift_cl.train.parameters import GROUPS, Parameters
from rift_cl.train.strategy.mcmc import McmcSettings, relocate

MIN_OPACITY = McmcSettings().min_opacity


def parameters_of(device, count=200, faded=40):
    raw = raw_values(count, 1)
    raw["means"] *= 0.5
    raw["log_scales"] = np.full((count, 3), -2.5, np.float32)
    raw["logits"] = np.random.default_rng(2).uniform(-1, 3, count).astype(np.float32)
    raw["logits"][:faded] = -7
    moments = {name: np.ones_like(value) for name, value in raw.items()}
    return Parameters.of(device, raw, first=moments, second=moments, step=600)


def image_of(device, parameters):
    view = np.eye(4)
    view[2, 3] = 4
    camera = Camera((80, 100), [[90, 0, 50], [0, 90, 40], [0, 0, 1]], view)
    frame = Renderer(device=device).forward(parameters.drawn, camera)
    return device.get(frame.image)


def test_faded_splats_move_onto_others(device):
    before = parameters_of(device)
    after = relocate(before, min_opacity=MIN_OPACITY, most=200, seed=3, growth=0.0)
    old, new = before.host()[0], after.host()[0]
    assert len(after) == 200 and after.step == 600
    moved = (new["means"] != old["means"]).any(axis=1)
    assert moved[:40].all() and not moved[40:].any()
    alive = {tuple(row) for row in old["means"][40:].tolist()}
    assert all(tuple(row) in alive for row in new["means"][:40].tolist())
    assert (new["logits"] > -6).all()


def test_the_picture_stays(device):
    before = parameters_of(device)
    after = relocate(before, min_opacity=MIN_OPACITY, most=200, seed=3, growth=0.0)
    first, second = image_of(device, before), image_of(device, after)
    jump = np.abs(first - second).mean() / first.mean()
    # A host that only halved its opacity would lose much more.
    assert jump < 0.05


def test_the_set_grows_to_its_size_and_no_further(device):
    parameters, sizes = parameters_of(device, faded=0), []
    for _ in range(5):
        parameters = relocate(parameters, min_opacity=MIN_OPACITY, most=230, seed=3, growth=0.1)
        sizes.append(len(parameters))
    assert sizes == [220, 230, 230, 230, 230]
    assert len(relocate(parameters, min_opacity=MIN_OPACITY, most=400, seed=3, growth=0.0)) == 230


def test_moments_of_what_was_touched_begin_again(device):
    before = parameters_of(device)
    after = relocate(before, min_opacity=MIN_OPACITY, most=210, seed=3, growth=0.05)
    old, new = before.host()[0], after.host()
    hosts = np.flatnonzero((new[0]["logits"][:200] != old["logits"])[40:]) + 40
    assert hosts.size > 10
    touched = np.zeros(len(after), bool)
    touched[:40] = touched[200:] = touched[hosts] = True
    for moments in new[1:]:
        for name in GROUPS:
            assert not moments[name][touched].any(), name
            assert (moments[name][~touched] == 1).all(), name


def test_the_same_seed_and_step_choose_the_same(device):
    runs = [
        relocate(parameters_of(device), min_opacity=MIN_OPACITY, most=300, seed=seed, growth=0.05)
        for seed in (3, 3, 4)
    ]
    first, second, other = (run.host()[0] for run in runs)
    assert all(np.array_equal(first[name], second[name]) for name in GROUPS)
    assert not np.array_equal(first["means"], other["means"])


def test_nothing_alive_means_nothing_to_do(device):
    parameters = parameters_of(device, 40, 40)
    assert (
        relocate(parameters, min_opacity=MIN_OPACITY, most=100, seed=0, growth=0.05) is parameters
    )
