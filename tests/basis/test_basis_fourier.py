"""Fourier transforms in closed form, and the slice theorem that ties them to projection."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.basis import Basis, Hermite, Laguerre, SquaredHermite
from rift_cl.errors import InputError

RNG = np.random.default_rng(17)
LINE = np.linspace(-11, 11, 121)

BASES = [
    *(Hermite(order, 1, form=form) for order in (0, 5, 12) for form in ("der", "std")),
    Hermite(8),
    Hermite(8, form="std"),
    Hermite(3, 2, "row"),
    Laguerre(8),
    Laguerre(6, "complex", form="std"),
    Laguerre(3, truncation="row"),
    SquaredHermite(3),
]


@pytest.mark.parametrize("basis", BASES, ids=str)
def test_the_closed_form_is_the_integral(basis: Basis) -> None:
    coeff, k = RNG.normal(size=basis.n_coeff), RNG.normal(size=(12, basis.dim))
    x = np.stack(np.meshgrid(*[LINE] * basis.dim), -1).reshape(-1, basis.dim)
    cell = (LINE[1] - LINE[0]) ** basis.dim
    expected = cell * np.exp(-1j * k @ x.T) @ basis.evaluate(coeff, x)
    found = basis.fourier(coeff, k)
    np.testing.assert_allclose(found, expected, atol=1e-13 * max(1, np.abs(expected).max()))


@pytest.mark.parametrize("order", [1, 4, 12])
def test_standard_modes_are_their_own_transforms(order: int) -> None:
    """fhat = sqrt(2 pi)^dim (-i)^N f, for Hermite and Laguerre modes of any dimension."""
    k = RNG.normal(size=(20, 2))
    for basis in (Hermite(order, form="std"), Laguerre(order, form="std")):
        for j, coeff in enumerate(np.eye(basis.n_coeff)):
            mode = basis.indices()[j]
            total = mode.sum() if isinstance(basis, Hermite) else 2 * mode[0] + mode[1]
            expected = 2 * math.pi * (-1j) ** total * basis.evaluate(coeff, k)
            np.testing.assert_allclose(basis.fourier(coeff, k), expected, atol=2e-14)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_slice_of_the_transform_is_the_transform_of_the_projection(dim: int) -> None:
    basis = Hermite(6, dim)
    A = np.linalg.qr(RNG.normal(size=(dim, dim - 1)))[0].T
    coeff, q = RNG.normal(size=basis.n_coeff), RNG.normal(size=(30, dim - 1))
    flat = Hermite(6, dim - 1).fourier(basis.project(coeff, A), q)
    slice_ = basis.fourier(coeff, q @ A)
    np.testing.assert_allclose(
        math.sqrt(2 * math.pi) * flat, slice_, atol=2e-14 * np.abs(slice_).max()
    )


def test_the_transform_at_nought_is_the_integral_that_the_literature_gives() -> None:
    """Integral of h_n = sqrt(2) pi^(1/4) sqrt(n!) / (2^(n/2) (n/2)!), and 0 for odd n."""
    basis = Hermite(16, 1, form="std")
    for n, coeff in enumerate(np.eye(17)):
        share = math.sqrt(math.factorial(n)) / (2 ** (n / 2) * math.factorial(n // 2))
        expected = 0 if n % 2 else math.sqrt(2) * math.pi**0.25 * share
        assert basis.fourier(coeff, [0.0]) == pytest.approx(expected, abs=1e-14)


def test_a_derivative_mode_has_no_integral_but_the_first() -> None:
    basis = Hermite(4, 3)
    found = basis.fourier(np.eye(basis.n_coeff), [0.0, 0.0, 0.0])
    np.testing.assert_allclose(found, (2 * math.pi) ** 1.5 * np.eye(1, basis.n_coeff)[0], atol=0)


def test_frequencies_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="k has shape"):
        Hermite(2).fourier(np.ones(6), [1.0])
    with pytest.raises(InputError, match="k holds NaN"):
        Laguerre(2).fourier(np.ones(6), [1.0, math.inf])
