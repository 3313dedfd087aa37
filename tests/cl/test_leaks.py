"""Ten thousand launches take no memory and no file descriptors."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from rift_cl.cl import Device

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc/self")

WARM_UP, LAUNCHES, MOST = 1000, 10_000, 5 << 20


def _resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def _descriptors():
    return len(list(Path("/proc/self/fd").iterdir()))


def _grown(device, work):
    for _ in range(WARM_UP):
        work()
    device.finish()
    before, files = _resident(), _descriptors()
    for turn in range(LAUNCHES):
        work()
        # A queue that is never waited for would only measure its own length.
        if turn % 500 == 0:
            device.finish()
    device.finish()
    assert _descriptors() == files
    return _resident() - before


def test_launches_leave_nothing_behind(device):
    image, plane = device.zeros((4, 4)), device.zeros((4, 4))

    def launch():
        size = {"rows": 4, "width": 4, "margin": 0}
        device.launch("plane_split", (4, 4, 1), image=image, plane=plane, slice0=0, **size)

    assert _grown(device, launch) < MOST


def test_arrays_leave_nothing_behind(device):
    def allocate():
        device.zeros((64, 64))

    assert _grown(device, allocate) < MOST


def test_kept_blocks_are_given_back_before_the_budget_is_passed(device):
    small = Device(device._handle, device.selector, traits=device.traits, memory=1 << 20)
    for size in range(1000, 60_000, 1000):
        small.empty(size)
        assert small._opened.pool.managed_bytes <= 1 << 20
    kept = small.empty(1000)
    small.release()
    assert kept.nbytes <= small._opened.pool.managed_bytes < 2 * kept.nbytes
