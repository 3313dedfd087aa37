"""Solvers find what SciPy finds on the same matrix, and both ways to total variation agree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import linalg
from solver_cases import GRID, METHODS, SCAN, Matrix, dense, finished, problem

from rift_cl import Grid, Projector
from rift_cl.operators import Ramp, ViewFilter
from rift_cl.reconstruct.solvers.conjugate_gradients import cgls
from rift_cl.reconstruct.solvers.fista import Fista
from rift_cl.reconstruct.solvers.pdhg import Pdhg
from rift_cl.reconstruct.solvers.simultaneous_iteration import Sirt, sirt
from rift_cl.reconstruct.solvers.tv import tv
from rift_cl.reconstruct.solvers.variation_weight import variation_weight
from rift_cl.reference import total_variation as twin

pytestmark = pytest.mark.once

RANDOM = np.random.default_rng(8)
every_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
both_types = pytest.mark.parametrize(("dtype", "close"), [("float32", 1e-2), ("float64", 1e-8)])


def checked_type(device, dtype):
    if dtype == "float64" and not device.traits.fp64:
        pytest.skip("a device without float64")
    return dtype


@both_types
def test_conjugate_gradients_are_scipys_lsqr_step_by_step(device, dtype, close):
    A, matrix, _, y = problem(device, noise=0.1, dtype=checked_type(device, dtype))
    for steps in (1, 4, 9):
        expected = linalg.lsqr(matrix, y.ravel(), iter_lim=steps, atol=0, btol=0, conlim=0)[0]
        found = cgls(A, y, steps).ravel()
        assert np.linalg.norm(found - expected) < close * np.linalg.norm(expected)


@both_types
def test_preconditioned_conjugate_gradients_are_scipys_cg(device, dtype, close):
    A, matrix, _, y = problem(device, noise=0.1, dtype=checked_type(device, dtype))
    F = ViewFilter(SCAN, Ramp("hann"), device=device, dtype=dtype) * 2.5
    weight = dense(F).astype(float)
    normal = matrix.T @ weight @ matrix.toarray()
    right = matrix.T @ weight @ y.ravel().astype(float)
    expected = linalg.cg(normal, right, maxiter=6, rtol=0)[0]
    found = cgls(A, y, 6, precondition=F).ravel()
    assert np.linalg.norm(found - expected) < close * np.linalg.norm(expected)


@pytest.mark.parametrize("nonnegative", [False, True])
def test_sirt_is_its_formula(device, nonnegative):
    A, matrix, _, y = problem(device, noise=0.5)
    rows, columns = np.asarray(matrix.sum(axis=1)).ravel(), np.asarray(matrix.sum(axis=0)).ravel()
    rays = np.where(rows > 1e-3 * rows.max(), 1 / np.maximum(rows, 1e-30), 0)
    x = np.zeros(matrix.shape[1])
    for _ in range(12):
        x += 1.5 / columns * (matrix.T @ (rays * (y.ravel() - matrix @ x)))
        x = np.maximum(x, 0) if nonnegative else x
    found = sirt(A, y, 12, relaxation=1.5, nonnegative=nonnegative).ravel()
    np.testing.assert_allclose(found, x, atol=2e-4 * np.abs(x).max())
    assert nonnegative == (found.min() >= 0)


def objective(A, y, weight, image, F=None):
    residual = A(image).astype(float) - y
    square = np.vdot(residual, residual if F is None else F(residual))
    return square / 2 + weight * twin.total_variation(image, A.grid.spacing)


@pytest.mark.full
@pytest.mark.parametrize(
    ("precondition", "nonnegative", "weight"),
    [(None, False, 0.2), (None, True, 0.02), ("ramp", True, 0.2), ("ramp", False, 0.02)],
)
def test_fista_and_pdhg_reach_the_same_minimum(device, weight, nonnegative, precondition):
    A, _, _, y = problem(device, noise=0.1)
    given = {"nonnegative": nonnegative, "precondition": precondition}
    fista, pdhg = (method(A, y, weight, **given) for method in (Fista, Pdhg))
    values = [finished(solver, 200)[-1].values["objective"] for solver in (fista, pdhg)]
    assert values[0] == pytest.approx(values[1], rel=1e-3)
    for solver, value in zip((fista, pdhg), values, strict=True):
        image = device.get(solver.image)
        F = solver.data.weight
        assert objective(A, y, weight, image, F) == pytest.approx(value, rel=1e-4)
        assert not nonnegative or image.min() >= 0
        for _ in range(20):
            aside = image + 0.01 * RANDOM.standard_normal(image.shape).astype(np.float32)
            aside = np.maximum(aside, 0) if nonnegative else aside
            assert objective(A, y, weight, aside, F) > value


@pytest.mark.full
@pytest.mark.parametrize("precondition", [None, "ramp"])
@pytest.mark.parametrize("factor", [100, 1000])
def test_pdhg_is_near_the_minimum_whatever_the_weight(device, factor, precondition):
    A, _, _, y = problem(device, noise=0.1)
    weight = factor * variation_weight(A, y)
    given = {"precondition": precondition}
    best = finished(Fista(A, y, weight, **given), 200)[-1].values["objective"]
    found = finished(Pdhg(A, y, weight, **given), 200)[-1].values["objective"]
    assert found < best * (1 + 4e-3)


@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_steps_of_pdhg_converge_whatever_the_weight(device, precondition):
    """Steps times norms are 1 together; weak weights leave the usual steps, and y of zeros does."""
    A, _, _, y = problem(device, noise=0.1)
    taus = []
    for weight, data in ((0.0, y), (1e-3, y), (0.1, 0 * y), (10.0, y), (1e12, y)):
        solver = Pdhg(A, data, weight, precondition=precondition)
        slope = solver._sigma * solver._largest + solver._step * solver.variation.norm_squared
        assert solver._tau * slope == pytest.approx(1, rel=1e-12)
        taus.append(solver._tau)
    assert taus[0] == taus[1] == taus[2] > taus[3] > taus[4] > 0


@pytest.mark.full
def test_total_variation_bounds_the_gap_to_its_dual(device):
    """No image has a lower objective than the dual of PDHG says."""
    A, matrix, _, y = problem(device, noise=0.1)
    weight = 0.3
    solver = Pdhg(A, y, weight)
    value = finished(solver, 300)[-1].values["objective"]
    p = device.get(solver._now.data_dual).astype(float).ravel()
    u = device.get(solver._now.dual)
    assert np.sqrt((u.astype(float) ** 2).sum(axis=0)).max() <= weight * 0.8 * (1 + 1e-5)
    # The dual is feasible where A'p + D'u = 0, which is reached in the limit only.
    lack = matrix.T @ p + twin.gradient_adjoint(u, GRID.spacing).ravel()
    image = device.get(solver.image).astype(float).ravel()
    dual = -(p @ p) / 2 - p @ y.ravel() + lack @ image
    assert (value - dual) / value < 1e-3


def test_weight_zero_is_least_squares(device):
    A, _, _, y = problem(device, noise=0.05)
    flat = tv(A, y, 0.0, 100, method="fista", precondition="ramp")
    expected = cgls(A, y, 40, precondition="ramp")
    gap = np.linalg.norm(A(flat) - A(expected)) / np.linalg.norm(y)
    assert gap < 2e-3


@every_method
@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_reports_tell_the_residual_of_the_image(device, method, precondition):
    A, _, _, y = problem(device, noise=0.1)
    solver = method(A, y, precondition=precondition)
    reports = finished(solver, 7)
    assert [(r.done, r.total, r.what) for r in reports] == [
        (k, 7, "iterations") for k in range(1, 8)
    ]
    residual = A(device.get(solver.image)) - y
    expected = np.sqrt(np.mean(residual.astype(float) ** 2))
    assert reports[-1].values["residual"] == pytest.approx(expected, rel=1e-3)
    assert finished(solver, 7) == []
    assert [r.done for r in finished(solver, 9)] == [8, 9]


@every_method
@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_a_run_stops_when_the_residual_is_down_to_the_noise(device, method, precondition):
    noise = 0.1
    A, _, _, y = problem(device, noise=noise)
    reports = finished(method(A, y, precondition=precondition, noise=noise), 500)
    residuals = [report.values["residual"] for report in reports]
    # SIRT under a ramp may end on the weighted residual, which the plain one follows.
    assert residuals[-1] <= noise * (1.2 if method is Sirt and precondition else 1)
    assert min(residuals[:-1], default=1) > noise
    assert reports[-1].total == 500


@every_method
def test_a_start_that_fits_already_is_left_alone(device, method):
    A, _, truth, _ = problem(device)
    start = truth.astype(np.float32)
    solver = method(A, A(start), start=start, noise=1e-3)
    assert finished(solver, 50) == []
    assert solver.finished
    assert np.array_equal(device.get(solver.image), start)


@every_method
@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_a_resumed_run_gives_the_same_bits(device, method, precondition):
    A, _, _, y = problem(device, noise=0.1)
    whole = method(A, y, precondition=precondition)
    finished(whole, 9)
    first = method(A, y, precondition=precondition)
    finished(first, 4)
    second = method(A, y, precondition=precondition, start=np.ones(A.domain))
    second.restore(first.state())
    reports = finished(second, 9)
    assert [report.done for report in reports] == [5, 6, 7, 8, 9]
    end, expected = second.state(), whole.state()
    assert end.keys() == expected.keys()
    for name, value in expected.items():
        assert np.array_equal(end[name], value), name


@every_method
def test_a_volume_and_its_slices(device, method):
    grid = Grid((3, *GRID.shape), spacing=(2.0, *GRID.spacing))
    A, one = Projector(grid, SCAN, device=device), Projector(GRID, SCAN, device=device)
    y = problem(device)[3]
    stack = np.stack([y, 0 * y, 2 * y], axis=1)
    solver = method(A, stack, precondition="ramp")
    residuals = [report.values["residual"] for report in finished(solver, 20)]
    assert residuals[-1] < 0.2 * residuals[0]
    if isinstance(solver, Sirt):
        alone = method(one, y, precondition="ramp")
        finished(alone, 20)
        found = device.get(solver.image)
        np.testing.assert_allclose(found[0], device.get(alone.image), rtol=0.1, atol=0.05)
        np.testing.assert_allclose(found[2], 2 * found[0], atol=1e-4)


def test_any_operator_will_do(device):
    random = np.random.default_rng(3)
    matrix = random.random((40, 30)) / 60 + np.eye(40, 30)
    A = Matrix(matrix, (5, 6), (40,), device)
    truth = random.random((5, 6)).astype(np.float32)
    y = A(truth)
    for found in (cgls(A, y, 20), sirt(A, y, 40), tv(A, y, 1e-5, 40, method="fista")):
        np.testing.assert_allclose(A(found), y, rtol=5e-3)
