"""A state that is not one of the run is refused in a sentence that names the array, on the host."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_start import ring
from test_trainer import SETTINGS, Ball

from rift_cl.errors import CheckpointError
from rift_cl.train.parameters import GROUPS, MORE, Parameters
from rift_cl.train.start.points import random_points, start_splats
from rift_cl.train.state_schema import _GROUPS
from rift_cl.train.trainer import Trainer

pytestmark = pytest.mark.once

REFINED = replace(SETTINGS, refine_poses=True, refine_exposures=True)


@pytest.fixture(scope="module")
def ball(device):
    return Ball(device)


@pytest.fixture
def trainer(ball):
    points = random_points(ring(8), 60, seed=1)
    raw = start_splats(points, np.full((60, 3), 0.5), seed=0)
    made = Trainer(ball, Parameters.of(ball.device, raw), REFINED)
    for _ in range(2):
        made.step()
    return made


def refused(trainer, state, word):
    with pytest.raises(CheckpointError) as caught:
        trainer.restore(state)
    assert word in str(caught.value)


def fewer(array):
    return array[:-1]


def wider(array):
    return np.repeat(array, 2, axis=-1)


def other_type(array):
    return array.astype(np.float16)


def no_number(array):
    return np.full_like(array, np.nan)


def negative(array):
    return np.full_like(array, -1)


def test_every_group_has_a_shape():
    assert set(_GROUPS) == {*GROUPS, *MORE}


def test_a_state_is_one_of_its_run(trainer):
    state = trainer.state()
    trainer.restore(state)
    for name, array in trainer.state().items():
        np.testing.assert_array_equal(array, state[name])


@pytest.mark.parametrize("change", [fewer, wider, other_type])
def test_no_array_of_another_kind_is_taken(trainer, change):
    state = trainer.state()
    arrays = [name for name in state if state[name].ndim and not name.startswith("strategy.")]
    assert {"raw.means", "second.sh", "poses.views", "exposures.values"} <= set(arrays)
    for name in arrays:
        refused(trainer, {**state, name: change(state[name])}, name.partition(".")[2])


@pytest.mark.parametrize("name", ["poses.views", "poses.second", "exposures.values", "loss.noise"])
def test_what_every_splat_depends_on_is_a_number(trainer, name):
    state = trainer.state()
    refused(trainer, {**state, name: no_number(state[name])}, name)


def test_a_splat_that_is_no_number_is_taken(trainer):
    """A run goes on with one until its strategy removes it, and so must its checkpoint."""
    state = trainer.state()
    for part in ("raw", "first", "second"):
        for name in ("means", "log_scales", "sh"):
            state[f"{part}.{name}"][3] = np.nan
    state["raw.logits"][4] = np.inf
    trainer.restore(state)
    for name, array in trainer.state().items():
        np.testing.assert_array_equal(array, state[name])


def test_all_arrays_of_a_group_must_agree(trainer):
    """A coefficient more in the values alone is one too few in the moments."""
    state = trainer.state()
    wide = np.zeros((*state["raw.sh"].shape[:1], 4, 3), np.float32)
    refused(trainer, {**state, "raw.sh": wide}, "first.sh")


@pytest.mark.parametrize("name", ["second.means", "poses.second", "poses.counts", "step"])
def test_what_cannot_be_negative_is_not(trainer, name):
    state = trainer.state()
    refused(trainer, {**state, name: negative(state[name])}, name)


def test_names_are_those_of_the_run(trainer):
    state = trainer.state()
    without = {name: array for name, array in state.items() if name != "second.quats"}
    refused(trainer, without, "second.quats")
    refused(trainer, {**state, "raw.more": state["raw.means"]}, "raw.more")


def test_coefficients_that_are_no_whole_degree_are_refused(trainer):
    state = trainer.state()
    for part in ("raw", "first", "second"):
        state[f"{part}.sh"] = np.zeros((60, 5, 3), np.float32)
    refused(trainer, state, "5")


def test_a_refused_state_changes_nothing(trainer):
    state = trainer.state()
    refused(trainer, {**state, "loss.noise": np.array(np.nan)}, "loss.noise")
    for name, array in trainer.state().items():
        np.testing.assert_array_equal(array, state[name])
