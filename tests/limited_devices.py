"""A device with limits that are not its own, and the comparison of what comes out."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

import rift_cl as rift

Arrays = list[np.ndarray[Any, Any]]


def limited(device: rift.Device, memory: int | None = None, **traits: Any) -> rift.Device:
    """The same device with other traits, and with so many bytes of memory."""
    changed = dataclasses.replace(device.traits, **traits)
    return rift.Device(device._handle, device.selector, traits=changed, memory=memory)


def as_gpu(device: rift.Device, *, optimized: bool = True) -> rift.Device:
    """A CPU dressed as a GPU: one lane, groups of 64.

    Args:
        device: the CPU.
        optimized: whether kernels are optimized: of use to nobody here, but a test that computes
            for long is faster by it, and one that compiles many kernels slower.
    """
    return limited(device, is_cpu=False, optimized=optimized)


def normal(*shape: int) -> np.ndarray[Any, Any]:
    return np.random.default_rng(len(shape)).standard_normal(shape).astype(np.float32)


def assert_same(found: Arrays, wanted: Arrays) -> None:
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert one.dtype == other.dtype and one.tobytes() == other.tobytes()
