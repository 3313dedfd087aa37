"""Threads that launch the same kernel with different arguments never get each other's results."""

from __future__ import annotations

import sys
import threading

import numpy as np
import pytest

from rift_cl.cl import Device

THREADS, LAUNCHES = 4, 1000
SHAPE = (3, 5)


@pytest.fixture
def restless():
    """Threads are switched every microsecond."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def _in_threads(work):
    failures, start = [], threading.Barrier(THREADS)

    def run(number):
        try:
            start.wait()
            work(number)
        # Whatever fails in a thread must reach the test.
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=run, args=(number,)) for number in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []


def _transposer(device, number):
    """A function that launches with this thread's own arguments and reads the result."""
    rows, columns = SHAPE
    image = np.arange(rows * columns, dtype=np.float32).reshape(SHAPE) + 1000 * number
    source, plane = device.array(image), device.zeros((columns, rows))

    def launch():
        size = (rows, columns, 1)
        sizes = {"slice0": 0, "rows": columns, "width": rows, "margin": 0}
        device.launch("plane_split", size, image=source, plane=plane, **sizes, TRANSPOSE=1)
        return device.get(plane)

    return launch, image.T


@pytest.mark.full
def test_launches_keep_their_own_arguments(device, restless):
    wrong = [0] * THREADS

    def work(number):
        launch, wanted = _transposer(device, number)
        for _ in range(LAUNCHES):
            wrong[number] += not np.array_equal(launch(), wanted)

    _in_threads(work)
    assert wrong == [0] * THREADS


def test_every_thread_has_a_kernel_of_its_own(device):
    made = []

    def work(number):
        launch, _ = _transposer(device, number)
        launch()
        made.extend(device._programs._own.kernels.values())

    _in_threads(work)
    assert len({id(kernel.handle) for kernel in made}) == len(made) >= THREADS


def test_threads_that_build_first_share_one_program(device, restless):
    fresh = Device(device._handle, device.selector, traits=device.traits)
    right = [False] * THREADS

    def work(number):
        launch, wanted = _transposer(fresh, number)
        right[number] = np.array_equal(launch(), wanted)

    _in_threads(work)
    assert right == [True] * THREADS
    assert len(fresh._programs._builder._programs) == 1


def test_allocations_of_threads_do_not_overlap(device, restless):
    def work(number):
        for turn in range(200):
            value = np.full(1 + turn % 7, 1000 * number + turn, np.float32)
            array = device.array(value)
            other = device.zeros(value.shape)
            assert np.array_equal(device.get(array), value)
            assert not device.get(other).any()

    _in_threads(work)
