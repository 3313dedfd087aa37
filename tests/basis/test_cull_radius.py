"""Beyond its cull radius nothing of a splat is left, and the radius is not much too large."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.basis import Basis, Gaussian, Hermite, Laguerre, SquaredHermite
from rift_cl.basis.cull_radius import envelopes
from rift_cl.errors import InputError

RNG = np.random.default_rng(20)
EPS = 1 / 255

BASES = [
    Gaussian(3),
    Hermite(1, 3),
    Hermite(4, 3),
    Hermite(4),
    Hermite(8, 2, form="std"),
    Hermite(2, 2, "row"),
    Laguerre(4),
    Laguerre(4, "complex", "row", "std"),
    SquaredHermite(2, 3),
    SquaredHermite(4),
]


def directions(dim: int) -> np.ndarray:
    way = RNG.normal(size=(200, dim))
    return way / np.linalg.norm(way, axis=-1, keepdims=True)


@pytest.mark.parametrize("basis", BASES, ids=str)
def test_nothing_is_left_beyond(basis: Basis) -> None:
    for scale in (0.01, 1.0, 100.0):
        coeff = scale * RNG.normal(size=basis.n_coeff)
        radius = basis.cull_radius(coeff, EPS)
        far = np.linspace(radius, radius + 6, 30)[:, None, None] * directions(basis.dim)
        assert np.abs(basis.evaluate(coeff, far)).max() < EPS


@pytest.mark.parametrize("basis", BASES, ids=str)
def test_a_seventh_nearer_something_is_left(basis: Basis) -> None:
    coeff = RNG.normal(size=(10, basis.n_coeff))
    coeff *= 20 / np.linalg.norm(coeff, axis=-1, keepdims=True)
    radii = basis.cull_radius(coeff, EPS)
    reached = []
    for one, radius in zip(coeff, radii, strict=True):
        far = np.linspace(0.8, 1, 21)[:, None, None] * radius * directions(basis.dim)
        seen = (np.abs(basis.evaluate(one, far)) >= EPS).any(1)
        reached.append(0.8 + 0.01 * np.flatnonzero(seen).max(initial=-1))
    assert min(reached) >= 0.85


def test_radii_are_those_of_the_table() -> None:
    """Where one normalised mode of a line falls under 1/255 for good, n = 0..4."""
    known = {"der": (3.33, 3.70, 3.97, 4.18, 4.35), "std": (3.33, 3.80, 4.18, 4.50, 4.79)}
    for form, radii in known.items():
        basis = Hermite(4, 1, form=form)
        eps = EPS if form == "der" else EPS * math.pi**-0.25
        np.testing.assert_allclose(basis.cull_radius(np.eye(5), eps), radii, atol=0.008)


@pytest.mark.parametrize("form", ["der", "std"])
def test_a_zero_between_two_lobes_is_not_taken_for_the_end(form) -> None:
    basis, x = Hermite(9, 1, form=form), np.arange(0, 12, 1 / 64)
    values = np.abs(basis.modes(x[:, None])).T
    for eps in (1e-6, 1e-3, 0.03, 0.1, 0.3):
        radii = basis.cull_radius(np.eye(10), eps)
        for value, radius in zip(values, radii, strict=True):
            last = x[np.flatnonzero(value >= eps)].max(initial=-1 / 64)
            assert last < radius + 1e-9 <= max(last + 1 / 64, 0) + 1 / 128


@pytest.mark.parametrize("form", ["der", "std"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_the_envelope_does_not_know_directions(dim: int, form) -> None:
    basis, r = Hermite(5, dim, form=form), np.array([0.0, 0.7, 2.0, 4.0])
    squares = basis.modes(r[:, None, None] * directions(dim)) ** 2
    total = basis.indices().sum(-1)
    for order in range(6):
        expected = envelopes(r, 5, dim, form)[:, order] ** 2
        found = squares[..., total == order].sum(-1)
        np.testing.assert_allclose(found, np.tile(expected[:, None], len(found[0])), atol=1e-13)


def test_what_never_reaches_the_threshold_is_not_drawn() -> None:
    assert Hermite(3).cull_radius(np.zeros(10), EPS) == 0
    assert Gaussian().cull_radius([1e-3], EPS) == 0
    assert SquaredHermite(1).cull_radius(np.zeros(3), EPS) == 0


def test_a_radius_grows_with_the_coefficients_and_falls_with_the_threshold() -> None:
    coeff = RNG.normal(size=15)
    basis = Hermite(4)
    radii = basis.cull_radius(np.array([1, 3, 10, 1000])[:, None] * coeff, EPS)
    assert (np.diff(radii) > 0).all()
    assert basis.cull_radius(coeff, 1e-6) > basis.cull_radius(coeff, 1e-3)
    assert basis.cull_radius(1e200 * coeff, 1e-200) < 45


@pytest.mark.parametrize("eps", [0, -1.0, math.nan, math.inf, "small", [0.1, 0.2], None])
def test_impossible_thresholds_are_refused(eps: object) -> None:
    for basis in (Hermite(2), SquaredHermite(2)):
        with pytest.raises(InputError, match="eps "):
            basis.cull_radius(np.ones(6), eps)  # type: ignore[arg-type]
