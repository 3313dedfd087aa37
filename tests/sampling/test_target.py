"""Targets: what they hold, the frequencies nobody gave, and what they refuse."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.sampling.targets.prior import PowerLaw
from rift_cl.sampling.targets.target import Target, half_ball, half_disc


def test_what_is_not_given_has_a_default():
    target = Target((1, 2, 3), 4.0)
    np.testing.assert_array_equal(target.points, [[1, 2, 3]])
    assert target.highest == 4.0 and target.mode == "volume" and not target.is_flat
    assert target.k.shape == (1500, 3)
    assert target.prior.power(target.k, 4.0).shape == (1500,)
    assert Target((0, 0, 0), 4.0, band=0.5).highest == 0.5


ONE = {
    "points": [[1, 2, 3], [2, 2, 3]],
    "normals": [[3, 1, 2], [0, 1, 0]],
    "mode": "surface",
    "frequencies": [[0.1, 0.2, 0.3]],
    "seen_from": [[1, 1, 1]],
}


def test_targets_are_equal_by_value_and_so_are_their_copies():
    target, again = Target((1, 2, 3), 4.0, **ONE), Target([1.0, 2, 3], 4, **ONE)
    assert target == again and hash(target) == hash(again)
    for alike in (pickle.loads(pickle.dumps(target)), copy.copy(target), copy.deepcopy(target)):
        assert alike == target and hash(alike) == hash(target)
        for name in ("center", "points", "normals", "seen_from", "k"):
            with pytest.raises(ValueError, match="read-only"):
                getattr(alike, name)[0] = 0
    others = (
        {"diameter": 5.0},
        {"band": 1.0},
        {"prior": PowerLaw(3.0)},
        {"normals": [[1, 0, 0]] * 2},
    )
    for change in others:
        assert replace(target, **change) != target
    assert target != "target"


def test_frequencies_fill_the_half_ball_and_are_the_same_each_time():
    k = half_ball(2.0, 1500)
    radius = np.linalg.norm(k, axis=1)
    assert radius.max() <= 2 and (k[:, 2] > 0).all()
    np.testing.assert_array_equal(k, half_ball(2.0, 1500))
    # Half of a ball's volume lies within 0.794 of its radius, and an octant is a quarter.
    assert (radius < 2 * 0.5 ** (1 / 3)).mean() == pytest.approx(0.5, abs=0.01)
    assert ((k[:, 0] > 0) & (k[:, 1] > 0)).mean() == pytest.approx(0.25, abs=0.01)
    both = np.concatenate([k, -k])
    gaps = cKDTree(both).query(both, k=2)[0][:, 1]
    assert gaps.min() > 0.15 * gaps.mean()


def test_a_flat_target_has_frequencies_of_its_plane():
    target = Target.flat(10.0, center=(3, 4))
    assert target.is_flat and target.k.shape == (600, 3)
    np.testing.assert_array_equal(target.center, [3, 4, 0])
    k = half_disc(1.0)
    assert (k[:, 1] > 0).all() and np.linalg.norm(k, axis=1).max() <= 1
    assert (np.linalg.norm(k, axis=1) < 0.5**0.5).mean() == pytest.approx(0.5, abs=0.01)
    given = Target.flat(10.0, frequencies=[[0.1, 0.2, 0]])
    assert given.k.shape == (1, 3)


def test_normals_of_a_surface_become_unit_vectors():
    target = Target((0, 0, 0), 1.0, [[0, 0, 1]], [[0, 0, 5]], "surface")
    np.testing.assert_array_equal(target.normals, [[0, 0, 1]])


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"diameter": 0}, "diameter"),
        ({"diameter": -1.0}, "diameter"),
        ({"diameter": np.nan}, "diameter"),
        ({"snr": 0}, "snr"),
        ({"band": -2.0}, "band"),
        ({"center": (0, 0)}, "center has shape"),
        ({"center": (0, 0, np.inf)}, "center holds NaN"),
        ({"points": [[0, np.nan, 0]]}, "points holds NaN"),
        ({"points": [0, 0, 0]}, "points has shape"),
        ({"frequencies": np.empty((0, 3))}, "frequencies has shape"),
        ({"frequencies": "many"}, "frequencies is 'many'"),
        ({"prior": "steep"}, "prior is 'steep'"),
        ({"prior": 2.0}, "prior is 2.0"),
        ({"mode": "solid"}, "mode is 'solid'"),
        ({"mode": "surface"}, "wanted normals"),
        ({"normals": [[0, 0, 0]]}, r"normals\[0\] is zero"),
        ({"normals": [[0, 0, 1], [0, 0, 1]]}, "normals has shape"),
    ],
)
def test_bad_targets_are_refused(changes, wanted):
    with pytest.raises(InputError, match=wanted):
        Target(**{"center": (0, 0, 0), "diameter": 1.0, **changes})


def test_a_flat_target_has_no_frequencies_out_of_its_plane():
    with pytest.raises(InputError, match="the plane"):
        Target.flat(1.0, frequencies=[[0, 1, 0], [1, 0, 0.5]])


def test_a_bad_middle_of_a_flat_target_is_refused():
    with pytest.raises(ShapeError, match="center"):
        Target.flat(1.0, center=(1, 2, 3, 4))
    with pytest.raises(NonFiniteError, match="center"):
        Target.flat(1.0, center=(np.nan, 2))
