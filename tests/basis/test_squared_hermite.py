"""Squares of Hermite expansions: never negative, of known mass, and exactly linear at order 2 N."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.basis import Gaussian, Hermite, SquaredHermite
from rift_cl.basis.hermite_functions import he_polynomials
from rift_cl.basis.squared_hermite import linearisation

RNG = np.random.default_rng(19)
CASES = [(order, dim) for dim in (1, 2, 3) for order in (0, 1, 2, 3)]


@pytest.mark.parametrize(("order", "dim"), CASES)
def test_the_expansion_is_the_square(order: int, dim: int) -> None:
    basis = SquaredHermite(order, dim)
    coeff, x = RNG.normal(size=(4, basis.n_coeff)), RNG.normal(size=(80, 1, dim)) * 2
    square = basis.evaluate(coeff, x)
    assert (square >= 0).all()
    linear = basis.expansion.evaluate(basis.expand(coeff), x)
    np.testing.assert_allclose(linear, square, atol=2e-15 * square.max())


def test_the_numbers_of_coefficients_are_those_of_the_literature() -> None:
    """Amplitudes 4, 10, 20 in space become densities of 10, 35, 84."""
    for order, counts in ((1, (4, 10)), (2, (10, 35)), (3, (20, 84))):
        basis = SquaredHermite(order, 3)
        assert (basis.n_coeff, basis.expansion.n_coeff) == counts


def test_it_is_what_the_kernels_call_the_activation_square() -> None:
    """Q^2 exp(-|x|^2 / 2) with Q = sum a_n He_n / sqrt(n!)."""
    basis, x = SquaredHermite(4, 1), np.linspace(-5, 5, 101)
    coeff = RNG.normal(size=5)
    Q = he_polynomials(x, 4) @ coeff
    found = basis.evaluate(coeff, x[:, None])
    np.testing.assert_allclose(found, Q**2 * np.exp(-(x**2) / 2), atol=1e-14 * found.max())


@pytest.mark.parametrize("dim", [1, 2])
def test_the_highest_order_keeps_twelve_digits(dim: int) -> None:
    basis = SquaredHermite(8, dim)
    coeff, x = RNG.normal(size=basis.n_coeff), RNG.normal(size=(200, dim)) * 3
    square = basis.evaluate(coeff, x)
    linear = basis.expansion.evaluate(basis.expand(coeff), x)
    assert np.abs(linear - square).max() <= 1e-12 * square.max()


def test_the_product_rule_holds_for_polynomials() -> None:
    """He_2 He_2 = He_4 + 4 He_2 + 2, He_1 He_2 = He_3 + 2 He_1."""
    rule = linearisation(2)
    np.testing.assert_allclose(rule[2, 2] * 2 / np.sqrt([1, 1, 2, 6, 24]), [2, 0, 4, 0, 1])
    np.testing.assert_allclose(
        rule[1, 2] * math.sqrt(2) / np.sqrt([1, 1, 2, 6, 24]), [0, 2, 0, 1, 0]
    )


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_the_mass_is_the_length_of_the_amplitudes(dim: int) -> None:
    basis = SquaredHermite(3, dim)
    coeff = RNG.normal(size=basis.n_coeff)
    mass = (2 * math.pi) ** (dim / 2) * (coeff**2).sum()
    assert coeff @ basis.gram() @ coeff == pytest.approx(mass, rel=1e-14)
    assert basis.fourier(coeff, np.zeros(dim)) == pytest.approx(mass, rel=1e-14)
    assert basis.expand(coeff)[0] == pytest.approx((coeff**2).sum(), rel=1e-14)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_gradients_are_those_of_differences(dim: int) -> None:
    basis, h = SquaredHermite(2, dim), 1e-5
    coeff, x = RNG.normal(size=basis.n_coeff), RNG.normal(size=(30, dim))
    found = basis.evaluate(coeff, x, grad=True)
    for axis, step in enumerate(h * np.eye(dim)):
        slope = (basis.evaluate(coeff, x + step) - basis.evaluate(coeff, x - step)) / (2 * h)
        np.testing.assert_allclose(found.dx[:, axis], slope, atol=1e-7)
    for k, step in enumerate(h * np.eye(basis.n_coeff)):
        slope = (basis.evaluate(coeff + step, x) - basis.evaluate(coeff - step, x)) / (2 * h)
        np.testing.assert_allclose(found.dcoeff[:, k], slope, atol=1e-7)


def test_order_nought_is_the_gaussian() -> None:
    x = RNG.normal(size=(20, 2))
    np.testing.assert_allclose(SquaredHermite(0).evaluate([1.0], x), Gaussian().evaluate([1.0], x))
    np.testing.assert_allclose(SquaredHermite(0).expand([3.0]), [9.0])
    assert SquaredHermite(2, 3).expansion == Hermite(4, 3)
