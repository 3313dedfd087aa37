"""A solver whose arrays the device does not hold keeps them on the host, with the same bits."""

from __future__ import annotations

import numpy as np
import pytest
from limited_devices import assert_same, limited, normal

import rift_cl as rift
from rift_cl.cl import reductions
from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import clip_negative, copy, multiply
from rift_cl.errors import ResourceLimitError
from rift_cl.reconstruct.solvers.conjugate_gradients import Cgls
from rift_cl.reconstruct.solvers.ordered_subsets import OrderedSubsets
from rift_cl.reconstruct.solvers.pdhg import Pdhg
from rift_cl.reconstruct.solvers.simultaneous_iteration import Sirt

GRID = rift.Grid((256, 150), 0.7, (3.0, -5.0))
SCAN = rift.Parallel(np.linspace(0, 3.1, 240) + 0.1, 200, center=90.3)
# Where a projection is cut by views and a backprojection by rows, and no sum is.
MEMORY = 900_000
METHODS = {
    "cgls": lambda A, y: Cgls(A, y, ridge=0.1, start=np.ones(A.domain)),
    "ramp": lambda A, y: Cgls(A, y, precondition="ramp", noise=0.01),
    "sirt": lambda A, y: Sirt(A, y, nonnegative=True),
    "ramp sirt": lambda A, y: Sirt(A, y, precondition="ramp"),
    "subsets": lambda A, y: OrderedSubsets(A, y, 3, nonnegative=True),
    "tv": lambda A, y: Pdhg(A, y, 0.1),
    "weights": lambda A, y: Cgls(A, y, weights=1 + np.abs(normal(*A.range))),
}
_SLOW = "ramp", "ramp sirt", "subsets"
every_method = pytest.mark.parametrize(
    "method",
    [
        pytest.param(method, id=name, marks=[pytest.mark.full] * (name in _SLOW))
        for name, method in METHODS.items()
    ],
)


def projectors(*devices: rift.Device) -> list[rift.Projector]:
    return [rift.Projector(GRID, SCAN, device=each) for each in devices]


def data() -> np.ndarray:
    return np.abs(normal(len(SCAN.angles), SCAN.bins))


@pytest.mark.full
@every_method
def test_a_slice_that_a_solver_does_not_hold_is_taken_in_parts(device, method):
    A, whole = projectors(limited(device, MEMORY), device)
    assert len(list(A._chunks(A.device.budget))) > 1, "the projector's work is cut as well"
    found, wanted = method(A, data()), method(whole, data())
    assert wanted.data.home.on_device and not found.data.home.on_device
    for solver in (found, wanted):
        list(solver.run(2))
    assert isinstance(found.image, np.ndarray)
    assert_same(list(found.state().values()), list(wanted.state().values()))
    again = method(A, data())
    again.restore(found.state())
    for solver in (again, found, wanted):
        list(solver.run(3))
    assert_same([again.image, found.image], [device.get(wanted.image)] * 2)


@pytest.mark.full
@pytest.mark.parametrize(
    "solve",
    [rift.cgls, lambda A, y, steps, **out: rift.tv(A, y, 0.1, steps, **out)],
    ids=["cgls", "tv"],
)
def test_a_solver_whose_arrays_are_too_large_singly_agrees_to_rounding(device, solve):
    """Every projection reads an image in bands, and adds up what they give."""
    A, whole = projectors(limited(device, allocation=120_000), device)
    out = np.empty(A.domain, np.float32)
    assert solve(A, data(), 3, out=out) is out
    wanted = solve(whole, data(), 3)
    assert np.abs(out - wanted).max() <= 2e-5 * np.abs(wanted).max()


def test_data_on_the_device_are_refused_with_what_can_be_done(device):
    (A,) = projectors(limited(device, MEMORY))
    with pytest.raises(ResourceLimitError, match=r"one solver needs .*; give y on the host"):
        rift.cgls(A, A.device.array(data()))


@pytest.mark.parametrize("dtype", [np.float32, pytest.param(np.float64, marks=pytest.mark.full)])
def test_arithmetic_in_parts_has_the_bits_of_the_whole(device, dtype):
    if dtype == np.float64 and not device.traits.fp64:
        pytest.skip("no double precision here")
    small, x, y = limited(device, 150_000), *normal(2, 50_003).astype(dtype)
    there = [device.array(each, dtype) for each in (x, y)]
    here = [each.copy() for each in (x, y)]
    for on, (a, b) in ((device, there), (small, here)):
        axpby(on, 0.3, a, -1.7, b)
        multiply(on, a, b)
        axpby(on, 0.0, b, 2.5, b)
        clip_negative(on, b)
        copy(on, b, a)
    assert_same([device.get(each) for each in there], here)
    assert here[1].any()
    for a, b in ((x, y), (x[:9], y[:9]), (x[:20_000], y[:20_000])):
        wanted = reductions.dot(device, device.array(a, dtype), device.array(b, dtype))
        assert reductions.dot(small, a, b) == wanted
