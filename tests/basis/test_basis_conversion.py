"""Conversion between bases is exact, or refused with the name of a set that would be closed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rift_cl.basis import Basis, Gaussian, Hermite, Laguerre, SquaredHermite
from rift_cl.basis.conversion import form_matrix, laguerre_matrices
from rift_cl.errors import BasisSpanError, InputError

RNG = np.random.default_rng(6)
ROOT = math.sqrt(0.5)


def points(dim: int) -> np.ndarray:
    return RNG.normal(size=(60, dim)) * 1.5


@pytest.mark.parametrize("kind", ["real", "complex"])
def test_the_matrices_are_unitary(kind) -> None:
    worst = [np.abs(T @ T.conj().T - np.eye(len(T))).max() for T in laguerre_matrices(64, kind)]
    assert max(worst[:13]) <= 1e-14
    assert max(worst) <= 1e-12


def test_the_real_matrices_are_the_published_ones() -> None:
    """Rows LG02c, LG02s, LG10, and LG03c, LG03s, LG11c, LG11s, in HG20.. and HG30.."""
    matrices = laguerre_matrices(3, "real")
    wide = math.sqrt(3) / 2
    second = [[ROOT, 0, -ROOT], [0, 1, 0], [ROOT, 0, ROOT]]
    third = [[0.5, 0, -wide, 0], [0, wide, 0, -0.5], [wide, 0, 0.5, 0], [0, 0.5, 0, wide]]
    np.testing.assert_allclose(matrices[2], second, atol=1e-15)
    np.testing.assert_allclose(matrices[3], third, atol=1e-15)


def test_the_recursion_is_the_formula_where_the_formula_can_still_be_counted() -> None:
    """U[k, n-] = i^k sqrt((N-k)! k! / (2^N n+! n-!)) [t^k] (1+t)^n+ (1-t)^n-, in whole numbers."""
    f = math.factorial
    for N in range(17):
        U = laguerre_matrices(N, "complex")[N]
        for minus, k in itertools.product(range(N + 1), repeat=2):
            terms = range(max(0, k - N + minus), min(k, minus) + 1)
            whole = sum(
                (-1) ** j * math.comb(N - minus, k - j) * math.comb(minus, j) for j in terms
            )
            size = math.sqrt(f(N - k) * f(k) / (2**N * f(N - minus) * f(minus)))
            assert abs(U[minus, k] - 1j**k * size * whole) < 1e-14


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("order", [0, 1, 2, 5, 12])
def test_forms_are_inverse_and_tell_of_the_same_function(order: int, dim: int) -> None:
    there = form_matrix(order, dim, "std", "der")
    back = form_matrix(order, dim, "der", "std")
    cond = np.abs(there).sum(1).max() * np.abs(back).sum(1).max()
    assert np.abs(there @ back - np.eye(len(there))).max() <= 1e-15 * cond
    derivative, standard = Hermite(order, dim), Hermite(order, dim, form="std")
    coeff, x = RNG.normal(size=derivative.n_coeff), points(dim)
    value = derivative.evaluate(coeff, x)
    other = standard.evaluate(derivative.convert(coeff, standard), x)
    np.testing.assert_allclose(other, value, atol=1e-13 * max(1, np.abs(value).max()))


def test_the_map_between_the_forms_is_as_ill_conditioned_as_is_said() -> None:
    """2.3, 6.1, 17, 48, 137, 395 at N = 2, 4, .., 12, of one variable, each order to itself."""
    for order, expected in zip(range(2, 13, 2), (2.3, 6.1, 17, 48, 137, 395), strict=True):
        line = form_matrix(order, 1, "std", "der")
        assert np.linalg.cond(line) == pytest.approx(expected, rel=0.02)


PAIRS: list[tuple[Basis, Basis]] = [
    (Hermite(5), Laguerre(5)),
    (Hermite(5, form="std"), Laguerre(7, "complex", form="std")),
    (Laguerre(5, "complex"), Laguerre(6, "real")),
    (Laguerre(3, "real", "row"), Hermite(6)),
    (Laguerre(3, "real", "row"), Laguerre(4, "real", "row", "std")),
    (Laguerre(3, "complex", "row"), Laguerre(3, "real", "row")),
    (Hermite(3, 2, "row"), Laguerre(6)),
    (Hermite(3, 2, "row"), Hermite(4, 2, "row", "std")),
    (Hermite(2, 3, "row"), Hermite(6, 3)),
    (Hermite(4, 2), Hermite(4, 2, "row")),
    (Hermite(4, 2), Laguerre(4, "real", "row")),
    (Hermite(4, 1, "row"), Hermite(4, 1)),
    (Gaussian(3), Hermite(2, 3)),
    (SquaredHermite(2), Laguerre(4)),
    (SquaredHermite(2, 3), Hermite(5, 3, form="std")),
    (SquaredHermite(1), SquaredHermite(3)),
]


@pytest.mark.parametrize(("source", "to"), PAIRS, ids=str)
def test_a_converted_function_is_the_same_function(source: Basis, to: Basis) -> None:
    coeff = RNG.normal(size=(3, source.n_coeff))
    x = points(source.dim)[:, None]
    value = source.evaluate(coeff, x)
    np.testing.assert_allclose(
        to.evaluate(source.convert(coeff, to), x), value, atol=1e-12 * np.abs(value).max()
    )


@pytest.mark.parametrize("kind", ["real", "complex"])
@pytest.mark.parametrize(("order", "bound"), [(12, 1e-14), (64, 1e-12)])
def test_there_and_back_is_where_it_began(order: int, bound: float, kind) -> None:
    hermite, laguerre = Hermite(order), Laguerre(order, kind)
    coeff = RNG.normal(size=hermite.n_coeff)
    coeff /= np.linalg.norm(coeff)
    there = hermite.convert(coeff, laguerre)
    assert abs(np.linalg.norm(there) - 1) <= bound
    assert np.abs(laguerre.convert(there, hermite) - coeff).max() <= bound


@pytest.mark.parametrize(
    ("source", "to", "closed"),
    [
        (Hermite(3), Hermite(2), "any set to total order 3 in 2D"),
        (Hermite(3, 3), Hermite(3, 2), "any set to total order 3 in 3D"),
        (Laguerre(3, truncation="row"), Hermite(5), "total order 6 in 2D"),
        (Hermite(2, truncation="row"), Laguerre(2, truncation="row"), "total order 4 in 2D"),
        (Hermite(3, truncation="row"), Hermite(2, truncation="row"), "own row set to order 3"),
        (Laguerre(3, truncation="row"), Laguerre(2, truncation="row"), "own row set to order 3"),
        (Hermite(2, truncation="row"), Laguerre(3), "total order 4 in 2D"),
        (Laguerre(2, truncation="row"), Hermite(3, 2, "row"), "total order 4 in 2D"),
        (SquaredHermite(2), Hermite(3), "total order 4 in 2D"),
        (SquaredHermite(2), SquaredHermite(1), r"SquaredHermite\(2, 2\)"),
        (Hermite(2), SquaredHermite(2), r"wanted a linear basis, as Hermite\(2\)"),
    ],
    ids=str,
)
def test_sets_that_are_not_closed_are_refused_by_name(source, to, closed: str) -> None:
    with pytest.raises(BasisSpanError, match=closed):
        source.convert(np.ones(source.n_coeff), to)


@pytest.mark.parametrize(
    ("source", "to"),
    [
        (Laguerre(2, truncation="row"), Hermite(3, 2, "row")),
        (Hermite(2, truncation="row"), Laguerre(3, truncation="row")),
        (Hermite(2, truncation="row"), Hermite(3)),
        (Laguerre(2, truncation="row"), Hermite(3)),
    ],
    ids=str,
)
def test_what_is_refused_could_not_have_been_held(source, to) -> None:
    """The modes of both as columns in a larger space: the union has a higher rank."""
    largest = Hermite(12)
    columns = [basis.convert(np.eye(basis.n_coeff), largest) for basis in (to, source)]
    assert np.linalg.matrix_rank(np.concatenate(columns)) > to.n_coeff


def test_a_form_cannot_change_above_order_12() -> None:
    with pytest.raises(InputError, match=r"order 13.*'der'.*'std'"):
        Hermite(13).convert(np.ones(105), Hermite(13, form="std"))
    with pytest.raises(InputError, match="order 12"):
        Laguerre(7, truncation="row", form="std").project(np.ones(64), [[1.0, 0.0]])
    Hermite(64).convert(np.ones(Hermite(64).n_coeff), Laguerre(64))
