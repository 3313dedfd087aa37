"""The order of coefficients is a promise to kernels and files: it is spelt out here."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.basis import indices
from rift_cl.basis.indices import graded, n_coeff, order_of, order_slices, place
from rift_cl.errors import InputError

DIMS = (1, 2, 3)


def test_the_graded_order_is_spelt_out() -> None:
    assert graded(3, 1).tolist() == [[0], [1], [2], [3]]
    assert graded(2, 2).tolist() == [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]]
    assert graded(2, 3).tolist() == [
        *([0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]),
        *([2, 0, 0], [1, 1, 0], [1, 0, 1], [0, 2, 0], [0, 1, 1], [0, 0, 2]),
    ]


@pytest.mark.parametrize("dim", DIMS)
def test_orders_rise_and_each_falls_lexicographically(dim: int) -> None:
    modes = [tuple(mode) for mode in graded(9, dim).tolist()]
    assert len(set(modes)) == len(modes) == n_coeff(9, dim) == math.comb(9 + dim, dim)
    assert modes == sorted(modes, key=lambda mode: (sum(mode), *(-n for n in mode)))


@pytest.mark.parametrize("dim", DIMS)
def test_a_lower_order_is_a_prefix_and_slices_hold_one_order_each(dim: int) -> None:
    modes = graded(7, dim)
    for order, part in enumerate(order_slices(7, dim)):
        assert (modes[part].sum(-1) == order).all()
        np.testing.assert_array_equal(modes[: part.stop], graded(order, dim))
        np.testing.assert_array_equal(modes[part], indices.of_order(order, dim))


@pytest.mark.parametrize("dim", DIMS)
def test_places_and_counts_are_inverses(dim: int) -> None:
    np.testing.assert_array_equal(place(graded(8, dim)), np.arange(n_coeff(8, dim)))
    for order in range(65):
        assert order_of(n_coeff(order, dim), dim) == order


def test_the_counts_of_the_literature() -> None:
    """1, 3, 6, 10, 15 in the plane and 1, 4, 10, 20, 35 in space."""
    assert [n_coeff(order, 2) for order in range(5)] == [1, 3, 6, 10, 15]
    assert [n_coeff(order, 3) for order in range(5)] == [1, 4, 10, 20, 35]


def test_row_s_has_as_many_members_as_a_row_of_the_harmonics() -> None:
    assert indices.rows(1, 2).tolist() == [[0, 0], [1, 1], [1, 0], [0, 1]]
    for order in range(6):
        hermite = indices.rows(order, 2).max(-1)
        laguerre = indices.laguerre_rows(order, "complex")
        laguerre = laguerre[:, 0] + np.abs(laguerre[:, 1])
        for found in (hermite, laguerre):
            np.testing.assert_array_equal(
                found, np.repeat(range(order + 1), range(1, 2 * order + 2, 2))
            )


def test_laguerre_modes_go_down_in_turns_cosine_before_sine() -> None:
    assert indices.laguerre_graded(2, "real").tolist() == [
        *([0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 2, 0], [0, 2, 1], [1, 0, 0]),
    ]
    assert indices.laguerre_graded(2, "complex").tolist() == [
        *([0, 0], [0, 1], [0, -1], [0, 2], [1, 0], [0, -2]),
    ]
    assert indices.laguerre_rows(1, "real").tolist() == [[0, 0, 0], [0, 1, 0], [0, 1, 1], [1, 0, 0]]


@pytest.mark.parametrize("kind", ["real", "complex"])
def test_laguerre_places_are_those_of_the_graded_set(kind: indices.Kind) -> None:
    modes = indices.laguerre_graded(9, kind)
    np.testing.assert_array_equal(indices.laguerre_place(modes), np.arange(len(modes)))
    assert len(modes) == n_coeff(9, 2)


def test_index_sets_cannot_be_changed_from_outside() -> None:
    for modes in (graded(2, 2), indices.rows(2, 2), indices.laguerre_rows(2, "real")):
        with pytest.raises(ValueError, match="read-only"):
            modes[0, 0] = 7


@pytest.mark.parametrize("order", [-1, 65, 1.5, "2", True, None, math.nan])
def test_impossible_orders_are_refused(order: object) -> None:
    with pytest.raises(InputError, match=r"order is .*0 to 64"):
        n_coeff(order, 2)  # type: ignore[arg-type]


@pytest.mark.parametrize("dim", [0, 4, 2.0, "3"])
def test_impossible_dimensions_are_refused(dim: object) -> None:
    with pytest.raises(InputError, match=r"dim is .*1 to 3"):
        graded(2, dim)  # type: ignore[arg-type]


@pytest.mark.parametrize("count", [0, 2, 5, -3, 11])
def test_counts_that_fit_no_order_are_refused(count: int) -> None:
    with pytest.raises(InputError, match=f"{count} coefficients.*3D"):
        order_of(count, 3)
