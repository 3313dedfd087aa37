"""Coverage on the host: optics by closed forms and integrals, gradients by finite differences."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from observations_of_all_kinds import random_observations

from rift_cl.optics.optical_transfer import optical_transfer
from rift_cl.sampling.coverage.host import host_coverage, host_coverage_grad
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import half_ball

STEP = 1e-6


def test_nothing_is_lost_at_zero_and_nothing_passes_the_cutoff():
    assert optical_transfer(0.0, 0.3, 2.0, 0.4).value == pytest.approx(1, abs=1e-12)
    assert optical_transfer([2.0, 3.0], 0.0, 2.0, 0.0).value.tolist() == [0, 0]
    assert optical_transfer(7.0, 0.0, np.inf, 0.0).value == 1


def test_each_part_of_the_optics_is_its_closed_form():
    """Half the cut-off passes 0.391 (Goodman); a pixel's first zero is at one cycle a pixel."""
    assert optical_transfer(0.5, 0, 1, 0).value == pytest.approx(0.39100, abs=1e-5)
    assert optical_transfer(1.0, 1.0, np.inf, 0).value == pytest.approx(0, abs=1e-15)
    assert optical_transfer(0.5, 1.0, np.inf, 0).value == pytest.approx(2 / np.pi)
    assert optical_transfer(1.219670, 0, np.inf, 1.0).value == pytest.approx(0, abs=1e-6)


def test_a_disc_of_defocus_has_the_transform_of_a_disc():
    x = (np.arange(2000) + 0.5) / 2000 - 0.5
    chord = 2 * np.sqrt(0.25 - x**2)
    for k in (0.3, 0.9, 2.2):
        direct = (chord * np.cos(2 * np.pi * k * x)).sum() / chord.sum()
        value = optical_transfer(k, 0, np.inf, 1.0).value
        assert value == pytest.approx(abs(direct), abs=2e-5)


@pytest.mark.parametrize("name", ["pixel", "cutoff", "blur", "square"])
def test_derivatives_of_the_optics_are_differences(name):
    k = np.linspace(0.05, 9, 60)
    at = {"pixel": 0.13, "cutoff": 9.7, "blur": 0.21}

    def value(shift):
        if name == "square":
            return optical_transfer(np.sqrt(k**2 + shift), **at).value
        return optical_transfer(k, **{**at, name: at[name] + shift}).value

    differences = (value(STEP) - value(-STEP)) / (2 * STEP)
    found = getattr(optical_transfer(k, **at), name)
    np.testing.assert_allclose(found, differences, atol=1e-5 * np.abs(found).max())


@pytest.mark.parametrize("name", ["direction", "weight", "pixel", "cutoff", "blur"])
def test_the_gradient_is_that_of_differences(name):
    observations, k = random_observations(5, 2), half_ball(10.0, 150)
    random = np.random.default_rng(1)
    upstream = random.normal(size=(2, 150))
    values = getattr(observations, name)
    along = random.normal(size=values.shape)
    if name == "direction":
        along = np.cross(along, values)
    else:
        # What is switched off stays so: a cut-off at infinity, a pixel of none.
        along = np.where(np.isinf(values) | (values == 0), 0, along)

    def total(shift):
        moved = values + shift * along
        if name == "direction":
            moved /= np.linalg.norm(moved, axis=2, keepdims=True)
        return (
            upstream * host_coverage(dataclasses.replace(observations, **{name: moved}), k, 1.0)
        ).sum()

    difference = (total(STEP) - total(-STEP)) / (2 * STEP)
    gradient = getattr(host_coverage_grad(observations, k, 1.0, upstream), name)
    assert (gradient * along).sum() == pytest.approx(difference, rel=1e-5)


def test_the_gradient_by_a_direction_lies_across_it():
    observations, k = random_observations(6, 1), half_ball(10.0, 100)
    gradient = host_coverage_grad(observations, k, 1.0, np.ones((1, 100)))
    along = (gradient.direction * observations.direction).sum(2)
    assert np.abs(along).max() < 1e-12 * np.abs(gradient.direction).max()


def test_a_view_sees_its_own_plane_and_nothing_across_it():
    observations = Observations.along([[0, 0, 1]])
    k = np.array([[3.0, 4.0, 0.0], [0, 0, 9.0], [0, 0, 0], [0, 0, 0.25]])
    expected = [[1, 0, 1, np.exp(-2 * 0.5**2)]]
    np.testing.assert_allclose(host_coverage(observations, k, 1.0), expected, atol=1e-12)


def test_opposite_frequencies_are_covered_alike():
    observations, k = random_observations(9, 2), half_ball(12.0, 200)
    np.testing.assert_allclose(
        host_coverage(observations, k, 1.0), host_coverage(observations, -k, 1.0), rtol=1e-12
    )


def test_gradients_stay_finite_along_the_line_of_sight_and_at_zero():
    observations = Observations(
        np.array([[[0.0, 0, 1]]]), *np.array([1.0, 0.1, 5.0, 0.2]).reshape(4, 1, 1)
    )
    k = np.array([[0, 0, 0.3], [0, 0, 0], [1e-12, 0, 0.2]])
    gradient = host_coverage_grad(observations, k, 1.0, np.ones((1, 3)))
    assert all(np.isfinite(part).all() for part in gradient)


def test_rounding_along_the_line_of_sight_does_not_blow_up():
    """A frequency along the line of sight but for rounding: its length across it rounds to none."""
    random = np.random.default_rng(0)
    for _ in range(200):
        n = random.normal(size=3)
        n /= np.linalg.norm(n)
        observations = Observations(n[None, None], *np.array([1.0, 0.1, 5.0, 0.2]).reshape(4, 1, 1))
        k = random.uniform(0.05, 0.5, (20, 1)) * n * (1 + 1e-16 * random.integers(-2, 3, (20, 3)))
        assert (
            np.abs(host_coverage_grad(observations, k, 1.0, np.ones((1, 20))).direction).max()
            < 1e-6
        )
