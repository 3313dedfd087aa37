"""What every operator takes and gives, and the algebra of operators."""

from __future__ import annotations

import copy
import inspect
import pickle
import sys
import typing

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import (
    DeviceMemoryError,
    DTypeError,
    InputError,
    NonFiniteError,
    ResourceLimitError,
    ShapeError,
)
from rift_cl.operators import Compensation, HighPass, LinearOperator, Ramp, ViewFilter
from rift_cl.reconstruct import FilteredBackprojection, MeasuredRays
from rift_cl.reconstruct.solvers.view_subsets import restricted
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays

GRID = rift.Grid((12, 15))
SCAN = rift.Parallel(np.linspace(0, np.pi, 8, endpoint=False), bins=21)
RANDOM = np.random.default_rng(3)
X = RANDOM.standard_normal(GRID.shape).astype(np.float32)
Y = RANDOM.standard_normal((8, 21)).astype(np.float32)


@pytest.fixture
def A(device):
    return rift.Projector(GRID, SCAN, device=device)


@pytest.fixture
def F(device):
    return ViewFilter(SCAN, Ramp("hann"), gains=np.arange(8), device=device)


def close(value, truth):
    return np.linalg.norm(value - truth) <= 1e-6 * np.linalg.norm(truth)


def test_shapes_and_adjoints(A):
    assert (A.domain, A.range) == ((12, 15), (8, 21))
    assert (A.T.domain, A.T.range) == ((8, 21), (12, 15))
    assert A.T.T is A
    assert A.T is A.T


def test_numpy_in_gives_numpy_out(A):
    y, x = A(X), A.T(Y)
    assert isinstance(y, np.ndarray) and (y.shape, y.dtype) == ((8, 21), np.float32)
    assert isinstance(x, np.ndarray) and (x.shape, x.dtype) == ((12, 15), np.float32)
    assert np.array_equal(A @ X, y)


def test_device_array_in_gives_device_array_out(A, device):
    y = A(device.array(X))
    assert type(y) is type(device.array(X))
    assert np.array_equal(device.get(y), A(X))
    assert np.array_equal(device.get(A.T(device.array(Y))), A.T(Y))


def test_the_input_is_left_alone(A, F, device):
    for B, given in ((A, X), (A.T, Y), (F, Y), (A.T @ F @ A + 2 * (A.T @ A), X)):
        host, there = given.copy(), device.array(given)
        B(host)
        B(there)
        assert np.array_equal(host, given)
        assert np.array_equal(device.get(there), given)


def test_out_is_filled_and_returned(A, F, device):
    for B, given in ((A, X), (A.T, Y), (A.T @ F, Y), (-F, Y), (F + F, Y)):
        host = np.full(B.range, np.nan, np.float32)
        assert B(given, out=host) is host
        assert np.array_equal(host, B(given))
        there = device.array(np.full(B.range, 7.0))
        assert B(device.array(given), out=there) is there
        assert np.array_equal(device.get(there), B(given))


@pytest.mark.parametrize(
    "out",
    [
        np.empty((8, 20), np.float32),
        np.empty((8, 21), np.float64),
        np.empty((8, 21), ">f4"),
        np.empty((8, 21), np.float32, order="F"),
        np.empty((16, 21), np.float32)[::2],
        [[0.0] * 21] * 8,
        np.frombuffer(bytes(4 * 8 * 21), np.float32).reshape(8, 21),
    ],
)
def test_an_out_that_cannot_hold_the_result_is_refused(A, out):
    with pytest.raises(InputError, match=r"^out "):
        A(X, out=out)


def test_out_must_be_on_the_side_of_the_input(A, device):
    with pytest.raises(InputError, match=r"^out "):
        A(X, out=device.empty(A.range))
    with pytest.raises(InputError, match=r"^out "):
        A(device.array(X), out=np.empty(A.range, np.float32))


def test_out_on_the_input_is_right_or_refused(F, device):
    """An operator whose output is its input must not read what it has already overwritten."""
    for B in (F, F + F, F @ F, F - 2 * F):
        there = device.array(Y)
        try:
            B(there, out=there)
        except InputError:
            continue
        assert np.array_equal(device.get(there), B(Y))


@pytest.mark.parametrize("dtype", [">f4", "f8", ">f8", "f2", "i1", "u2", "i8", ">i4", "?"])
def test_any_real_type_is_taken(A, dtype):
    values = (10 * X).astype(dtype)
    assert np.array_equal(A(values), A(values.astype(np.float32)))


def test_any_memory_order_is_taken(A):
    wide = RANDOM.standard_normal((24, 45)).astype(np.float32)
    views = (np.asfortranarray(X), wide[::2, ::3], wide[::-2, 44:0:-3], X.T.copy().T, X.tolist())
    for view in views:
        assert np.array_equal(A(view), A(np.array(view, dtype=np.float32, order="C")))
    assert np.array_equal(
        A(np.broadcast_to(np.float32(2), GRID.shape)), A(np.full(GRID.shape, 2.0))
    )


@pytest.mark.parametrize("shape", [(12, 14), (15, 12), (180,), (1, 12, 15), (), (0, 15)])
def test_wrong_shapes_are_refused(A, device, shape):
    with pytest.raises(ShapeError, match=r"x has shape .*\(12, 15\)"):
        A(np.zeros(shape))
    if 0 not in shape and shape:
        with pytest.raises(ShapeError, match=r"x has shape .*\(12, 15\)"):
            A(device.array(np.zeros(shape)))


@pytest.mark.parametrize("dtype", ["c8", "O", "U3", "M8[s]"])
def test_types_without_a_meaning_are_refused(A, dtype):
    with pytest.raises(DTypeError, match="x has type"):
        A(np.zeros(GRID.shape).astype(dtype))


def test_masked_and_double_device_arrays_are_refused(A, device):
    with pytest.raises(DTypeError, match="masked"):
        A(np.ma.masked_less(X, 0))
    with pytest.raises(DTypeError, match="x has type float64"):
        A(device.empty(GRID.shape, np.float64))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_non_finite_values_are_refused_with_their_place(A, bad):
    values = X.astype(np.float64)
    values[3, 4] = bad
    with pytest.raises(NonFiniteError, match=r"x holds .*\(3, 4\)"):
        A(values)


def test_empty_scans_are_refused_by_name():
    with pytest.raises(ShapeError, match="angles is empty"):
        rift.Parallel([], bins=5)
    with pytest.raises(ShapeError, match="bins is 0"):
        rift.Parallel([0.0], bins=0)


def test_an_unknown_footprint_is_refused(device):
    with pytest.raises(InputError, match="footprint is 'round'"):
        rift.Projector(GRID, SCAN, "round", device=device)


def test_arguments_that_are_no_geometry_are_told_by_name(device):
    for make in (rift.Projector, rift.FastProjector):
        with pytest.raises(InputError, match=r"grid is None"):
            make(None, None, device=device)
        with pytest.raises(InputError, match=r"grid is \(12, 15\)"):
            make((12, 15), SCAN, device=device)
        with pytest.raises(InputError, match=r"scan is array"):
            make(GRID, np.arange(3.0), device=device)
        with pytest.raises(InputError, match=r"scan is a FanBeam.*rebin_fan"):
            make(GRID, rift.FanBeam(100, 150, 1, 10), device=device)


def test_operators_say_what_they_are(A, F, device):
    place = f"float32, device {device.selector}>"
    samples = "grid 12 x 15, spacing 1, 8 parallel views of 21 bins, pitch 1"
    sizes = f"{A.domain} -> {A.range}"
    assert repr(A) == f"<PhaseProjector {sizes}: {samples}, footprint strip, {place}"
    stack = rift.Projector(rift.Grid((2, 12, 15), (3, 1, 0.5)), SCAN, device=device)
    assert "grid 2 x 12 x 15, spacing 3 x 1 x 0.5" in repr(stack)
    fast = rift.FastProjector(GRID, SCAN, 0.01, lobes=2, device=device)
    assert repr(fast) == f"<FastProjector {sizes}: {samples}, error 0.01, lobes 2, {place}"
    assert repr(A.T) == f"{A!r}.T"
    assert repr(F).startswith(f"<ViewFilter {F.domain} -> {F.range}: {Ramp('hann')!r}, gains")
    assert repr(2 * A.T @ F) == f"((2 * {A!r}.T) @ {F!r})"
    assert repr(A + A) == f"({A!r} + {A!r})"
    assert f"12 of 168 samples of {A!r}" in repr(WeightedRays(A, np.eye(8, 21) + np.eye(8, 21, 17)))


def test_the_shape_is_the_matrixs_and_the_conjugate_transpose_the_adjoint(A, F):
    for B in (A, A.T, F, 2 * A.T @ F):
        assert B.shape == (B(np.zeros(B.domain)).size, np.prod(B.domain))
        assert B.H is B.T
        assert B.H.shape == B.shape[::-1]


def slices():
    return rift.Projector(rift.Grid((2, 12, 15)), SCAN)


def joseph():
    return rift.Projector(GRID, SCAN, "joseph")


def filtering(rows=None):
    gains = np.arange(8) if rows is None else Compensation(SCAN.angles, "exact", 9)
    return ViewFilter(SCAN, HighPass(0.5), rows=rows, gains=gains)


# On the default device, which is the one that a pickle opens again.
EVERY_CLASS = {
    "Projector": joseph,
    "FastProjector": lambda: rift.FastProjector(GRID, SCAN, 0.01, lobes=1),
    "ViewFilter": filtering,
    "ViewFilter of rows": lambda: filtering(rows=2),
    "FilteredBackprojection": lambda: FilteredBackprojection(
        slices(), "hann", compensate="capped-voronoi", diameter=9
    ),
    "Adjoint": lambda: joseph().T,
    "Scaled": lambda: 0.3 * joseph(),
    "Sum": lambda: joseph() + 2 * joseph(),
    "Product": lambda: joseph().T @ filtering(),
    "WeightedRays": lambda: WeightedRays(joseph(), np.abs(Y)),
    "MeasuredRays": lambda: MeasuredRays(joseph(), Y > 0),
    "ChosenViews": lambda: restricted(filtering() @ joseph(), np.array([1, 4, 5])),
}
COPIES = {
    "pickle": lambda B: pickle.loads(pickle.dumps(B)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("name", EVERY_CLASS)
def test_a_copy_is_made_of_its_settings_and_gives_the_same_bits(name, way):
    B = EVERY_CLASS[name]()
    x = RANDOM.standard_normal(B.domain).astype(np.float32)
    wanted = B(x)
    C = COPIES[way](B)
    assert type(C) is type(B)
    assert repr(C) == repr(B)
    assert np.array_equal(C(x), wanted)
    assert np.array_equal(C.T(wanted), B.T(wanted))
    assert np.array_equal((B - C)(x), 0 * wanted)


def test_a_pickle_holds_no_tables():
    grid, scan = rift.Grid((300, 300)), rift.Parallel([0.1, 0.2], bins=400)
    for B in (rift.Projector(grid, scan), rift.FastProjector(grid, scan)):
        B(np.zeros(grid.shape))
        assert len(pickle.dumps(B)) < 1500
        assert len(pickle.dumps(B.T @ B)) < 1500


def test_a_product_with_an_array_is_refused(A, device):
    """It would be an array of operators, one for each number."""
    products = (
        lambda: A * X,
        lambda: X * A,
        lambda: A.T * X,
        lambda: A * device.array(X),
        lambda: A * X.tolist(),
        lambda: np.float64([1, 2]) * A,
    )
    for product in products:
        with pytest.raises(InputError, match=r"write A\(x\) or A @ x"):
            product()
    for product in (lambda: np.dot(A, X), lambda: np.dot(Y, A), lambda: np.asarray(A)):
        with pytest.raises(InputError, match=r"no array.*A @ x"):
            product()
    for nonsense in (lambda: A * "2", lambda: X + A, lambda: np.sin(A)):
        with pytest.raises(TypeError):
            nonsense()
    for row in (Y, device.array(Y), 2.0):
        with pytest.raises(InputError, match=r"A\.T\(x\)"):
            row @ A
    with pytest.raises(InputError, match="A @ B"):
        A * A.T
    with pytest.raises(InputError, match="1j"):
        A * 1j
    assert np.array_equal(A @ X, A(X))
    assert np.array_equal((A * np.array(2.0))(X), (2 * A)(X))
    assert np.array_equal((A / np.array(2.0))(X), (0.5 * A)(X))


def test_algebra(A, F):
    y, z = A(X), F(A(X))
    assert close((A + A)(X), 2 * y)
    assert close((F @ A - A)(X), z - y)
    assert close((3 * A)(X), 3 * y)
    assert close((A * np.float64(-0.5))(X), -0.5 * y)
    assert close((np.float32(4) * A)(X), 4 * y)
    assert close((A * np.int64(2))(X), 2 * y)
    assert close((np.array(4.0) * A)(X), 4 * y)
    assert close((-A)(X), -y)
    assert close((F @ A)(X), z)
    assert close((A.T @ F @ A)(X), A.T(z))
    assert not (0 * A)(X).any()


def test_adjoints_of_the_algebra(A, F):
    for B in (A + A, F @ A - A, 3 * A, -A, F @ A, A.T @ F @ A, (A.T @ F @ A + 2 * (A.T @ A)).T):
        assert rift.dot_test(B, seed=4) <= 1e-6
        assert B.T.T is B
        assert (B.T.domain, B.T.range) == (B.range, B.domain)
    assert close((F @ A).T(Y), A.T(F(Y)))
    assert close((A - 3 * A).T(Y), -2 * A.T(Y))
    assert np.array_equal((2 * A.T)(Y), (2 * A).T(Y))


@pytest.mark.parametrize("side", ["forward", "adjoint"])
def test_a_product_that_the_device_has_no_memory_for_is_taken_one_by_one(A, monkeypatch, side):
    def out_of_memory(*given):
        raise DeviceMemoryError("full")

    both = A.T @ (2 * A)
    operator = both if side == "forward" else both.T
    x = np.random.default_rng(5).random(A.domain, np.float32)
    wanted = operator(x)
    for name in ("_apply", "_apply_adjoint"):
        monkeypatch.setattr(both, name, out_of_memory)
    assert np.array_equal(operator(x), wanted)


def test_the_largest_array_of_an_operator_is_known_of_what_is_made_of_it(A):
    size = 1 << 20

    class Hungry(type(A)):
        largest_scratch = size

    inner = copy.copy(A)
    inner.__class__ = Hungry
    made = (inner.T, 2 * inner, inner + A, A.T @ inner, WeightedRays(inner, np.ones(A.range)))
    assert [each.largest_scratch for each in made] == [size] * len(made)
    assert (A.T @ A).largest_scratch >= 4 * A.shape[0]


def test_operators_that_do_not_fit_are_refused(A, F):
    with pytest.raises(ShapeError, match="sum of operators"):
        A + A.T
    with pytest.raises(ShapeError, match="sum of operators"):
        A - F
    with pytest.raises(ShapeError, match="product of operators"):
        A @ F


def test_operators_on_two_devices_are_refused(A, device):
    other = rift.Device(device._handle, device.selector, traits=device.traits)
    B = rift.Projector(GRID, SCAN, device=other)
    for combine in (lambda: A + B, lambda: A - B, lambda: A.T @ B):
        with pytest.raises(rift.RiftError, match="device"):
            combine()


def test_a_sum_begins_with_zero(A):
    assert np.array_equal(sum([A, 2 * A])(X), (A + 2 * A)(X))
    assert 0 + A is A
    with pytest.raises(TypeError):
        1 + A


@pytest.mark.parametrize("other", [1, "A", None, [1.0]])
def test_what_is_no_operator_cannot_be_added(A, other):
    with pytest.raises(TypeError):
        A + other
    with pytest.raises(TypeError):
        A - other


@pytest.mark.parametrize("factor", [np.nan, np.inf, 1e300])
def test_factors_must_be_finite(A, factor):
    with pytest.raises(InputError):
        factor * A


class Unmatched(LinearOperator):
    """An operator whose adjoint is wrong by one part in a thousand."""

    def __init__(self, A):
        super().__init__(A.domain, A.range, A.device)
        self._apply = A._apply
        self._almost = 1.001 * A.T

    def _apply(self, x, out):
        raise NotImplementedError

    def _apply_adjoint(self, y, out):
        self._almost._apply(y, out)


def test_the_dot_test_finds_a_pair_that_is_not_matched(A):
    assert 5e-4 < rift.dot_test(Unmatched(A)) < 2e-3


def test_the_dot_test_of_nothing_is_nothing(A):
    assert rift.dot_test(0 * A) == 0


def test_device_arrays_that_begin_inside_another_are_taken_and_written(device):
    A = rift.Projector(
        rift.Grid((9, 7)), rift.Parallel(np.arange(5) / 5 * np.pi, 11), device=device
    )
    random = np.random.default_rng(0)
    images = random.uniform(size=(3, 9, 7)).astype(np.float32)
    stack, out = device.array(images), device.zeros((3, 5, 11))
    for k in range(3):
        assert A(stack[k], out=out[k]).shape == (5, 11)
        np.testing.assert_array_equal(device.get(A(stack[k])), A(images[k]))
    np.testing.assert_array_equal(device.get(out), [A(image) for image in images])
    with pytest.raises(InputError, match="shares memory"):
        both = device.zeros((5 * 11 + 9 * 7,))
        A(both[:63].reshape((9, 7)), out=both[40:95].reshape((5, 11)))


def test_no_copy_is_advised_for_an_output(device):
    A = rift.Projector(
        rift.Grid((9, 7)), rift.Parallel(np.arange(5) / 5 * np.pi, 11), device=device
    )
    with pytest.raises(InputError, match=r"out is a strided view.*an array of its own"):
        A(device.zeros((9, 7)), out=device.zeros((5, 22))[:, ::2])
    with pytest.raises(InputError, match="out is not in C order"):
        A(np.zeros((9, 7)), out=np.zeros((5, 11), np.float32, order="F"))


class Returning(rift.operators.LinearOperator):
    """An operator as SciPy wants it: it returns what it computes, and fills nothing."""

    def _apply(self, x, out):
        return x

    _apply_adjoint = _apply


def test_an_operator_that_returns_instead_of_writing_is_refused(device):
    B = Returning((4,), (4,), device)
    for apply in (B, B.T, 2 * B, B @ B, B.T + B, rift.vstack(B, B)):
        for x in (np.ones(4, np.float32), device.zeros((4,))):
            with pytest.raises(InputError, match=r"Returning\._apply.*returned"):
                apply(x)


def test_a_function_of_an_operator_cannot_overwrite_what_it_is_applied_to(device):
    def double(x):
        x *= 2
        return x

    B, x = rift.HostOperator(double, double, (4,), (4,), device=device), np.ones(4, np.float32)
    for given in (x, device.array(x)):
        with pytest.raises(InputError, match=r"writes into its argument.*copy"):
            B(given)
    assert (x == 1).all()


@pytest.mark.skipif(sys.version_info < (3, 11), reason="typing.get_overloads is of Python 3.11")
def test_a_type_checker_is_told_what_an_operator_gives_for_what():
    for method, argument in ((LinearOperator.__call__, "x"), (LinearOperator.__matmul__, "other")):
        hints = [typing.get_type_hints(way) for way in typing.get_overloads(method)]
        told = [(hint[argument], hint["return"]) for hint in hints]
        assert all(given == result for given, result in told)
        assert told[-1] == (typing.Any, typing.Any) and len(told) > 2


def test_an_own_operator_may_name_its_arrays_as_it_likes_and_be_its_own_adjoint():
    for name in ("_apply", "_apply_adjoint"):
        _, *arrays = inspect.signature(getattr(LinearOperator, name)).parameters.values()
        assert [array.kind for array in arrays] == [inspect.Parameter.POSITIONAL_ONLY] * 2


def test_a_host_operator_wants_shapes(device):
    for shapes, name in (((8, (8,)), "domain is 8"), (((8,), (8, 1.5)), "range is")):
        with pytest.raises(ShapeError, match=name):
            rift.HostOperator(np.array, np.array, *shapes, device=device)


@pytest.mark.parametrize("dtype", ["f2", "i8", "c8"])
def test_a_host_operator_works_in_the_type_that_it_is_told_or_in_none(device, dtype):
    with pytest.raises(DTypeError, match=f"dtype is '{dtype}'"):
        rift.HostOperator(np.array, np.array, (8,), (8,), dtype=dtype, device=device)


def test_a_result_that_the_host_has_no_memory_for_is_refused():
    A = rift.Projector(rift.Grid((8, 8)), rift.Parallel(np.arange(1 << 19) * 1e-5, 2**31))
    with pytest.raises(ResourceLimitError, match=r"result of shape .* which the host has not"):
        A(np.zeros((8, 8), np.float32))
