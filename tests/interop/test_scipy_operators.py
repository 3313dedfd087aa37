"""SciPy and PyLops see an operator as the matrix that it is, and their solvers use it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import linalg

import rift_cl as rift
from rift_cl.errors import DTypeError, NonFiniteError
from rift_cl.interop.pylops import from_pylops
from rift_cl.interop.scipy import aslinearoperator
from rift_cl.reconstruct import FilteredBackprojection

pytestmark = pytest.mark.once

TYPES = ("float32", "float64")
SMALLEST = {"float32": 1e-5, "float64": 1e-13}


@pytest.fixture(params=TYPES)
def A(request, device):
    """A projector with more rows than columns."""
    if request.param == "float64" and not device.traits.fp64:
        pytest.skip("the device has no float64")
    grid, scan = rift.Grid((8, 9)), rift.Parallel(np.linspace(0, 3, 20), 15)
    return rift.Projector(grid, scan, device=device, dtype=request.param)


def white(*shape, dtype=np.float64):
    return np.random.default_rng(5).standard_normal(shape).astype(dtype)


def test_shape_type_and_values_are_the_operators(A):
    S, x = aslinearoperator(A), white(8, 9, dtype=A.dtype)
    assert (S.shape, S.dtype) == ((300, 72), A.dtype)
    assert np.array_equal(S @ x.ravel(), A(x).ravel())
    assert (S @ x.ravel()).dtype == A.dtype


@pytest.mark.full
def test_adjoint_and_transpose_are_the_transposed_matrix(A):
    S = aslinearoperator(A)
    matrix, near = S @ np.eye(72, dtype=A.dtype), SMALLEST[A.dtype.name]
    assert np.allclose(S.H @ np.eye(300), matrix.T, atol=near)
    assert np.allclose(S.T @ np.eye(300), matrix.T, atol=near)
    y = white(300, 4)
    assert np.allclose(S.rmatmat(y), matrix.T @ y, atol=20 * near)
    assert np.allclose(S.rmatvec(y[:, 0]), matrix.T @ y[:, 0], atol=20 * near)
    assert S.H.H.A is A


def test_results_have_the_type_that_a_matrix_would_give(A):
    S = aslinearoperator(A)
    for dtype in ("float32", "float64", "int32", "uint8"):
        wanted = np.result_type(A.dtype, dtype)
        assert S.matvec(np.ones(72, dtype)).dtype == wanted
        assert S.rmatmat(np.ones((300, 2), dtype)).dtype == wanted


@pytest.mark.parametrize("solver", [linalg.lsqr, linalg.lsmr])
def test_least_squares_solvers_find_the_image(A, solver):
    S, x = aslinearoperator(A), white(72)
    found = solver(S, S @ x, atol=1e-9, btol=1e-9)[0]
    assert np.linalg.norm(S @ (found - x)) < 1e-2 * np.linalg.norm(S @ x)


def test_conjugate_gradients_solve_the_normal_equations(A):
    S = aslinearoperator(A)
    y = S @ white(72)
    found, status = linalg.cg(S.H @ S, S.H @ y, rtol=1e-5)
    assert status == 0
    assert np.linalg.norm(S @ found - y) < 1e-2 * np.linalg.norm(y)


def test_singular_values_are_those_of_the_matrix(A):
    S = aslinearoperator(A)
    exact = np.linalg.svd(S @ np.eye(72), compute_uv=False)
    found = linalg.svds(S, k=3, return_singular_vectors=False, rng=np.random.default_rng(0))
    assert np.allclose(sorted(found, reverse=True), exact[:3], rtol=1e-5)


def test_scipys_algebra_of_operators_agrees_with_ours(A):
    S, x = aslinearoperator(A), white(72)
    assert np.allclose((2 * (S.H @ S)) @ x, (2 * (A.T @ A))(x.reshape(8, 9)).ravel(), rtol=1e-4)


def test_other_operators_have_a_view_too(device):
    scan = rift.Parallel(np.linspace(0, 3, 7), 9)
    B = FilteredBackprojection(rift.Projector(rift.Grid((3, 6, 5)), scan, device=device))
    S, y = aslinearoperator(B), white(7, 3, 9)
    assert S.shape == (3 * 6 * 5, 7 * 3 * 9)
    assert np.allclose(S @ y.ravel(), B(y).ravel())


BAD = {
    "complex": (lambda x: 1j * x, DTypeError, "complex128"),
    "text": (lambda x: x.astype(str), DTypeError, "type <U"),
    "NaN": (lambda x: np.where(x > 0, np.nan, x), NonFiniteError, "NaN"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_vector_that_cannot_be_used_is_named(A, case):
    change, error, words = BAD[case]
    with pytest.raises(error, match=words):
        aslinearoperator(A)._matvec(change(white(72)))


def test_what_is_no_operator_is_named():
    with pytest.raises(DTypeError, match="A is a ndarray"):
        aslinearoperator(np.eye(3))


def test_pylops_own_dot_test_passes_and_its_shapes_are_ours(A):
    pylops = pytest.importorskip("pylops", reason="PyLops is not installed")
    P = pylops.aslinearoperator(aslinearoperator(A))
    assert (P.dims, P.dimsd) == (A.domain, A.range)
    assert pylops.utils.dottest(P, rtol=1e2 * SMALLEST[A.dtype.name], raiseerror=True)
    x = white(8, 9, dtype=A.dtype)
    assert np.array_equal(P * x, A(x))
    assert np.array_equal(P.H * A(x), A.T(A(x)))


def test_pylops_solvers_and_products_take_it(A):
    pylops = pytest.importorskip("pylops", reason="PyLops is not installed")
    P = pylops.aslinearoperator(aslinearoperator(A))
    gradient = pylops.Gradient(P.dims, dtype=A.dtype)
    assert (gradient @ P.H).shape == (2 * math.prod(P.dims), 300)
    x = white(72, dtype=A.dtype)
    penalised = rift.vstack(
        A, from_pylops(pylops.Gradient(A.domain, dtype=A.dtype), device=A.device)
    )
    assert rift.dot_test(penalised) < 1e-6
    found = pylops.optimization.basic.cgls(P, P @ x, niter=30, tol=0)[0]
    assert np.linalg.norm(P @ (found.ravel() - x)) < 1e-2 * np.linalg.norm(P @ x)
