"""Operators on top of each other, and operators of two functions on the host."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ShapeError, WrongTypeError
from rift_cl.operators import HostOperator, vstack

GRID = rift.Grid((12, 15))
RANDOM = np.random.default_rng(3)
X = RANDOM.standard_normal(GRID.shape).astype(np.float32)


def projector(device, views, bins=21, **options):
    angles = np.linspace(0, np.pi, views, endpoint=False)
    return rift.Projector(GRID, rift.Parallel(angles, bins=bins), device=device, **options)


def turn(x):
    return np.rot90(x)


def turn_back(x):
    return np.rot90(x, -1)


@pytest.fixture
def A(device):
    return projector(device, 8)


@pytest.fixture
def B(device):
    return projector(device, 5)


@pytest.fixture
def G(device):
    return HostOperator(turn, turn_back, (12, 15), (15, 12), device=device)


def test_results_of_one_detector_stand_along_the_first_axis(A, B, device):
    both = vstack(A, B, 2 * A)
    assert (both.domain, both.range) == ((12, 15), (8 + 5 + 8, 21))
    wanted = np.concatenate([A(X), B(X), 2 * A(X)])
    assert np.array_equal(both(X), wanted)
    assert np.array_equal(device.get(both(device.array(X))), wanted)
    y = RANDOM.standard_normal(both.range).astype(np.float32)
    back = A.T(y[:8]) + B.T(y[8:13]) + 2 * A.T(y[13:])
    assert np.allclose(both.T(y), back, rtol=1e-5, atol=1e-4)
    assert rift.dot_test(both) < 1e-6


def test_a_list_of_operators_is_stacked_as_numpy_stacks_arrays(A, B):
    assert np.array_equal(vstack([A, B])(X), vstack(A, B)(X))
    assert np.array_equal(vstack((A, B))(X), vstack(A, B)(X))
    with pytest.raises(InputError, match="wanted two or more"):
        vstack([A])


def test_results_of_other_shapes_are_flat(A, G):
    both = vstack(A, G)
    assert both.range == (8 * 21 + 180,)
    assert np.array_equal(both(X), np.concatenate([A(X).ravel(), turn(X).ravel()]))
    assert rift.dot_test(both) < 1e-6


def test_side_by_side_is_the_adjoint_of_a_stack_of_adjoints(A, G, device):
    other = HostOperator(np.negative, np.negative, (8, 21), (8, 21), device=device)
    beside = vstack(A.T, other.T).T
    u, v = X, RANDOM.standard_normal((8, 21)).astype(np.float32)
    both = beside(np.concatenate([u.ravel(), v.ravel()]))
    assert np.allclose(both, A(u) - v, rtol=1e-5, atol=1e-5)


def test_a_stack_larger_than_the_device_goes_step_by_step_to_the_same_bits(A, B, G):
    y = RANDOM.standard_normal(vstack(A, G, B).range).astype(np.float32)
    both = vstack(A, G, B)
    wanted, back = both(X), both.T(y)
    host = np.empty_like(wanted)
    both._apply_steps(X, host)
    assert np.array_equal(host, wanted)
    image = np.empty_like(X)
    both._apply_adjoint_steps(y, image)
    assert np.array_equal(image, back)


def test_a_stack_solves_what_its_rows_say(A, G):
    """A penalty pulls towards zero: as ``ridge`` does."""
    identity = HostOperator(np.copy, np.copy, A.domain, A.domain, device=A.device)
    y = A(X)
    data = np.concatenate([y.ravel(), np.zeros(identity.shape[0], np.float32)])
    stacked = rift.cgls(vstack(A, 3.0 * identity), data, steps=60)
    normal = A.T @ A + 9.0 * (identity.T @ identity)
    assert np.allclose(normal(stacked), A.T(y), rtol=1e-3, atol=1e-2)


def test_stacks_are_copied_as_their_operators():
    # A device travels as its selector, and a test's devices have none of their own.
    device = rift.default_device()
    both = vstack(projector(device, 8), projector(device, 5))
    for other in (pickle.loads(pickle.dumps(both)), copy.deepcopy(both)):
        assert np.array_equal(other(X), both(X))
    assert repr(both).startswith("vstack(<")


def test_host_operators_are_pickled_and_refuse_another_shape(G, device):
    assert np.array_equal(pickle.loads(pickle.dumps(G))(X), turn(X))
    wrong = HostOperator(np.transpose, np.transpose, (12, 15), (12, 15), device=device)
    with pytest.raises(ShapeError, match=r"\(15, 12\)"):
        wrong(X)


def test_what_cannot_be_stacked_is_refused(A, device):
    with pytest.raises(InputError, match="wanted two or more"):
        vstack(A)
    with pytest.raises(WrongTypeError, match="operator 1"):
        vstack(A, X)
    other = rift.Projector(rift.Grid((9, 9)), A.scan, device=device)
    with pytest.raises(ShapeError, match=r"\(12, 15\) and \(9, 9\)"):
        vstack(A, other)
    wide = HostOperator(np.copy, np.copy, (12, 15), (12, 15), device=device, dtype=np.float64)
    with pytest.raises(DTypeError, match="float64"):
        vstack(A, wide)


def test_an_operator_is_divided_by_a_number(A):
    assert np.array_equal((A / 4)(X), (0.25 * A)(X))
    with pytest.raises(InputError, match="divided by 0"):
        A / 0
    with pytest.raises(TypeError):
        A / A
