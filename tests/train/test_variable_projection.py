"""Ridge least squares without a matrix: laws of the solution, and agreement with a dense one."""

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.train.xray.variable_projection import mean_curvature, solve

SHAPE, PICTURES = (5, 3), (4, 6, 2)


@pytest.fixture
def problem():
    random = np.random.default_rng(1)
    dense = random.normal(size=(48, 15)) * np.logspace(0, 2, 15)
    targets = random.normal(size=PICTURES)
    return dense, targets


def maps(dense):
    def render(c):
        return (dense @ c.ravel()).reshape(PICTURES)

    def adjoint(pictures):
        return (dense.T @ pictures.ravel()).reshape(SHAPE)

    return render, adjoint


def ridge_solution(dense, targets, ridge):
    normal = dense.T @ dense + ridge * np.eye(dense.shape[1])
    return np.linalg.solve(normal, dense.T @ targets.ravel()).reshape(SHAPE)


@pytest.mark.parametrize("ridge", [0.0, 1e-3, 10.0])
def test_equals_the_dense_ridge_solution(problem, ridge):
    dense, targets = problem
    diagonal = (dense**2).sum(0).reshape(SHAPE)
    found = solve(*maps(dense), targets, ridge=ridge, iterations=60, diagonal=diagonal)
    wanted = ridge_solution(dense, targets, ridge)
    np.testing.assert_allclose(found.coefficients, wanted, atol=1e-10 * np.abs(wanted).max())


@pytest.mark.parametrize("ridge", [0.0, 5.0])
def test_the_residual_is_orthogonal_to_the_span_up_to_the_ridge(problem, ridge):
    dense, targets = problem
    render, adjoint = maps(dense)
    diagonal = (dense**2).sum(0).reshape(SHAPE)
    found = solve(render, adjoint, targets, ridge=ridge, iterations=60, diagonal=diagonal)
    np.testing.assert_allclose(found.residual, targets - render(found.coefficients), atol=1e-11)
    left = adjoint(found.residual) - ridge * found.coefficients
    assert np.abs(left).max() < 1e-9 * np.abs(adjoint(targets)).max()


def test_the_gradient_by_the_geometry_is_the_partial_one_at_the_solution():
    # The envelope theorem: columns move with t, coefficients are solved again for each t.
    random = np.random.default_rng(2)
    columns, moves = random.normal(size=(2, 48, 15))
    targets, ridge = random.normal(size=PICTURES), 0.3

    def solved(t):
        return solve(*maps(columns + t * moves), targets, ridge=ridge, iterations=60)

    def loss(t):
        found = solved(t)
        return (found.residual**2).sum() + ridge * (found.coefficients**2).sum()

    found = solved(0.0)
    partial = -2 * found.residual.ravel() @ moves @ found.coefficients.ravel()
    assert (loss(1e-5) - loss(-1e-5)) / 2e-5 == pytest.approx(partial, rel=1e-6)


def test_each_step_lowers_the_loss_and_a_start_is_gone_on_from(problem):
    dense, targets = problem
    render, adjoint = maps(dense)

    def loss(found):
        return (found.residual**2).sum() + 0.1 * (found.coefficients**2).sum()

    losses = [loss(solve(render, adjoint, targets, ridge=0.1, iterations=n)) for n in range(1, 12)]
    assert np.all(np.diff(losses) < 0)
    begun = solve(render, adjoint, targets, ridge=0.1, iterations=5)
    more = solve(render, adjoint, targets, ridge=0.1, iterations=5, start=begun.coefficients)
    assert loss(more) < loss(begun)


def test_the_diagonal_makes_badly_scaled_columns_easy(problem):
    dense, targets = problem
    diagonal = (dense**2).sum(0).reshape(SHAPE)
    wanted = ridge_solution(dense, targets, 1e-3)

    def error(**given):
        found = solve(*maps(dense), targets, ridge=1e-3, iterations=10, **given)
        return np.abs(found.coefficients - wanted).max()

    assert error(diagonal=diagonal) < 0.1 * error()


def test_the_last_step_asks_for_no_adjoint(problem):
    dense, targets = problem
    render, adjoint = maps(dense)
    asked = []

    def counted(pictures):
        asked.append(1)
        return adjoint(pictures)

    solve(render, counted, targets, ridge=0.0, iterations=4)
    assert len(asked) == 4


def test_nothing_to_show_takes_no_step(problem):
    found = solve(*maps(problem[0]), np.zeros(PICTURES), ridge=0.0, iterations=3)
    assert found.steps == 0
    assert not found.coefficients.any()


def test_a_solution_is_reached_and_kept():
    dense = np.eye(48, 15)
    targets = np.arange(48.0).reshape(PICTURES)
    found = solve(*maps(dense), targets, ridge=0.0, iterations=50)
    assert found.steps < 5
    np.testing.assert_allclose(found.coefficients.ravel(), np.arange(15.0), atol=1e-9)


def test_mean_curvature_is_that_of_orthogonal_columns(problem):
    columns = np.linalg.qr(problem[0])[0] * np.arange(1.0, 16)
    render, _ = maps(columns)
    wanted = (np.arange(1.0, 16) ** 2).mean()
    assert mean_curvature(render, SHAPE) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "error", "word"),
    [
        ({"ridge": -1.0}, InputError, "ridge is -1.0"),
        ({"ridge": np.nan}, InputError, "ridge is nan"),
        ({"iterations": 0}, InputError, "iterations is 0"),
        ({"iterations": 2.5}, InputError, "iterations is 2.5"),
        ({"diagonal": np.zeros(SHAPE)}, InputError, "not positive"),
        ({"diagonal": np.ones(3)}, ShapeError, r"diagonal has shape \(3,\)"),
    ],
)
def test_what_does_not_fit_is_refused(problem, given, error, word):
    with pytest.raises(error, match=word):
        solve(*maps(problem[0]), problem[1], **{"ridge": 0.1, "iterations": 3, **given})


def test_pictures_of_another_shape_and_no_numbers_are_refused(problem):
    dense, targets = problem
    render, adjoint = maps(dense)
    with pytest.raises(ShapeError, match="pictures have shape"):
        solve(lambda c: render(c)[0], adjoint, targets, ridge=0.0, iterations=2)
    with pytest.raises(NonFiniteError, match="rendered"):
        solve(lambda c: render(c) * np.inf, adjoint, targets, ridge=0.0, iterations=2)
    with pytest.raises(NonFiniteError, match="targets"):
        solve(render, adjoint, targets * np.nan, ridge=0.0, iterations=2)
    with pytest.raises(ShapeError, match="start has shape"):
        solve(render, adjoint, targets, ridge=0.0, iterations=2, start=np.zeros(15))


def test_more_steps_than_float32_can_use_do_no_harm():
    """Gradients end as rounding, by which conjugate gradients would go astray ever faster."""
    random = np.random.default_rng(4)
    dense = random.normal(size=(48, 6)).astype(np.float32)
    true = random.normal(size=(6, 1))
    targets = (dense.astype(float) @ true.ravel()).reshape(PICTURES)

    def render(c):
        return (dense @ c.ravel().astype(np.float32)).reshape(PICTURES)

    def adjoint(pictures):
        return (dense.T @ pictures.ravel().astype(np.float32)).reshape(6, 1).astype(float)

    for iterations in (8, 40, 400):
        found = solve(render, adjoint, targets, ridge=1e-6, iterations=iterations)
        np.testing.assert_allclose(found.coefficients, true, atol=1e-5)
        assert found.steps <= iterations


def test_what_is_held_stays_and_the_rest_is_solved_around_it(problem):
    dense, targets = problem
    random = np.random.default_rng(5)
    free, start = random.random(SHAPE) < 0.6, random.normal(size=SHAPE)
    found = solve(*maps(dense), targets, ridge=2.0, iterations=60, start=start, free=free)
    assert np.array_equal(found.coefficients[~free], start[~free])
    fixed = dense @ np.where(free, 0, start).ravel()
    some = dense[:, free.ravel()]
    normal = some.T @ some + 2.0 * np.eye(some.shape[1])
    wanted = np.linalg.solve(normal, some.T @ (targets.ravel() - fixed))
    np.testing.assert_allclose(found.coefficients[free], wanted, atol=1e-8 * np.abs(wanted).max())
    loss = np.square(targets.ravel() - dense @ start.ravel()).sum() + 2.0 * np.square(start).sum()
    assert found.loss_before == pytest.approx(loss)
    with pytest.raises(ShapeError, match="free has shape"):
        solve(*maps(dense), targets, ridge=0, iterations=1, free=free[:2])
