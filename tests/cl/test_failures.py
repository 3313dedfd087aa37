"""What a driver raises becomes an error with a name, and lack of memory is recovered from."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
import pytest

import rift_cl as rift
from rift_cl.cl import Device
from rift_cl.cl.failures import named_errors
from rift_cl.errors import (
    DeviceError,
    DeviceLostError,
    DeviceMemoryError,
    ResourceLimitError,
    RiftError,
)


def _driver_error(kind, routine, code):
    record = cl._cl._ErrorRecord(msg="", code=getattr(cl.status_code, code), routine=routine)
    return kind(record)


CODES = [
    (cl.MemoryError, "clCreateBuffer", "MEM_OBJECT_ALLOCATION_FAILURE", DeviceMemoryError),
    (cl.MemoryError, "clEnqueueNDRangeKernel", "OUT_OF_RESOURCES", DeviceMemoryError),
    (cl.RuntimeError, "clEnqueueNDRangeKernel", "OUT_OF_RESOURCES", DeviceMemoryError),
    (cl.MemoryError, "clCreateContext", "OUT_OF_HOST_MEMORY", DeviceMemoryError),
    (cl.LogicError, "clCreateBuffer", "INVALID_BUFFER_SIZE", ResourceLimitError),
    (cl.RuntimeError, "clFinish", "DEVICE_NOT_AVAILABLE", DeviceLostError),
    (cl.LogicError, "clFinish", "INVALID_COMMAND_QUEUE", DeviceLostError),
    (cl.LogicError, "clEnqueueNDRangeKernel", "INVALID_CONTEXT", DeviceLostError),
    (cl.LogicError, "clEnqueueNDRangeKernel", "INVALID_WORK_GROUP_SIZE", DeviceError),
    (cl.LogicError, "clSetKernelArg", "INVALID_ARG_VALUE", DeviceError),
    (cl.RuntimeError, "clBuildProgram", "BUILD_PROGRAM_FAILURE", DeviceError),
]


@pytest.mark.parametrize(("kind", "routine", "code", "wanted"), CODES)
def test_driver_errors_are_named(kind, routine, code, wanted):
    with pytest.raises(RiftError) as caught, named_errors("copying 5 bytes to it", "Radeon"):
        raise _driver_error(kind, routine, code)
    assert type(caught.value) is wanted
    for part in ("Radeon", "copying 5 bytes to it", code, routine):
        assert part in str(caught.value)
    assert isinstance(caught.value.__cause__, kind)


def test_memory_error_of_python_is_named():
    with pytest.raises(DeviceMemoryError, match="RIFT_MEMORY"), named_errors("x", "Radeon"):
        raise MemoryError


def test_other_errors_pass_as_they_are():
    with pytest.raises(ZeroDivisionError), named_errors("x", "Radeon"):
        raise ZeroDivisionError


def test_memory_error_can_be_caught_as_one():
    with pytest.raises(MemoryError):
        raise DeviceMemoryError("text")


@pytest.mark.parametrize("where", ["queue", "enqueue"])
@pytest.mark.parametrize("turn", range(1, 6))
def test_device_that_goes_away_at_a_launch(device, monkeypatch, where, turn):
    A = rift.Projector(rift.Grid((9, 11)), rift.Parallel([0.1, 1.9], 17), device=device)
    x = np.ones((9, 11), np.float32)
    before = A(x)
    real, calls = cl.enqueue_nd_range_kernel, []

    def lose(*arguments, **options):
        calls.append(1)
        if len(calls) == min(turn, 4):
            code = "DEVICE_NOT_AVAILABLE" if where == "queue" else "INVALID_COMMAND_QUEUE"
            raise _driver_error(cl.RuntimeError, "clEnqueueNDRangeKernel", code)
        return real(*arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(cl, "enqueue_nd_range_kernel", lose)
        with pytest.raises(DeviceLostError, match="last saved result"):
            A(x)
    np.testing.assert_array_equal(A(x), before)


def _volume_projector(device):
    grid, scan = rift.Grid((40, 9, 10)), rift.Parallel(np.linspace(0, 3, 8), 15)
    return rift.Projector(grid, scan, device=device)


def _failing(times, start):
    """``Device.empty`` that fails ``times`` times from its ``start``-th call on."""
    real, calls = Device.empty, []

    def empty(self, *arguments, **options):
        calls.append(1)
        if start <= len(calls) < start + times:
            with named_errors("allocating", self.name):
                raise _driver_error(
                    cl.MemoryError, "clCreateBuffer", "MEM_OBJECT_ALLOCATION_FAILURE"
                )
        return real(self, *arguments, **options)

    return empty, calls


@pytest.mark.parametrize("warm", [True, False], ids=["tables made", "from the start"])
@pytest.mark.parametrize("k", range(1, 11))
def test_failure_of_one_allocation_is_recovered_from(device, monkeypatch, k, warm):
    rng = np.random.default_rng(k)
    A = _volume_projector(device)
    x = rng.standard_normal(A.domain).astype(np.float32)
    y = rng.standard_normal(A.range).astype(np.float32)
    forward, back = A(x), A.T(y)
    for transpose, wanted, argument in ((False, forward, x), (True, back, y)):
        again = A if warm else _volume_projector(device)
        empty, calls = _failing(1, k)
        monkeypatch.setattr(Device, "empty", empty)
        result = again.T(argument) if transpose else again(argument)
        monkeypatch.undo()
        np.testing.assert_array_equal(result, wanted)
        assert len(calls) >= k, "the failure took place"


def test_lack_of_memory_that_stays_is_a_named_error(device, monkeypatch):
    A = _volume_projector(device)
    x = np.ones(A.domain, np.float32)
    before = A(x)
    empty, calls = _failing(10**9, 1)
    monkeypatch.setattr(Device, "empty", empty)
    with pytest.raises(DeviceMemoryError):
        A(x)
    assert len(calls) < 20, "it gives up soon"
    monkeypatch.undo()
    np.testing.assert_array_equal(A(x), before)


@pytest.mark.parametrize("part", [2, 4, 8, 16])
def test_smaller_budgets_give_the_same_bits(device, part):
    grid, scan = rift.Grid((40, 9, 10)), rift.Parallel(np.linspace(0, 3, 8), 15)
    A = rift.Projector(grid, scan, device=device)
    x = np.random.default_rng(0).standard_normal(A.domain).astype(np.float32)
    y = A(x)
    fixed = A.scratch
    room = fixed + 4 * (x.size + y.size) // part
    small = Device(device._handle, device.selector, traits=device.traits, memory=room)
    B = rift.Projector(grid, scan, device=small)
    assert len(list(B._chunks(small.budget))) >= part
    np.testing.assert_array_equal(B(x), y)
    np.testing.assert_array_equal(B.T(y), A.T(y))


def test_problem_that_no_cut_can_make_fit(device):
    small = Device(device._handle, device.selector, traits=device.traits, memory=1000)
    A = rift.Projector(rift.Grid((40, 40)), rift.Parallel([0.0], 60), device=small)
    with pytest.raises(ResourceLimitError, match="budget is 1e\\+03 B"):
        A(np.ones((40, 40), np.float32))
