"""Solvers refuse what cannot be used in one sentence, and end well on what is odd but possible."""

from __future__ import annotations

import numpy as np
import pytest
from solver_cases import GRID, METHODS, SCAN, Matrix, finished, problem

from rift_cl import Grid, Parallel, Projector
from rift_cl.errors import CheckpointError, DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.operators import Ramp, ViewFilter
from rift_cl.reconstruct.solvers.conjugate_gradients import Cgls, cgls
from rift_cl.reconstruct.solvers.fista import Fista
from rift_cl.reconstruct.solvers.simultaneous_iteration import sirt
from rift_cl.reconstruct.solvers.tv import tv

pytestmark = pytest.mark.once

every_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
FUNCTIONS = {
    "cgls": cgls,
    "sirt": sirt,
    "pdhg": lambda A, y, steps=20, **given: tv(A, y, 0.1, steps, **given),
    "fista": lambda A, y, steps=20, **given: tv(A, y, 0.1, steps, method="fista", **given),
}
every_function = pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)


@every_function
@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_no_data_gives_no_image(device, function, precondition):
    A, _, _, y = problem(device)
    assert not function(A, 0 * y, precondition=precondition).any()
    assert not function(A, 0 * y, precondition=precondition, noise=0.1).any()


@every_function
def test_an_operator_of_zeros_leaves_the_start(device, function):
    A = Matrix(np.zeros((12, 20)), (4, 5), (12,), device)
    image = function(A, np.ones(12), noise=1e-3)
    assert image.shape == (4, 5)
    assert not image.any()


@every_function
@pytest.mark.parametrize("precondition", [None, "ramp"])
@pytest.mark.parametrize(("angles", "bins"), [([0.3], 33), (SCAN.angles, 12), ([0.2, 0.2, 0.2], 1)])
def test_one_view_and_truncated_views_end_well(device, function, precondition, angles, bins):
    scan = Parallel(angles, bins, 0.9)
    A, _, _, y = problem(device, noise=0.05, scan=scan)
    image = function(A, y, 40, precondition=precondition, noise=0.05)
    assert np.isfinite(image).all()
    assert np.linalg.norm(A(image) - y) < 0.3 * np.linalg.norm(y)


@pytest.mark.parametrize("method", ["pdhg", "fista"])
def test_total_variation_has_no_scale_but_the_ends_of_the_type(device, method):
    A, _, _, y = problem(device)
    usual = tv(A, y, 0.1, 20, method=method)
    for factor in (1e-13, 1e13):
        scaled = tv(A, factor * y, factor * 0.1, 20, method=method)
        np.testing.assert_allclose(scaled / factor, usual, atol=1e-4 * usual.max())
    for factor in (1e-21, 1e21):
        with pytest.raises(NonFiniteError, match="scale y"):
            tv(A, np.float32(factor) * y, factor * 0.1, 20, method=method)


@every_function
def test_rays_that_miss_everything_are_no_trouble(device, function):
    A = Projector(Grid((6, 6), center=(500, 500)), Parallel([0.1, 1.0], 9), device=device)
    assert not function(A, np.ones(A.range)).any()


@every_function
def test_results_stay_where_the_data_are(device, function):
    A, _, _, y = problem(device)
    out = np.empty(A.domain, np.float32)
    kept = y.copy()
    assert function(A, y, 5, out=out) is out
    there = function(A, device.array(y), 5)
    assert np.array_equal(device.get(there), out)
    again = device.empty(A.domain)
    assert function(A, device.array(y), 5, out=again) is again
    assert np.array_equal(device.get(again), out)
    assert np.array_equal(y, kept)


@every_function
def test_no_steps_give_the_start_which_stays_as_it_is(device, function):
    A, _, truth, y = problem(device)
    start = device.array(truth)
    image = function(A, device.array(y), 0, start=start)
    assert image is not start
    assert np.array_equal(device.get(image), device.get(start))
    function(A, device.array(y), 3, start=start)
    assert np.array_equal(device.get(start), truth.astype(np.float32))
    assert not function(A, y, 0).any()


@every_function
def test_negative_values_are_cut_where_asked(device, function):
    if function is cgls:
        with pytest.raises(TypeError):
            function(None, None, nonnegative=True)
        return
    A, _, _, y = problem(device, noise=1.0)
    start = -np.ones(A.domain)
    assert function(A, y, 10, nonnegative=True, start=start).min() >= 0
    assert function(A, y, 0, nonnegative=True, start=start).min() >= 0


@every_function
def test_data_that_cannot_be_used_are_refused(device, function):
    A, _, _, y = problem(device)
    with pytest.raises(ShapeError, match=r"y has shape \(18, 32\)"):
        function(A, y[:, :-1])
    spoilt = y.copy()
    spoilt[3, 4] = np.nan
    with pytest.raises(NonFiniteError, match=r"y holds NaN.*\(3, 4\)"):
        function(A, spoilt)
    with pytest.raises(NonFiniteError, match="y holds NaN"):
        function(A, device.array(spoilt))
    with pytest.raises(NonFiniteError, match="start holds NaN"):
        function(A, y, start=np.full(A.domain, np.inf))
    with pytest.raises(DTypeError, match="y has type complex"):
        function(A, y + 1j)
    with pytest.raises(ShapeError, match="start has shape"):
        function(A, y, start=np.zeros(3))
    with pytest.raises(ShapeError, match="out has shape"):
        function(A, y, out=np.zeros((2, 2), np.float32))
    with pytest.raises(DTypeError, match="out is a ndarray"):
        function(A, device.array(y), out=np.zeros(A.domain, np.float32))


@every_function
def test_arguments_that_make_no_sense_are_refused(device, function):
    A, _, _, y = problem(device)
    for noise in (-1, np.nan, "much"):
        with pytest.raises(InputError, match="noise is"):
            function(A, y, noise=noise)
    for steps in (-1, 2.5, None):
        with pytest.raises(InputError, match=f"steps is {steps}"):
            function(A, y, steps)
    with pytest.raises(InputError, match="A is a str"):
        function("A", y)
    with pytest.raises(InputError, match=r"precondition is 'hann'"):
        function(A, y, precondition="hann")


@every_function
def test_preconditions_that_do_not_fit_are_refused(device, function):
    A, _, _, y = problem(device)
    other = ViewFilter(Parallel(SCAN.angles, 40), Ramp(), device=device)
    with pytest.raises(ShapeError, match=r"\(18, 40\).*A.range \(18, 33\)"):
        function(A, y, precondition=other)
    plain = Matrix(np.eye(20), (4, 5), (20,), device)
    with pytest.raises(InputError, match=r"Matrix.*scan"):
        function(plain, np.ones(20), precondition="ramp")
    if device.traits.fp64:
        double = ViewFilter(SCAN, Ramp(), device=device, dtype="float64")
        with pytest.raises(DTypeError, match="float64, A in float32"):
            function(A, y, precondition=double)


@pytest.mark.parametrize("signs", [[-1.0], [1.0, -3.0]], ids=["negative", "mixed"])
def test_conjugate_gradients_name_a_preconditioner_that_is_not_positive(device, signs):
    A = Matrix(np.random.default_rng(0).standard_normal((12, 8)), (8,), (12,), device)
    F = Matrix(np.diag(np.resize(signs, 12)), (12,), (12,), device)
    with pytest.raises(InputError, match="precondition is not positive"):
        cgls(A, np.ones(12), 5, precondition=F)


def test_conjugate_gradients_end_well_where_a_preconditioner_leaves_out_samples(device):
    matrix = np.random.default_rng(0).standard_normal((12, 8))
    kept, y = np.arange(12) < 5, np.ones(12)
    A, F = Matrix(matrix, (8,), (12,), device), Matrix(np.diag(1.0 * kept), (12,), (12,), device)
    found = cgls(A, y, 100, precondition=F)
    assert found == pytest.approx(np.linalg.pinv(matrix[kept]) @ y[kept], abs=1e-4)


@pytest.mark.parametrize("subsets", [1, 2])
def test_sirt_that_diverges_names_the_cause(device, subsets):
    A = Matrix(np.repeat([[3, -2.5], [-2.5, 3]], 2, axis=0), (2,), (4,), device)
    with pytest.raises(InputError, match=r"SIRT diverges.*A has negative weights"):
        sirt(A, np.array([1.0, 1.0, -1.0, -1.0]), 50, subsets=subsets)


def test_what_only_some_methods_take(device):
    A, _, _, y = problem(device)
    with pytest.raises(InputError, match="method is 'admm'"):
        tv(A, y, 0.1, method="admm")
    for weight in (-1, np.nan, None):
        with pytest.raises(InputError, match="weight is"):
            tv(A, y, weight)
    for relaxation in (0, 2, np.inf):
        with pytest.raises(InputError, match="relaxation is"):
            sirt(A, y, relaxation=relaxation)
    with pytest.raises(InputError, match="inner is -3"):
        Fista(A, y, 0.1, inner=-3)
    with pytest.raises(ShapeError, match=r"\(20,\)"):
        tv(Matrix(np.eye(20), (20,), (20,), device), np.ones(20), 0.1)
    with pytest.raises(InputError, match="negative sum"):
        sirt(Matrix(-np.eye(20), (20,), (20,), device), np.ones(20))


def test_data_beyond_the_range_of_their_type_say_so(device):
    A, _, _, y = problem(device)
    with pytest.raises(NonFiniteError, match="scale"):
        cgls(A, y * np.float32(1e36))


@pytest.mark.parametrize("power", [-70, -40, 50, 80])
def test_no_unit_of_data_weights_or_lengths_changes_the_image(device, power):
    A, _, _, y = problem(device)
    factor = float(np.ldexp(1.0, power))
    weights = np.exp(-y / y.max())
    plain, weighted = cgls(A, y, 4), cgls(A, y, 4, weights=weights)
    assert cgls(A, np.ldexp(y, power), 4) / factor == pytest.approx(plain, rel=1e-4, abs=1e-6)
    if power < 80:
        heavier = cgls(A, y, 4, weights=np.ldexp(weights, power))
        assert heavier == pytest.approx(weighted, rel=1e-4, abs=1e-6)
    length = float(np.ldexp(1.0, power // 2))
    grid = Grid(GRID.shape, tuple(np.multiply(GRID.spacing, length)))
    scan = Parallel(SCAN.angles, SCAN.bins, SCAN.pitch * length)
    longer = cgls(Projector(grid, scan, device=device), y, 4)
    assert longer * length == pytest.approx(plain, rel=1e-4, abs=1e-6)


@every_method
def test_states_of_others_are_refused(device, method):
    A, _, _, y = problem(device)
    solver = method(A, y)
    finished(solver, 2)
    state = solver.state()
    other = Projector(Grid((20, 25)), SCAN, device=device)
    with pytest.raises(CheckpointError, match=r"wanted .*image"):
        method(other, y).restore(state)
    for change in ({"image": state["image"][1:]}, {"direction": np.zeros(3), "extra": 1}):
        with pytest.raises(CheckpointError):
            method(A, y).restore({**state, **change})
    with pytest.raises(CheckpointError):
        method(A, y).restore({})
    spoilt = {**state, "image": np.full_like(state["image"], np.nan)}
    with pytest.raises(CheckpointError, match="image"):
        method(A, y).restore(spoilt)


def test_a_method_that_ended_goes_on_from_a_restored_state(device):
    A, _, _, y = problem(device)
    solver = Cgls(A, y, noise=1e9)
    assert solver.finished
    early = Cgls(A, y)
    finished(early, 2)
    fresh = Cgls(A, y)
    fresh.restore(early.state())
    assert not fresh.finished
    assert GRID.shape == fresh.image.shape
