"""PyLops' operators and ours are each other's: adjoints, solvers, products."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import scipy.sparse.linalg
from scipy.sparse.linalg import aslinearoperator as scipy_operator

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ShapeError
from rift_cl.interop.pylops import from_pylops, to_pylops
from rift_cl.operators.host_operator import HostOperator

pytestmark = pytest.mark.once


def projector(device, dtype="float32"):
    grid, scan = rift.Grid((6, 7)), rift.Parallel(np.linspace(0, 3, 8), 9)
    return rift.Projector(grid, scan, device=device, dtype=dtype)


def white(*shape):
    return np.random.default_rng(5).standard_normal(shape).astype(np.float32)


def test_our_operator_passes_their_dot_test_and_their_solver(device):
    pylops = pytest.importorskip("pylops", reason="PyLops is not installed")
    A, x = projector(device), white(6, 7)
    P = to_pylops(A)
    assert (P.dims, P.dimsd) == (A.domain, A.range)
    # It draws its vectors from NumPy's global generator.
    np.random.seed(0)  # noqa: NPY002
    assert pylops.utils.dottest(P, rtol=1e-3, raiseerror=True)
    found = pylops.optimization.basic.cgls(P, A(x).ravel(), niter=60, tol=0)[0]
    assert np.linalg.norm(A(found.reshape(6, 7)) - A(x)) < 1e-2 * np.linalg.norm(A(x))


def test_their_operator_passes_our_dot_test_and_goes_into_our_algebra(device):
    pylops = pytest.importorskip("pylops", reason="PyLops is not installed")
    D = pylops.FirstDerivative((6, 7), axis=0, dtype="float32")
    ours, x = from_pylops(D, device=device), white(6, 7)
    assert (ours.domain, ours.range) == ((6, 7), (6, 7))
    assert np.allclose(ours(x), D @ x, atol=1e-6)
    assert rift.dot_test(ours) < 1e-6
    A = projector(device)
    product = A @ ours
    assert rift.dot_test(product) < 1e-5
    assert np.allclose(product(x), A(ours(x)), atol=1e-5)
    assert np.array_equal(device.get(ours(device.array(x))), ours(x))


def test_a_round_trip_gives_the_same_numbers(device):
    pytest.importorskip("pylops", reason="PyLops is not installed")
    A, x = projector(device), white(6, 7)
    assert np.array_equal(from_pylops(to_pylops(A), device=device)(x), A(x))


def test_an_operator_of_scipy_is_taken_too(device):
    matrix = white(5, 4)
    S = from_pylops(scipy_operator(matrix), device=device)
    assert (S.domain, S.range, S.dtype) == ((4,), (5,), np.float32)
    assert rift.dot_test(S) < 1e-6
    assert np.allclose(S(np.ones(4)), matrix.sum(1), atol=1e-6)


def test_what_cannot_be_an_operator_of_ours_is_named(device):
    with pytest.raises(DTypeError, match="P is a ndarray without matvec"):
        from_pylops(np.eye(3), device=device)
    with pytest.raises(DTypeError, match="complex128"):
        from_pylops(scipy_operator(1j * np.eye(3)), device=device)
    with pytest.raises(DTypeError, match="A is a int"):
        to_pylops(3)


def test_an_operator_of_scipy_without_an_adjoint_says_so_when_it_is_wanted(device):
    given = scipy.sparse.linalg.LinearOperator((5, 5), matvec=lambda x: 2 * x, dtype=np.float32)
    A, ones = from_pylops(given, device=device), np.ones(5, np.float32)
    assert np.array_equal(A(ones), 2 * ones)
    with pytest.raises(DTypeError, match=r"P is a .* without an adjoint.*rmatvec="):
        A.T(ones)


@pytest.mark.parametrize("name", ["matvec", "rmatvec"])
def test_a_function_that_gives_another_length_is_named(device, name):
    functions = {
        "matvec": lambda x: x.sum() * np.ones(5),
        "rmatvec": lambda y: y.sum() * np.ones(4),
    }
    functions[name] = np.array
    given = scipy.sparse.linalg.LinearOperator((5, 4), dtype=np.float32, **functions)
    A, length = from_pylops(given, device=device), {"matvec": 5, "rmatvec": 4}[name]
    with pytest.raises(ShapeError, match=rf"{name} of P.*\(5, 4\).*length {length}"):
        A(np.ones(4)) if name == "matvec" else A.T(np.ones(5))


def test_an_operator_of_whole_numbers_works_in_float32(device):
    given = scipy_operator(np.array([[1, 2], [3, 4]], np.int8))
    assert from_pylops(given, device=device).dtype == np.float32


def test_a_wrong_adjoint_is_found_by_the_dot_test(device):
    wrong = HostOperator(lambda x: 2 * x, lambda y: 3 * y, (4,), (4,), device=device)
    assert rift.dot_test(wrong) > 0.1


def test_a_package_that_is_missing_is_named_with_its_install(device, monkeypatch):
    monkeypatch.setitem(sys.modules, "pylops", None)
    with pytest.raises(InputError, match=r"to_pylops needs pylops.*pip install pylops$"):
        to_pylops(projector(device))
