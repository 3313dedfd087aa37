"""Conjugate gradients with ridge, diagonal and held samples: laws, and a dense solution."""

from __future__ import annotations

import numpy as np
import pytest
from solver_cases import Matrix

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.reconstruct import Cgls, cgls, mean_diagonal

pytestmark = pytest.mark.dealt

SHAPE, PICTURES = (5, 3), (4, 6, 2)


@pytest.fixture
def problem():
    random = np.random.default_rng(1)
    dense = random.normal(size=(48, 15)) * np.logspace(0, 2, 15)
    return dense, random.normal(size=PICTURES)


@pytest.fixture
def device64(device):
    if not device.traits.fp64:
        pytest.skip("a device without float64")
    return device


def operator(dense, device, dtype="float64"):
    return Matrix(dense, SHAPE, PICTURES, device, dtype)


def diagonal_of(dense):
    return (dense**2).sum(0).reshape(SHAPE)


def ridge_solution(dense, targets, ridge):
    normal = dense.T @ dense + ridge * np.eye(dense.shape[1])
    return np.linalg.solve(normal, dense.T @ targets.ravel()).reshape(SHAPE)


def finished(A, y, steps, **given):
    solver = Cgls(A, y, **given)
    for _ in solver.run(steps):
        pass
    return solver


def loss_of(dense, targets, c, ridge):
    return np.square(dense @ c.ravel() - targets.ravel()).sum() + ridge * np.square(c).sum()


@pytest.mark.parametrize("ridge", [0.0, 1e-3, 10.0])
def test_equals_the_dense_ridge_solution(device64, problem, ridge):
    dense, targets = problem
    A = operator(dense, device64)
    found = cgls(A, targets, 60, ridge=ridge, diagonal=diagonal_of(dense))
    wanted = ridge_solution(dense, targets, ridge)
    np.testing.assert_allclose(found, wanted, atol=1e-10 * np.abs(wanted).max())


def test_float32_finds_the_dense_ridge_solution_to_its_rounding(device, problem):
    dense, targets = problem
    A = operator(dense, device, "float32")
    found = cgls(A, targets, 40, ridge=1.0, diagonal=diagonal_of(dense))
    wanted = ridge_solution(dense, targets, 1.0)
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())


@pytest.mark.parametrize("ridge", [0.0, 5.0])
def test_the_residual_is_orthogonal_to_the_span_up_to_the_ridge(device64, problem, ridge):
    dense, targets = problem
    A = operator(dense, device64)
    solver = finished(A, targets, 60, ridge=ridge, diagonal=diagonal_of(dense))
    c, residual = solver.image.get(), solver.residual.get()
    np.testing.assert_allclose(residual, A(c) - targets, atol=1e-11)
    left = A.T(residual) + ridge * c
    assert np.abs(left).max() < 1e-9 * np.abs(A.T(targets)).max()
    assert solver.loss == pytest.approx(loss_of(dense, targets, c, ridge))


def test_the_gradient_by_the_geometry_is_the_partial_one_at_the_solution(device64):
    # The envelope theorem: columns move with t, coefficients are solved again for each t.
    random = np.random.default_rng(2)
    columns, moves = random.normal(size=(2, 48, 15))
    targets, ridge = random.normal(size=PICTURES), 0.3

    def solved(t):
        return finished(operator(columns + t * moves, device64), targets, 60, ridge=ridge)

    found = solved(0.0)
    partial = 2 * found.residual.get().ravel() @ moves @ found.image.get().ravel()
    slope = (solved(1e-5).loss - solved(-1e-5).loss) / 2e-5
    assert slope == pytest.approx(partial, rel=1e-6)


def test_each_step_lowers_the_loss_and_a_start_is_gone_on_from(device64, problem):
    dense, targets = problem
    A = operator(dense, device64)
    losses = [finished(A, targets, n, ridge=0.1).loss for n in range(12)]
    assert np.all(np.diff(losses) < 0)
    begun = finished(A, targets, 5, ridge=0.1)
    more = finished(A, targets, 5, ridge=0.1, start=begun.image.get())
    assert more.loss < begun.loss


def test_a_restored_run_goes_on_to_the_same_bits(device, problem):
    dense, targets = problem
    free = np.random.default_rng(5).random(SHAPE) < 0.6
    given = {"ridge": 0.1, "diagonal": diagonal_of(dense), "free": free, "start": np.ones(SHAPE)}
    whole, part = (Cgls(operator(dense, device, "float32"), targets, **given) for _ in range(2))
    other = Cgls(operator(dense, device, "float32"), targets, **given)
    list(whole.run(7))
    list(part.run(3))
    other.restore(part.state())
    list(other.run(7))
    assert other.image.get().tobytes() == whole.image.get().tobytes()
    assert other.loss == whole.loss


def test_the_diagonal_makes_badly_scaled_columns_easy(device64, problem):
    dense, targets = problem
    A, wanted = operator(dense, device64), ridge_solution(dense, targets, 1e-3)

    def error(**given):
        return np.abs(cgls(A, targets, 10, ridge=1e-3, **given) - wanted).max()

    assert error(diagonal=diagonal_of(dense)) < 0.1 * error()


def test_the_last_step_asks_for_no_adjoint(device64, problem):
    dense, targets = problem
    A, asked = operator(dense, device64), []
    plain = A._apply_adjoint
    A._apply_adjoint = lambda y, out: asked.append(1) or plain(y, out)
    cgls(A, targets, 4)
    assert len(asked) == 4


def test_mean_diagonal_is_that_of_orthogonal_columns(device64, problem):
    columns = np.linalg.qr(problem[0])[0] * np.arange(1.0, 16)
    wanted = (np.arange(1.0, 16) ** 2).mean()
    assert mean_diagonal(operator(columns, device64)) == pytest.approx(wanted, rel=1e-12)


def test_more_steps_than_float32_can_use_do_no_harm(device):
    """Gradients end as rounding, by which conjugate gradients would go astray ever faster."""
    random = np.random.default_rng(4)
    dense, true = random.normal(size=(48, 6)), random.normal(size=(6, 1))
    targets = (dense.astype(np.float32) @ true).reshape(PICTURES)
    A = Matrix(dense.astype(np.float32), (6, 1), PICTURES, device)
    for steps in (8, 40, 400):
        np.testing.assert_allclose(cgls(A, targets, steps, ridge=1e-6), true, atol=1e-5)


def test_what_is_held_stays_and_the_rest_is_solved_around_it(device64, problem):
    dense, targets = problem
    random = np.random.default_rng(5)
    free, start = random.random(SHAPE) < 0.6, random.normal(size=SHAPE)
    A = operator(dense, device64)
    assert Cgls(A, targets, ridge=2.0, start=start, free=free).loss == pytest.approx(
        loss_of(dense, targets, start, 2.0)
    )
    found = cgls(A, targets, 60, ridge=2.0, start=start, free=free)
    assert np.array_equal(found[~free], start[~free])
    fixed = dense @ np.where(free, 0, start).ravel()
    some = dense[:, free.ravel()]
    normal = some.T @ some + 2.0 * np.eye(some.shape[1])
    wanted = np.linalg.solve(normal, some.T @ (targets.ravel() - fixed))
    np.testing.assert_allclose(found[free], wanted, atol=1e-8 * np.abs(wanted).max())


def test_nothing_to_show_takes_no_step(device, problem):
    solver = finished(operator(problem[0], device, "float32"), np.zeros(PICTURES), 3, ridge=1.0)
    assert solver.state()["step"] == 0 and not solver.image.get().any()


@pytest.mark.parametrize(
    ("given", "error", "word"),
    [
        ({"ridge": -1.0}, InputError, "ridge"),
        ({"ridge": np.nan}, InputError, "ridge"),
        ({"diagonal": np.zeros(SHAPE)}, InputError, "diagonal"),
        ({"diagonal": np.full(SHAPE, np.nan)}, InputError, "diagonal"),
        ({"diagonal": np.ones(3)}, ShapeError, "diagonal"),
        ({"free": np.ones((2, 3), bool)}, ShapeError, "free"),
        ({"free": np.ones(SHAPE)}, ShapeError, "free"),
        ({"start": np.zeros(15)}, ShapeError, "start"),
    ],
)
def test_what_does_not_fit_is_refused(device, problem, given, error, word):
    with pytest.raises(error, match=word):
        Cgls(operator(problem[0], device, "float32"), problem[1], **given)


def test_data_that_are_no_numbers_are_refused(device, problem):
    with pytest.raises(NonFiniteError, match="y"):
        cgls(operator(problem[0], device, "float32"), problem[1] * np.nan, 2)
