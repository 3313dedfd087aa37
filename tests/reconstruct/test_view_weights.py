"""The quadrature over directions: what every set of weights must obey, and known sets."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rift_cl.errors import InputError
from rift_cl.operators.filters.compensation import COMPENSATIONS
from rift_cl.reconstruct.direct.view_weights import view_gains, view_weights

WAYS = (None, "voronoi")
COARSE = np.deg2rad(np.r_[np.arange(0, 30, 0.5), np.arange(30, 180, 6)])
EVEN = np.linspace(0, np.pi, 12, endpoint=False)
ANGLES = st.lists(st.floats(-20, 20), min_size=1, max_size=30).map(np.array)


@given(ANGLES, st.sampled_from(WAYS))
def test_weights_add_up_to_the_half_circle(angles, compensate):
    weights = view_weights(angles, compensate)
    assert weights.shape == angles.shape
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(np.pi)


@given(ANGLES, st.randoms(use_true_random=False), st.sampled_from(WAYS))
def test_order_does_not_matter(angles, random, compensate):
    angles = np.unique(np.round(angles, 3))
    order = random.sample(range(len(angles)), len(angles))
    shuffled = view_weights(angles[order], compensate)
    np.testing.assert_allclose(shuffled, view_weights(angles, compensate)[order], atol=1e-12)


@pytest.mark.parametrize("compensate", WAYS)
@pytest.mark.parametrize("start", [0.0, 0.3, -2.0, 1e3])
def test_even_directions_weigh_the_same(compensate, start):
    np.testing.assert_allclose(view_weights(EVEN + start, compensate), np.pi / 12)
    full = np.linspace(0, 2 * np.pi, 24, endpoint=False) + start
    np.testing.assert_allclose(view_weights(full, compensate), np.pi / 24)
    odd = np.linspace(0, 2 * np.pi, 23, endpoint=False) + start
    np.testing.assert_allclose(view_weights(odd, compensate), np.pi / 23)


@pytest.mark.parametrize("compensate", WAYS)
def test_one_direction_stands_for_all(compensate):
    assert view_weights(np.array([0.7]), compensate) == pytest.approx([np.pi])
    opposite = np.array([0.7, 0.7 + np.pi, 0.7, 0.7 - 3 * np.pi])
    np.testing.assert_allclose(view_weights(opposite, compensate), np.pi / 4)


@pytest.mark.parametrize("compensate", WAYS)
def test_a_closed_end_counts_once(compensate):
    weights = view_weights(np.append(EVEN, np.pi), compensate)
    np.testing.assert_allclose(weights[1:-1], np.pi / 12)
    np.testing.assert_allclose(weights[[0, -1]], np.pi / 24)


@pytest.mark.parametrize("compensate", WAYS)
@pytest.mark.parametrize("turns", [2, 3, 4, 7])
def test_repeated_directions_share_alike(compensate, turns):
    """No measurement may be thrown away because others were made beside it."""
    repeated = np.concatenate([EVEN + k * np.pi for k in range(turns)])
    np.testing.assert_allclose(view_weights(repeated, compensate), np.pi / 12 / turns)
    uneven = np.array([0.0, 1.0, 1.0, 1.0, 2.0])
    weights = view_weights(uneven, "voronoi")
    np.testing.assert_allclose(weights, [(np.pi - 1) / 2, *[1 / 3] * 3, (np.pi - 1) / 2])


def test_voronoi_is_half_the_distance_between_neighbours():
    angles = np.array([0.9, 0.1, 2.0, 0.4])
    expected = [0.5 * (2.0 - 0.4), 0.5 * (0.4 - 2.0 + np.pi), 0.5 * (0.1 - 0.9 + np.pi), 0.4]
    np.testing.assert_allclose(view_weights(angles, "voronoi"), expected)


@pytest.mark.parametrize("end", [0.5, np.pi / 2, 2.5])
def test_a_missing_wedge_is_nobody_s(end):
    """The views beside it know no more about it than the others."""
    wedge = np.linspace(0, end, 90)
    np.testing.assert_allclose(view_weights(wedge), np.pi / 90)
    assert view_weights(wedge, "voronoi")[0] > 0.3


@pytest.mark.parametrize(
    "angles",
    [
        COARSE,
        np.r_[np.linspace(0, 0.5, 45, endpoint=False), np.linspace(0.5, np.pi, 8, endpoint=False)],
        np.deg2rad(np.arange(0, 180, 20)[:, None] + [0, 0.7, 1.4]).ravel(),
        np.sort(np.random.default_rng(3).random(60) * np.pi),
        np.delete(np.arange(60) * np.pi / 60, 20),
        np.deg2rad(np.r_[np.arange(120), 150]),
    ],
)
def test_no_gap_is_a_hole_that_has_its_like_nearby(angles):
    np.testing.assert_array_equal(view_weights(angles), view_weights(angles, "voronoi"))


def test_uneven_views_beside_a_hole_stand_for_the_gaps_to_their_neighbours():
    """Two wedges are missing, of 60 and of 40 degrees; angles are as float32 has them."""
    fine, coarse = np.arange(0, 30, 0.5), np.arange(89.5, 140, 2.5)
    angles = np.deg2rad(np.r_[fine, coarse].astype(np.float32))
    weights = view_weights(angles)
    shares = np.r_[np.full(len(fine), 0.5), np.full(len(coarse), 2.5)]
    np.testing.assert_allclose(weights, np.pi * shares / shares.sum(), rtol=1e-4)
    np.testing.assert_array_equal(weights, view_weights(angles, "covered"))


@pytest.mark.parametrize("angles", [EVEN, EVEN**2, np.linspace(0, 1, 5), np.zeros(3)])
def test_uniform_weights_ask_for_nothing(angles):
    count = len(angles)
    np.testing.assert_array_equal(view_weights(angles, "uniform"), np.full(count, np.pi / count))


@pytest.mark.parametrize("compensate", [None, "uniform", "voronoi"])
def test_gains_that_are_weights(compensate):
    gains = view_gains(EVEN**2, compensate, 50.0)
    np.testing.assert_array_equal(gains, view_weights(EVEN**2, compensate))


@pytest.mark.parametrize("compensate", COMPENSATIONS)
def test_gains_that_depend_on_frequency(compensate):
    gains = view_gains(EVEN**2, compensate, 50.0)(np.linspace(0, 0.5, 9))
    assert gains.shape == (12, 9)
    assert gains[:, 0].sum() == pytest.approx(np.pi)


@pytest.mark.parametrize("compensate", COMPENSATIONS)
def test_weights_are_no_functions(compensate):
    with pytest.raises(InputError, match=f"compensate is '{compensate}'"):
        view_weights(EVEN, compensate)


@pytest.mark.parametrize("compensate", ["", "Voronoi", "nope", 1])
def test_an_unknown_compensation_is_refused(compensate):
    with pytest.raises(InputError, match=f"compensate is {compensate!r}"):
        view_weights(EVEN, compensate)
