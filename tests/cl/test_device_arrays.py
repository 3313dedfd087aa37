"""Arrays on a device: what they hold, and which of them an operator refuses."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyopencl as cl
import pytest
from pyopencl.array import to_device

import rift_cl as rift
from rift_cl.cl import Device
from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.host_arrays import as_device_array, fetch, is_device_array
from rift_cl.errors import DeviceError, DTypeError, ShapeError

SHAPE = (4, 6)
VALUES = np.arange(24, dtype=np.float32).reshape(SHAPE)


def _checked(device, array):
    return as_device_array(device, array, SHAPE, name="x")


def test_good_array_passes_as_it_is(device):
    array = device.zeros(SHAPE)
    assert _checked(device, array) is array


def test_wrong_shape(device):
    for shape in ((6, 4), (24,), (4, 6, 1), (4, 0)):
        with pytest.raises(ShapeError, match="x has shape"):
            _checked(device, device.zeros(shape))


@pytest.mark.parametrize("dtype", [np.int32, np.uint8, np.float64, np.complex64])
def test_wrong_type(device, dtype):
    with pytest.raises(DTypeError, match=np.dtype(dtype).name):
        _checked(device, device.empty(SHAPE, dtype))


def test_views_are_refused_and_the_copy_is_taken(device):
    wide = device.array(np.arange(96.0).reshape(8, 12))
    tall = device.array(np.arange(48.0).reshape(8, 6))
    views = {"strided": wide[::2, ::2], "later rows": tall[4:], "transposed": tall[:6, :4].T}
    for view in views.values():
        assert view.shape == SHAPE
        with pytest.raises(ShapeError, match=r"strided view|begins inside"):
            _checked(device, view)
        with pytest.raises(ShapeError, match=r"strided view|begins inside"):
            device.get(view)
    np.testing.assert_array_equal(device.get(tall[4:].copy()), np.arange(24.0, 48.0).reshape(SHAPE))
    assert _checked(device, tall[4:].copy()).shape == SHAPE


def test_array_of_another_context(device):
    other = Device(device._handle, device.selector, traits=device.traits)
    array = other.zeros(SHAPE)
    with pytest.raises(DeviceError, match="another device"):
        _checked(device, array)
    with pytest.raises(DeviceError, match="another device"):
        device.get(array)


class _HeldQueue(cl.CommandQueue):
    """A queue of a user's own, which stands still until it is finished.

    ``late`` is an array that holds zeros until then, and VALUES once the queue went on.
    """

    held = None

    def hold(self):
        self.late, values = to_device(self, np.zeros_like(VALUES)), to_device(self, VALUES)
        self.held = cl.UserEvent(self.context)
        cl.enqueue_barrier(self, wait_for=[self.held])
        cl.enqueue_copy(self, self.late.base_data, values.base_data)

    def finish(self):
        if self.held is not None:
            self.held.set_status(cl.command_execution_status.COMPLETE)
            self.held = None
        super().finish()


class _Event:
    """An event of a held queue, which goes on when it is waited for."""

    def __init__(self, queue):
        self.command_queue = queue

    def wait(self):
        self.command_queue.finish()


@pytest.fixture
def held(device):
    queue = _HeldQueue(device.context)
    queue.hold()
    yield queue
    queue.finish()


def _projector(device):
    return rift.Projector(rift.Grid(SHAPE), rift.Parallel([0.0], 8), device=device)


@pytest.mark.parametrize("take", ["apply", "get", "solve"])
def test_array_of_another_queue_is_waited_for(device, held, take):
    A, late = _projector(device), held.late
    if take == "apply":
        np.testing.assert_array_equal(device.get(A(late)), A(VALUES))
    elif take == "get":
        np.testing.assert_array_equal(device.get(late), VALUES)
    else:
        image = rift.cgls(A, device.array(A(VALUES)), steps=0, start=late)
        np.testing.assert_array_equal(device.get(image), VALUES)


@pytest.mark.parametrize("replaced", [False, True])
def test_array_whose_queue_was_taken_away_or_replaced_is_waited_for(device, held, replaced):
    A = _projector(device)
    moved = held.late.with_queue(device.queue if replaced else None)
    moved.add_event(_Event(held))
    np.testing.assert_array_equal(device.get(A(moved)), A(VALUES))


def test_arrays_without_a_queue(device):
    A = _projector(device)
    x, out = device.array(VALUES).with_queue(None), device.zeros(A.range).with_queue(None)
    assert A(x, out) is out
    np.testing.assert_array_equal(device.get(out), A(VALUES))


@pytest.mark.parametrize("solve", [False, True])
def test_output_on_another_queue_is_written_when_the_call_returns(device, monkeypatch, solve):
    A = _projector(device)
    x = device.array(VALUES)
    call = partial(rift.cgls, A, A(x), steps=0, start=x) if solve else partial(A, x)
    wanted = device.get(call())
    out = to_device(cl.CommandQueue(device.context), np.zeros_like(wanted))
    done = []
    finish = Device.finish
    monkeypatch.setattr(Device, "finish", lambda self: done.append(finish(self)))
    own = device.zeros(wanted.shape)
    call(out=own)
    assert not done  # The device's own queue needs no wait.
    assert call(out=out) is out and done
    np.testing.assert_array_equal(out.get(), wanted)


def test_operator_refuses_what_the_check_refuses(device):
    A = rift.Projector(rift.Grid(SHAPE), rift.Parallel([0.0], 8), device=device)
    with pytest.raises(DTypeError):
        A(device.zeros(SHAPE, np.int32))
    with pytest.raises(ShapeError):
        A(device.zeros((6, 4)))
    with pytest.raises(ShapeError, match="out"):
        A(device.zeros(SHAPE), device.zeros((8, 1)))


def test_zeros_are_zero_in_memory_that_was_used_before(device):
    for _ in range(5):
        used = device.array(np.full(1000, np.nan))
        del used
        assert not device.get(device.zeros(1000)).any()


@pytest.mark.parametrize("shape", [(), (0,), (3, 0, 2), 5, (1,)])
def test_small_and_empty_shapes(device, shape):
    array = device.zeros(shape)
    assert device.get(array).shape == (shape if isinstance(shape, tuple) else (shape,))


def test_types_on_the_device(device):
    for dtype in ("f2", "f8", ">f4", "?"):
        assert device.array(np.ones(3, dtype)).dtype == np.float32
    for dtype in ("i4", "u2", ">i8"):
        assert device.array(np.ones(3, dtype)).dtype == np.dtype(dtype).newbyteorder("=")


def test_a_wanted_type_is_kept_on_the_device(device):
    thirds = np.arange(5) / 3
    for values in (thirds, thirds.astype(">f8"), [0.0, 1 / 3], np.arange(3)):
        there = device.array(values, np.float64)
        assert there.dtype == np.float64
        assert np.array_equal(device.get(there), values)
    assert device.array([1.0, 2.0], np.int32).dtype == np.int32


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_numbers_reach_a_kernel_in_the_type_of_its_arrays(device, dtype):
    """A third is another number in float32: the sum tells which of them was passed."""
    x, y = device.array(np.ones(9), dtype), device.array(np.full(9, 3.0), dtype)
    axpby(device, 1 / 3, x, np.float64(1 / 7), y)
    third, seventh = dtype(1 / 3), dtype(1 / 7)
    np.testing.assert_allclose(device.get(y), third + 3 * seventh, rtol=2 * np.finfo(dtype).eps)
    assert device.get(y).dtype == dtype


def test_is_device_array_needs_no_driver(device):
    assert is_device_array(device.zeros(3))
    assert not any(is_device_array(value) for value in (np.zeros(3), [1.0], None, 3.0))


def test_launch_over_nothing_does_nothing(device):
    device.launch("no_such_kernel", (0, 5))
    device.launch("no_such_kernel", (5, 0, 1))


def test_finish_and_release(device):
    device.finish()
    device.release()
    assert device.get(device.zeros(3)).tolist() == [0, 0, 0]


def test_what_is_sent_past_the_queue_is_a_copy_made_at_once(device):
    host = np.arange(1000, dtype=np.float32).reshape(10, 100)
    sent = device.send(host)
    host[:] = 0
    np.testing.assert_array_equal(device.get(sent), np.arange(1000).reshape(10, 100))
    axpby(device, 1.0, device.array(np.ones((10, 100), np.float32)), 2.0, sent)
    np.testing.assert_array_equal(device.get(sent), 2 * np.arange(1000).reshape(10, 100) + 1)
    assert device.send(np.empty((0, 3), np.float32)).shape == (0, 3)


def test_arrays_of_one_shape_share_nothing(device):
    one, other = device.array(np.zeros(SHAPE)), device.array(np.ones(SHAPE))
    assert one.base_data != other.base_data and one.events is not other.events
    assert device.get(one).sum() == 0 and device.get(other).sum() == 24
    assert device.empty(5).shape == (5,) and device.empty((0, 4)).base_data is None
    with pytest.raises(ValueError, match="negative"):
        device.empty(-1)


def test_fetched_numbers_are_those_of_the_moment_of_the_call(device):
    numbers = device.array(np.arange(6.0))
    found = fetch(device, numbers, 4)
    axpby(device, 1.0, numbers, 1.0, numbers)
    assert found().tolist() == found().tolist() == [0, 1, 2, 3]
    assert device.get(numbers).tolist() == [0, 2, 4, 6, 8, 10]
