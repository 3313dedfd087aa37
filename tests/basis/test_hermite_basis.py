"""Hermite modes: against SciPy, quadrature and differences, and the laws of both forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import eval_hermite, eval_hermitenorm

from rift_cl.basis import Gaussian, Hermite, Laguerre
from rift_cl.basis.hermite_functions import Form, functions, he_polynomials, overlaps

LINE = np.linspace(-16, 16, 2001)
STEP = LINE[1] - LINE[0]


@pytest.mark.parametrize("form", ["der", "std"])
def test_functions_are_those_of_scipy(form: Form) -> None:
    x = np.linspace(-6, 6, 201)
    table = functions(x, 24, form)
    for n in range(25):
        if form == "der":
            expected = eval_hermitenorm(n, x) / math.sqrt(math.factorial(n))
        else:
            norm = math.sqrt(2.0**n * math.factorial(n) * math.sqrt(math.pi))
            expected = eval_hermite(n, x) / norm
        expected = expected * np.exp(-x * x / 2)
        np.testing.assert_allclose(table[:, n], expected, rtol=0, atol=5e-15)


def test_the_first_polynomials_are_the_known_ones() -> None:
    """He_0..He_4 = 1, x, x^2 - 1, x^3 - 3 x, x^4 - 6 x^2 + 3."""
    x = np.array([-2.0, 0.0, 0.5, 3.0])
    known = np.stack([x**0, x, x**2 - 1, x**3 - 3 * x, x**4 - 6 * x**2 + 3], -1)
    np.testing.assert_allclose(he_polynomials(x, 4), known / np.sqrt([1, 1, 2, 6, 24]), rtol=1e-15)


def test_a_derivative_mode_is_a_derivative_of_the_gaussian() -> None:
    """e_n sqrt(n!) = (-d/dx)^n exp(-x^2 / 2): by repeated differences of the one below."""
    h = 1e-5
    for n in range(1, 9):
        below = (functions(LINE + h, n - 1, "der") - functions(LINE - h, n - 1, "der"))[:, -1]
        np.testing.assert_allclose(
            -below / (2 * h) / math.sqrt(n), functions(LINE, n, "der")[:, -1], atol=1e-9
        )


def test_standard_modes_are_orthonormal_to_order_64() -> None:
    table = functions(LINE, 64, "std")
    np.testing.assert_allclose(STEP * table.T @ table, np.eye(65), rtol=0, atol=1e-13)


def test_overlaps_of_derivative_modes_are_those_of_quadrature() -> None:
    table = functions(LINE, 64, "der")
    np.testing.assert_allclose(overlaps(64), STEP * table.T @ table, rtol=0, atol=2e-13)


@pytest.mark.parametrize("truncation", ["total", "row"])
@pytest.mark.parametrize("form", ["der", "std"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_modes_are_products_and_so_are_their_overlaps(dim, form, truncation) -> None:
    basis = Hermite(2, dim, truncation, form)
    x = np.random.default_rng(1).normal(size=(30, dim))
    lines = [functions(x[:, axis], 2, form) for axis in range(dim)]
    line = overlaps(2) if form == "der" else np.eye(3)
    gram = basis.gram()
    for j, mode in enumerate(basis.indices()):
        expected = np.prod([lines[axis][:, n] for axis, n in enumerate(mode)], 0)
        np.testing.assert_allclose(basis.modes(x)[:, j], expected, atol=1e-15)
        for k, other in enumerate(basis.indices()):
            assert gram[j, k] == pytest.approx(np.prod(line[mode, other]), abs=1e-14)


@pytest.mark.parametrize("truncation", ["total", "row"])
@pytest.mark.parametrize("form", ["der", "std"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_gradients_are_those_of_differences(dim, form, truncation) -> None:
    rng = np.random.default_rng(2)
    basis = Hermite(4, dim, truncation, form)
    coeff, x, h = rng.normal(size=basis.n_coeff), rng.normal(size=(40, dim)), 1e-5
    found = basis.evaluate(coeff, x, grad=True)
    np.testing.assert_array_equal(found.value, basis.evaluate(coeff, x))
    for axis in range(dim):
        step = h * np.eye(dim)[axis]
        slope = (basis.evaluate(coeff, x + step) - basis.evaluate(coeff, x - step)) / (2 * h)
        np.testing.assert_allclose(found.dx[:, axis], slope, atol=1e-8)
    # Linear in its coefficients: the derivative by them gives the value back.
    np.testing.assert_allclose(found.dcoeff @ coeff, found.value, atol=1e-13)


def test_leading_axes_broadcast() -> None:
    rng = np.random.default_rng(3)
    basis = Hermite(2)
    coeff, x = rng.normal(size=(5, 1, 6)), rng.normal(size=(7, 2))
    found = basis.evaluate(coeff, x, grad=True)
    assert (found.value.shape, found.dx.shape) == ((5, 7), (5, 7, 2))
    for row, value in zip(coeff[:, 0], found.value, strict=True):
        np.testing.assert_allclose(value, basis.evaluate(row, x), atol=1e-15)


@pytest.mark.parametrize("form", ["der", "std"])
def test_far_out_everything_is_nothing_rather_than_nan(form: Form) -> None:
    far = np.array([[-1e6, 0.0], [50.0, 1e200], [-1e308, 1e308]])
    for basis in (Hermite(64, form=form), Laguerre(64, form=form)):
        found = basis.evaluate(np.ones(basis.n_coeff), far, grad=True)
        assert not found.value.any() and not found.dx.any() and not found.dcoeff.any()
        assert not basis.fourier(np.ones(basis.n_coeff), far).any()


def test_the_gaussian_is_order_nought() -> None:
    x = np.random.default_rng(4).normal(size=(20, 2))
    assert (Gaussian().name, Gaussian().n_coeff, Gaussian(3).dim) == ("gaussian", 1, 3)
    expected = 0.7 * np.exp(-(x**2).sum(-1) / 2)
    np.testing.assert_allclose(Gaussian().evaluate([0.7], x), expected, rtol=1e-15)
    np.testing.assert_array_equal(Gaussian().convert([0.7], Hermite(1)), [0.7, 0, 0])


def test_bases_are_values() -> None:
    assert Hermite(2) == Hermite(2, 2, "total", "der") and hash(Hermite(2)) == hash(Hermite(2))
    assert Hermite(0) != Gaussian() and Gaussian(2) == Gaussian()
    with pytest.raises(AttributeError):
        Hermite(2).order = 3  # type: ignore[misc]
