"""The self-test passes on a device that works and says what is wrong with one that does not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rift_cl.cl import Device
from rift_cl.cl.build import source
from rift_cl.cl.self_test import SelfTest, self_test
from rift_cl.errors import DeviceLostError


def test_working_device_passes(device):
    assert self_test(device) == SelfTest(
        passed=True, detail="copies and kernels gave the right numbers"
    )


def test_it_leaves_the_device_as_it_was(device):
    array = device.array(np.arange(5.0))
    assert self_test(device).passed
    assert self_test(device).passed
    assert device.get(array).tolist() == [0, 1, 2, 3, 4]


def test_wrong_copies_are_noticed(device, monkeypatch):
    monkeypatch.setattr(Device, "get", lambda *_: np.zeros((19, 83), np.float32))
    found = self_test(device)
    assert not found.passed
    assert found.detail == f"{device.name} changed numbers while copying them"


@pytest.mark.parametrize("kernel", ["plane_split", "plane_merge"])
def test_wrong_numbers_are_noticed(device, monkeypatch, kernel):
    right = source.kernel_source(kernel)
    wrong = right.replace("by_rows[", "1.0f + by_rows[").replace("image + ", "1 + image + ")
    wrong = wrong.replace("image[(slice0", "1.0f + image[(slice0")
    assert wrong != right
    real = source.kernel_source
    monkeypatch.setattr(
        "rift_cl.cl.build.builder.kernel_source",
        lambda name: wrong if name == kernel else real(name),
    )
    found = self_test(Device(device._handle, device.selector, traits=device.traits))
    assert (found.passed, found.detail) == (False, f"{device.name} computed wrong numbers")


def test_failure_of_the_driver_is_a_finding(device, monkeypatch):
    def lose(*_, **__):
        raise DeviceLostError("it went away")

    monkeypatch.setattr(Device, "launch", lose)
    assert self_test(device) == SelfTest(passed=False, detail="it went away")


def test_result_cannot_be_changed(device):
    with pytest.raises(dataclasses.FrozenInstanceError):
        self_test(device).passed = False
