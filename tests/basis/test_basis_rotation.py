"""A turned expansion is the turned function, orthogonal or diagonal, where the set is closed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.basis import Basis, Hermite, Laguerre, SquaredHermite
from rift_cl.errors import BasisSpanError, InputError

RNG = np.random.default_rng(18)

PLANE = [
    Hermite(8),
    Hermite(8, form="std"),
    Hermite(0, 2, "row"),
    Laguerre(8),
    Laguerre(8, "complex"),
    Laguerre(4, "real", "row", "std"),
    Laguerre(4, "complex", "row"),
    SquaredHermite(4),
]


def plane(theta: float) -> np.ndarray:
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


@pytest.mark.parametrize("basis", PLANE, ids=str)
def test_turning_coefficients_turns_the_function(basis: Basis) -> None:
    coeff, x = RNG.normal(size=basis.n_coeff), RNG.normal(size=(60, 2))
    for theta in (0.3, -2.0, math.pi / 2):
        turned = basis.evaluate(basis.rotate(coeff, theta), x)
        expected = basis.evaluate(coeff, x @ plane(theta))
        np.testing.assert_allclose(turned, expected, atol=2e-14 * max(1, np.abs(expected).max()))


@pytest.mark.parametrize("basis", [Hermite(4, 3), Hermite(4, 3, form="std"), SquaredHermite(2, 3)])
def test_space_is_turned_by_a_matrix(basis: Basis) -> None:
    coeff, x = RNG.normal(size=basis.n_coeff), RNG.normal(size=(60, 3))
    turn = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    expected = basis.evaluate(coeff, x @ turn)
    found = basis.evaluate(basis.rotate(coeff, turn), x)
    np.testing.assert_allclose(found, expected, atol=2e-14 * np.abs(expected).max())


@pytest.mark.parametrize("basis", [Hermite(12), Laguerre(12), Laguerre(12, "complex")], ids=str)
def test_turns_add_up_keep_the_norm_and_come_round(basis: Basis) -> None:
    coeff = RNG.normal(size=basis.n_coeff)
    coeff /= np.linalg.norm(coeff)
    twice = basis.rotate(basis.rotate(coeff, 0.4), 0.9)
    np.testing.assert_allclose(twice, basis.rotate(coeff, 1.3), atol=5e-15)
    assert np.linalg.norm(twice) == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(basis.rotate(coeff, 2 * math.pi), coeff, atol=1e-14)


def test_laguerre_is_hermite_turned_to_a_diagonal() -> None:
    """c' = U diag(exp(-i l theta)) U^H c is the real matrix that turns Hermite coefficients."""
    hermite, laguerre = Hermite(12), Laguerre(12, "complex")
    coeff = RNG.normal(size=hermite.n_coeff)
    around = laguerre.convert(laguerre.rotate(hermite.convert(coeff, laguerre), 0.8), hermite)
    np.testing.assert_allclose(around, hermite.rotate(coeff, 0.8), atol=2e-14)


def test_what_cannot_be_turned_is_refused() -> None:
    with pytest.raises(BasisSpanError, match=r"order 4"):
        Hermite(2, 2, "row").rotate(np.ones(9), 0.1)
    with pytest.raises(InputError, match="a line cannot be turned"):
        Hermite(2, 1).rotate(np.ones(3), 0.1)
    with pytest.raises(InputError, match="wanted one angle"):
        Laguerre(2).rotate(np.ones(6), [0.1, 0.2])
    with pytest.raises(InputError, match=r"\(3, 3\)"):
        Hermite(2, 3).rotate(np.ones(10), 0.1)
    with pytest.raises(InputError, match="no orthogonal matrix"):
        Hermite(2, 3).rotate(np.ones(10), np.ones((3, 3)))
    with pytest.raises(InputError, match="theta holds NaN"):
        Hermite(2).rotate(np.ones(6), math.nan)
