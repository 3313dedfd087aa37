"""Splats are cloned, split and pruned by rules that can be counted, and never all of them go."""

from __future__ import annotations

import numpy as np
import pytest
from test_parameters import raw_values

from rift_cl.reference.splat_projection import covariances
from rift_cl.train.parameters import GROUPS, Parameters
from rift_cl.train.strategy.default import DefaultSettings, densify, reset_opacities

pytestmark = pytest.mark.dealt

COUNT = 60
SMALL, LARGE = np.log(0.005), np.log(0.05)
PULLED, STILL = 1e-3, 1e-5


def raw_of(log_scale=SMALL, count=COUNT):
    raw = raw_values(count, 4)
    raw["log_scales"] = np.full((count, 3), log_scale, np.float32)
    raw["log_scales"] -= np.random.default_rng(1).uniform(0, 1, (count, 3)).astype(np.float32)
    raw["log_scales"][:, 0] = log_scale
    raw["logits"] = np.random.default_rng(2).uniform(-1, 3, count).astype(np.float32)
    return raw


def parameters_of(device, raw):
    moments = {name: np.ones_like(value) for name, value in raw.items()}
    return Parameters.of(device, raw, first=moments, second=moments, step=600)


def statistics_of(pulled, count=COUNT, radius=0.01):
    """Statistics of 10 frames in which those of ``pulled`` had a large gradient."""
    table = np.zeros((count, 3), np.float32)
    table[:] = 10 * STILL, 10, radius
    table[pulled, 0] = 10 * PULLED
    return table


def densified(parameters, statistics, settings=None, **changes):
    options = {"extent": 1.0, "most": 10_000, "seed": 3, "prune_large": True} | changes
    settings = settings or DefaultSettings(prune_screen_size=0.15)
    return densify(parameters, statistics, settings, **options)


def same(first, second, rows=slice(None), other=slice(None)):
    return all(np.array_equal(first[name][rows], second[name][other]) for name in GROUPS)


def test_a_clone_is_its_original_twice_and_nothing_else_moves(device):
    raw = raw_of()
    after = densified(parameters_of(device, raw), statistics_of([3, 20, 41]))
    new, first, second = after.host()
    assert len(after) == COUNT + 3 and after.step == 600
    assert same(new, raw, slice(COUNT)) and same(new, raw, slice(COUNT, None), [3, 20, 41])
    for moments in (first, second):
        assert all((moments[name][:COUNT] == 1).all() for name in GROUPS)
        assert not any(moments[name][COUNT:].any() for name in GROUPS)


def test_a_large_splat_gives_way_to_two_smaller_ones(device):
    raw = raw_of(LARGE)
    after = densified(parameters_of(device, raw), statistics_of([0, 7]))
    new, first, second = after.host()
    rest = np.setdiff1d(np.arange(COUNT), [0, 7])
    assert len(after) == COUNT + 2
    assert same(new, raw, slice(COUNT - 2), rest)
    halves = {name: new[name][COUNT - 2 :] for name in GROUPS}
    parents = [0, 7, 0, 7]
    wanted = raw["log_scales"][parents] - np.log(1.6)
    np.testing.assert_allclose(halves["log_scales"], wanted, rtol=1e-6)
    for name in ("quats", "logits", "sh"):
        assert np.array_equal(halves[name], raw[name][parents]), name
    for moments in (first, second):
        assert all((moments[name][: COUNT - 2] == 1).all() for name in GROUPS)
        assert not any(moments[name][COUNT - 2 :].any() for name in GROUPS)


def test_halves_are_drawn_from_the_gaussian_that_is_split(device):
    count = 20_000
    one = raw_of(LARGE, 1)
    raw = {name: np.repeat(value, count, axis=0) for name, value in one.items()}
    # Quaternions of any length are the same rotation.
    raw["quats"] *= np.random.default_rng(4).uniform(0.1, 9, (count, 1)).astype(np.float32)
    parameters = Parameters.of(device, raw)
    after = densified(parameters, statistics_of(np.arange(count), count), most=2 * count)
    moves = after.host()[0]["means"].astype(float) - raw["means"][0]
    assert len(moves) == 2 * count
    wanted = covariances(one["quats"].astype(float), np.exp(one["log_scales"].astype(float)))[0]
    spread = np.sqrt(np.trace(wanted))
    assert np.linalg.norm(moves.mean(axis=0)) < 0.02 * spread
    assert np.linalg.norm(np.cov(moves.T) - wanted) < 0.03 * np.linalg.norm(wanted)
    # The two halves of one splat know nothing of each other.
    across = moves[:count].T @ moves[count:] / count
    assert np.linalg.norm(across) < 0.03 * np.linalg.norm(wanted)


def test_what_is_faint_or_too_large_is_gone(device):
    raw = raw_of()
    raw["logits"][:4] = np.log(0.004 / 0.996)
    raw["logits"][4:8] = np.log(0.006 / 0.994)
    raw["log_scales"][10:13, 2] = np.log(0.11)
    table = statistics_of([], radius=0.01)
    table[20:25, 2] = 0.2
    gone = [*range(4), *range(10, 13), *range(20, 25)]
    after = densified(parameters_of(device, raw), table)
    assert same(after.host()[0], raw, slice(None), np.setdiff1d(np.arange(COUNT), gone))
    early = densified(parameters_of(device, raw), table, prune_large=False)
    assert same(early.host()[0], raw, slice(None), np.arange(4, COUNT))
    anywhere = densified(parameters_of(device, raw), table, DefaultSettings())
    assert len(anywhere) == COUNT - 7


def test_sizes_are_in_extents_of_the_scene(device):
    raw = raw_of(LARGE)
    parameters, pulled = parameters_of(device, raw), statistics_of([5])
    split = densified(parameters, pulled, extent=1.0)
    cloned = densified(parameters, pulled, extent=10.0)
    assert len(split) == len(cloned) == COUNT + 1
    assert same(cloned.host()[0], raw, COUNT, 5)
    assert (split.host()[0]["log_scales"][-2:] < raw["log_scales"][5]).all()
    assert densified(parameters, pulled, extent=0.1) is parameters


def test_a_splat_that_is_too_large_may_be_split_if_its_halves_are_not(device):
    raw = raw_of()
    raw["log_scales"][0] = np.log(0.15)
    raw["log_scales"][1] = np.log(0.17)
    after = densified(parameters_of(device, raw), statistics_of([0, 1]))
    new = after.host()[0]
    assert len(after) == COUNT
    assert same(new, raw, slice(COUNT - 2), slice(2, None))
    np.testing.assert_allclose(new["log_scales"][-2:], np.log(0.15 / 1.6), rtol=1e-5)


def test_no_more_than_are_allowed_and_the_strongest_first(device):
    raw = raw_of()
    raw["log_scales"][::2] = LARGE
    raw["logits"][:5] = -9
    table = statistics_of(np.arange(COUNT))
    table[:, 0] *= 1 + np.random.default_rng(5).permutation(COUNT)
    strongest = 5 + np.argsort(-table[5:, 0])[:12]
    after = densified(parameters_of(device, raw), table, most=COUNT + 7)
    new = after.host()[0]
    assert len(after) == COUNT + 7
    split = {tuple(raw["sh"][k].ravel()) for k in strongest}
    found, counts = np.unique(new["sh"].reshape(len(after), -1), axis=0, return_counts=True)
    assert {tuple(row) for row in found[counts == 2]} == split
    assert counts.max() == 2


@pytest.mark.parametrize("most", [1, COUNT, COUNT + 1, 2 * COUNT, 10 * COUNT])
def test_the_bound_holds_and_more_from_the_start_become_no_more(device, most):
    raw = raw_of()
    raw["log_scales"][::2] = np.log(0.15)
    after = densified(parameters_of(device, raw), statistics_of(np.arange(COUNT)), most=most)
    # Half of them are too large to stay as they are, so that a pair in their place adds two.
    wanted = min(max(most, COUNT // 2), 2 * COUNT)
    assert wanted - 1 <= len(after) <= wanted


def test_gradients_that_are_no_numbers_grow_nothing(device):
    raw = raw_of()
    table = statistics_of([])
    table[:3, 0] = np.nan, np.inf, -np.inf
    table[3] = 0
    assert same(densified(parameters_of(device, raw), table).host()[0], raw)


def test_splats_that_can_never_be_drawn_are_pruned(device):
    raw = raw_of()
    for row, name in enumerate(GROUPS):
        raw[name].reshape(COUNT, -1)[row, 0] = (np.nan, np.inf, -np.inf)[row % 3]
    raw["quats"][7] = 0
    raw["log_scales"][8] = 1e4
    after = densified(parameters_of(device, raw), statistics_of(np.arange(9), radius=0))
    gone = [0, 1, 2, 3, 4, 7, 8]
    new = after.host()[0]
    assert len(after) == COUNT - 7 + 2
    assert same(new, raw, slice(COUNT - 7), np.setdiff1d(np.arange(COUNT), gone))
    assert same(new, raw, slice(COUNT - 7, None), [5, 6])


@pytest.mark.parametrize(("name", "value"), [("logits", -9), ("means", np.nan), ("log_scales", 2)])
def test_never_all_splats_are_pruned(device, name, value):
    raw = raw_of()
    raw[name][:] = value
    parameters = parameters_of(device, raw)
    assert densified(parameters, statistics_of(np.arange(COUNT))) is parameters


def test_the_same_seed_and_step_give_the_same_bits(device):
    table = statistics_of(np.arange(0, COUNT, 3))
    runs = [densified(parameters_of(device, raw_of(LARGE)), table, seed=s) for s in (3, 3, 4)]
    later = parameters_of(device, raw_of(LARGE))
    later.step = 700
    first, again, other = (run.host() for run in runs)
    for a, b in zip(first, again, strict=True):
        assert all(a[name].tobytes() == b[name].tobytes() for name in GROUPS)
    assert not np.array_equal(first[0]["means"], other[0]["means"])
    assert not np.array_equal(first[0]["means"], densified(later, table).host()[0]["means"])


@pytest.mark.parametrize("size", [SMALL, LARGE])
def test_revised_opacities_hide_together_what_one_did(device, size):
    raw = raw_of(size)
    raw["logits"][:3] = -5, 0, 80
    settings = DefaultSettings(revised_opacity=True)
    after = densified(parameters_of(device, raw), statistics_of([0, 1, 2]), settings)
    new = after.host()[0]
    pairs = new["logits"][[COUNT, COUNT + 1, COUNT + 2]].astype(float)
    before = raw["logits"][:3].astype(float)
    # ln(1 - o) doubles, and that is -ln(1 + exp(logit)).
    np.testing.assert_allclose(2 * np.logaddexp(0, pairs), np.logaddexp(0, before), rtol=1e-5)
    assert np.isfinite(new["logits"]).all()
    assert np.array_equal(np.sort(new["logits"])[-1], pairs[2].astype(np.float32))


def test_a_reset_dims_what_is_bright_and_forgets_its_moments(device):
    raw = raw_of()
    raw["logits"][0], raw["logits"][1] = -6, 1e4
    after = reset_opacities(parameters_of(device, raw), 0.01)
    new, first, second = after.host()
    opacities = device.get(after.drawn.opacities)
    assert opacities.max() == pytest.approx(0.01, rel=1e-5)
    assert new["logits"][0] == -6 and after.step == 600
    assert not first["logits"].any() and not second["logits"].any()
    for name in GROUPS:
        if name != "logits":
            assert np.array_equal(new[name], raw[name])
            assert (first[name] == 1).all() and (second[name] == 1).all()
