"""Operators in float64: what they take and give, how exact they are, and who may not mix.

The pair is matched to rounding, since projection and backprojection read the same numbers. The
geometry is not so exact: a row's place is rounded to 2^-33 of a column, times the row's number.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.cl.arithmetic import axpby
from rift_cl.errors import DeviceError, DTypeError, NonFiniteError, ResourceLimitError
from rift_cl.operators.projector.footprint import FOOTPRINTS
from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector

pytestmark = pytest.mark.dealt

GRID = rift.Grid((12, 15))
SCAN = rift.Parallel(np.linspace(0, np.pi, 8, endpoint=False), bins=21)
X = np.random.default_rng(3).standard_normal(GRID.shape)


@pytest.fixture
def A(device):
    return rift.Projector(GRID, SCAN, device=device, dtype="float64")


@pytest.fixture
def single(device):
    return rift.Projector(GRID, SCAN, device=device)


def relative(value, truth):
    return np.linalg.norm(value - truth) / max(np.linalg.norm(truth), 1e-30)


def test_the_pair_is_matched_to_rounding(device, geometry):
    A = geometry.projector(device, dtype="float64")
    if geometry.scan.bins > 3 and geometry.grid.shape != (1, 1):
        assert rift.dot_test(A, seed=1) <= 1e-14
        assert rift.dot_test(A.T, seed=2) <= 1e-14


def test_it_equals_its_twin_as_far_as_places_are_exact(device, geometry):
    if max(geometry.scan.pitch / min(geometry.grid.spacing), 1) > 100:
        pytest.skip("places of bins are exact to 2^-33 of a bin, here of many pixels")
    A = geometry.projector(device, dtype="float64")
    random = np.random.default_rng(4)
    x, y = random.standard_normal(A.domain), random.standard_normal(A.range)
    assert relative(A(x), geometry.twin.project(x)) <= 1e-7
    assert relative(A.T(y), geometry.twin.backproject(y)) <= 1e-7


@pytest.mark.full
@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_it_is_linear_to_rounding(device, footprint):
    A = rift.Projector(GRID, SCAN, footprint, device=device, dtype="float64")
    assert relative(A(X / 3) * 3, A(X)) <= 1e-15
    assert relative(A.T(A(X)) / 7, A.T(A(X) / 7)) <= 1e-15


@pytest.mark.full
def test_float32_is_the_same_operator(A, single):
    assert relative(single(X), A(X)) <= 3e-7
    assert relative(single.T(A(X)), A.T(A(X))) <= 3e-7


def test_what_goes_in_and_comes_out_is_float64(A, device):
    assert A.dtype == A.T.dtype == (A.T @ A + 2 * (A.T @ A)).dtype == np.float64
    assert A(X).dtype == A(X.astype(np.float32)).dtype == A(X.tolist()).dtype == np.float64
    there = A(device.array(X, np.float64))
    assert there.dtype == np.float64
    assert np.array_equal(device.get(there), A(X))
    assert np.array_equal((A.T @ A)(X), A.T(A(X)))
    out = np.empty(A.range)
    assert A(X, out=out) is out
    with pytest.raises(DTypeError, match=r"out must be .*float64"):
        A(X, out=np.empty(A.range, np.float32))
    with pytest.raises(DTypeError, match="x has type float32"):
        A(device.array(X))


def test_numbers_beyond_float32_are_taken(A):
    assert relative(A(1e120 * X), 1e120 * A(X)) <= 1e-15
    assert relative((1e120 * A)(X), 1e120 * A(X)) <= 1e-15
    with pytest.raises(NonFiniteError, match="x holds"):
        A(np.full(GRID.shape, np.inf))


def test_the_algebra_keeps_its_digits(A):
    y = A(X)
    assert relative((A + (1 / 3) * A)(X), 4 / 3 * y) < 1e-15
    assert relative((A.T @ A - 0.1 * (A.T @ A))(X), 0.9 * A.T(y)) < 1e-15


def test_types_are_not_mixed(A, single):
    for combine in (lambda: A + single, lambda: single - A, lambda: A.T @ single):
        with pytest.raises(DTypeError, match=r"float.. and float.."):
            combine()


@pytest.mark.parametrize("dtype", ["float16", "int32", "complex64", ">f8", "double precision", 7])
def test_other_types_are_refused(device, dtype):
    with pytest.raises(DTypeError, match=r"'float32'.*'float64'"):
        rift.Projector(GRID, SCAN, device=device, dtype=dtype)


def test_a_device_without_doubles_says_so_at_once(device):
    traits = dataclasses.replace(device.traits, fp64=False)
    plain = rift.Device(device._handle, device.selector, traits=traits)
    with pytest.raises(DeviceError, match=r"float64 .*float32"):
        rift.Projector(GRID, SCAN, device=plain, dtype="float64")
    x = plain.empty(3, np.float64)
    with pytest.raises(DeviceError, match="float64"):
        axpby(plain, 1.0, x, 1.0, x)
    assert rift.Projector(GRID, SCAN, device=plain)(X).dtype == np.float32


def test_twice_the_bytes_are_counted(device, monkeypatch):
    grid = rift.Grid((40, 12, 15))
    singles, doubles = (rift.Projector(grid, SCAN, device=device, dtype=t) for t in ("f4", "f8"))
    assert doubles.scratch > singles.scratch
    monkeypatch.setattr(PhaseProjector, "scratch", 0)
    budget = 4 * 7 * (12 * 15 + 8 * 21)
    assert len(singles.chunks(budget)) == 6
    assert len(doubles.chunks(budget)) == 14
    with pytest.raises(ResourceLimitError):
        doubles.chunks(4 * (12 * 15 + 8 * 21))


def test_chunks_give_the_same_bits(device, monkeypatch):
    A = rift.Projector(rift.Grid((33, 12, 15)), SCAN, "strip", device=device, dtype="float64")
    x = np.random.default_rng(5).standard_normal(A.domain)
    whole = A(x), A.T(A(x))
    monkeypatch.setattr(PhaseProjector, "scratch", 0)
    monkeypatch.setattr(rift.Device, "budget", whole[0].nbytes // 3)
    assert len(A.chunks(whole[0].nbytes // 3)) > 3
    assert np.array_equal(A(x), whole[0])
    assert np.array_equal(A.T(whole[0]), whole[1])
