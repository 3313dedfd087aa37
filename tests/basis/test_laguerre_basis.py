"""Laguerre modes: against SciPy and quadrature, and as the mixture of Hermite modes they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import eval_genlaguerre

from rift_cl.basis import Hermite, Laguerre
from rift_cl.basis.conversion import laguerre_matrices
from rift_cl.basis.hermite_functions import Form
from rift_cl.basis.indices import order_slices

RNG = np.random.default_rng(5)
POINTS = RNG.normal(size=(150, 2)) * 1.7


def by_scipy(p: int, turns: int, form: Form) -> np.ndarray:
    r, phi = np.hypot(*POINTS.T), np.arctan2(*POINTS.T[::-1])
    size = abs(turns)
    norm = (-1) ** p * math.sqrt(math.factorial(p) / math.factorial(p + size))
    s, unit = (r**2, math.sqrt(1 / math.pi)) if form == "std" else (r**2 / 2, 1.0)
    radial = norm * unit * s ** (size / 2) * eval_genlaguerre(p, size, s) * np.exp(-(r**2) / 2)
    return radial * np.exp(1j * turns * phi)


@pytest.mark.parametrize("truncation", ["total", "row"])
@pytest.mark.parametrize("form", ["der", "std"])
def test_modes_are_those_of_scipy(form, truncation) -> None:
    basis = Laguerre(6, "complex", truncation, form)
    values = basis.modes(POINTS)
    for j, (p, turns) in enumerate(basis.indices()):
        np.testing.assert_allclose(values[:, j], by_scipy(p, turns, form), rtol=0, atol=3e-15)
    basis = Laguerre(6, "real", truncation, form)
    values = basis.modes(POINTS)
    assert values.dtype == np.float64
    for j, (p, turns, sine) in enumerate(basis.indices()):
        pair = by_scipy(p, turns, form), by_scipy(p, -turns, form)
        expected = (pair[0] - pair[1]) / (1j * math.sqrt(2)) if sine else sum(pair) / math.sqrt(2)
        expected = expected if turns else pair[0]
        np.testing.assert_allclose(values[:, j], expected, rtol=0, atol=3e-15)


@pytest.mark.parametrize("kind", ["real", "complex"])
@pytest.mark.parametrize("form", ["der", "std"])
def test_overlaps_are_those_of_quadrature(form, kind) -> None:
    line = np.linspace(-10, 10, 101)
    grid = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2)
    for truncation, order in (("total", 12), ("row", 5)):
        basis = Laguerre(order, kind, truncation, form)
        modes = basis.modes(grid)
        gram = (line[1] - line[0]) ** 2 * modes.conj().T @ modes
        np.testing.assert_allclose(basis.gram(), gram, rtol=0, atol=5e-14)


@pytest.mark.parametrize("kind", ["real", "complex"])
@pytest.mark.parametrize("form", ["der", "std"])
@pytest.mark.parametrize(("order", "bound"), [(12, 2e-15), (64, 5e-14)])
def test_modes_are_a_mixture_of_hermite_modes_at_every_point(order, bound, form, kind) -> None:
    """LG = U HG, each side by its own recurrence; the goals are 1e-14 to order 12, 1e-12 to 64."""
    laguerre = Laguerre(order, kind, "total", form).modes(POINTS)
    hermite = Hermite(order, 2, "total", form).modes(POINTS)
    parts = order_slices(order, 2)
    for part, T in zip(parts, laguerre_matrices(order, kind), strict=True):
        assert np.abs(laguerre[:, part] - hermite[:, part] @ T.T).max() <= bound


@pytest.mark.parametrize("kind", ["real", "complex"])
@pytest.mark.parametrize("truncation", ["total", "row"])
@pytest.mark.parametrize("form", ["der", "std"])
def test_gradients_are_those_of_differences(form, truncation, kind) -> None:
    basis, h = Laguerre(4, kind, truncation, form), 1e-5
    coeff = RNG.normal(size=basis.n_coeff) * (1 if kind == "real" else 1 + 0.3j)
    found = basis.evaluate(coeff, POINTS, grad=True)
    for axis in range(2):
        step = h * np.eye(2)[axis]
        ends = basis.evaluate(coeff, POINTS + step), basis.evaluate(coeff, POINTS - step)
        np.testing.assert_allclose(found.dx[:, axis], (ends[0] - ends[1]) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(found.dcoeff @ coeff, found.value, atol=1e-13)


def test_the_first_modes_are_the_known_ones() -> None:
    """LG_01 = (HG_10 + i HG_01) / sqrt 2; LG_10 = (HG_20 + HG_02) / sqrt 2, the doughnut's hole."""
    hermite = Hermite(2, form="std").modes(POINTS)
    laguerre = Laguerre(2, "complex", form="std").modes(POINTS)
    np.testing.assert_allclose(laguerre[:, 1], (hermite[:, 1] + 1j * hermite[:, 2]) / math.sqrt(2))
    np.testing.assert_allclose(
        laguerre[:, 4], (hermite[:, 3] + hermite[:, 5]) / math.sqrt(2), atol=1e-15
    )
    r2 = (POINTS**2).sum(-1)
    np.testing.assert_allclose(
        Laguerre(2).modes(POINTS)[:, 5], (r2 / 2 - 1) * np.exp(-r2 / 2), atol=1e-15
    )
