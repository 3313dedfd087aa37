"""The weight of the residual: a positive operator that saves steps, and spares noise."""

from __future__ import annotations

import numpy as np
import pytest
from solver_cases import dense, finished, problem, soft_disc

from rift_cl import Grid, Parallel, Projector, phantom
from rift_cl.reconstruct.solvers.conjugate_gradients import Cgls, cgls
from rift_cl.reconstruct.solvers.data_term import DataTerm
from rift_cl.reconstruct.solvers.residual_weight import mean_power
from rift_cl.reconstruct.solvers.simultaneous_iteration import Sirt

pytestmark = pytest.mark.once

RANDOM = np.random.default_rng(8)


@pytest.mark.parametrize(("method", "share", "saved"), [(Cgls, 0.01, 2), (Sirt, 0.03, 8)])
def test_a_ramp_saves_most_steps(device, method, share, saved):
    grid, scan = Grid((48, 48)), Parallel(np.linspace(0, np.pi, 48, endpoint=False), 69)
    A = Projector(grid, scan, device=device)
    truth = soft_disc(grid)
    y = A(truth)

    def steps_to(**given):
        solver = method(A, y, **given)
        for report in solver.run(60):
            if np.linalg.norm(device.get(solver.image) - truth) < share * np.linalg.norm(truth):
                return report.done
        return 61

    assert steps_to(precondition="ramp") * saved <= steps_to()


@pytest.mark.full
def test_the_largest_eigenvalue_is_found_from_above(device):
    A, matrix, _, y = problem(device)
    for precondition in (None, "ramp"):
        data = DataTerm(A, y, precondition, None)
        weight = np.eye(y.size) if data.weight is None else dense(data.weight)
        exact = np.linalg.eigvalsh(matrix.T @ weight @ matrix.toarray())[-1]
        assert 1 <= data.norm_squared() / exact < 1.07
        assert data.norm_squared() == DataTerm(A, y, precondition, None).norm_squared()


@pytest.mark.parametrize("bins", [1, 2, 7, 64])
@pytest.mark.parametrize("noise", [None, 0.3, 50.0])
def test_the_weight_of_the_residual_is_positive_with_a_mean_gain_of_one(device, bins, noise):
    scan = Parallel([0.1, 0.5, 1.9], bins, pitch=0.3)
    A = Projector(Grid((9, 9), 0.3), scan, device=device)
    y = A(RANDOM.random((9, 9)))
    weight = dense(DataTerm(A, y, "ramp", noise).weight)
    np.testing.assert_allclose(weight, weight.T, atol=1e-5)
    values = np.linalg.eigvalsh(weight.astype(float))
    assert values[0] > 1e-4 * values[-1]
    assert np.trace(weight) / len(weight) == pytest.approx(1, rel=0.01)


def test_a_ramp_spares_what_is_noise(device):
    """At a noise that the plain ramp suffers from the stop is no worse than without a ramp."""
    grid, scan = Grid((48, 48)), Parallel(np.linspace(0, np.pi, 48, endpoint=False), 69)
    A = Projector(grid, scan, device=device)
    truth = soft_disc(grid)
    clean = A(truth)
    noise = 0.25
    errors = {"plain": [], "ramp": [], "blind": []}
    for seed in range(3):
        data = clean + noise * np.random.default_rng(seed).standard_normal(A.range)
        plain = cgls(A, data, 50, noise=noise)
        ramp = cgls(A, data, 50, noise=noise, precondition="ramp")
        blind = Cgls(A, data, precondition="ramp")
        while finished(blind, blind._now.step + 1)[-1].values["residual"] > noise:
            pass
        for name, image in zip(errors, (plain, ramp, device.get(blind.image)), strict=True):
            errors[name].append(np.linalg.norm(image - truth))
    mean = {name: np.mean(found) for name, found in errors.items()}
    assert mean["ramp"] < 1.02 * mean["plain"]
    assert mean["ramp"] < 0.8 * mean["blind"]


@pytest.mark.parametrize("rows", [1, 5, 400])
def test_the_power_of_white_noise_is_its_variance(rows):
    noise = 3 * RANDOM.standard_normal((rows, 90))
    frequencies, power = mean_power(noise, 0.5)
    assert (frequencies[0], frequencies[-1]) == (0, 1)
    assert np.mean(power) == pytest.approx(9, rel=0.5 / np.sqrt(rows))
    assert power.max() / power.min() < 4
    _, small = mean_power(noise / 2, 0.5)
    np.testing.assert_allclose(small, power / 4)


def test_sirt_ends_though_spared_frequencies_keep_the_residual_above_the_noise(device):
    """A sharp object, much noise and no negative values: the case that the count ended once."""
    grid, scan = Grid((48, 48)), Parallel(np.linspace(0, np.pi, 48, endpoint=False), 69)
    A = Projector(grid, scan, device=device)
    truth = phantom.shepp_logan(grid)
    noise = 0.25
    y = A(truth) + noise * np.random.default_rng(2).standard_normal(A.range)
    given = {"nonnegative": True, "noise": noise}
    ramp, plain = Sirt(A, y, precondition="ramp", **given), Sirt(A, y, **given)
    assert len(finished(ramp, 200)) * 4 < len(finished(plain, 200))
    errors = [np.linalg.norm(device.get(s.image) - truth) for s in (ramp, plain)]
    assert errors[0] < 1.02 * errors[1]
