"""What every test shares: the devices to test on and the folder of real data.

Every OpenCL device that is found takes part, or the one that RIFT_DEVICE selects. A CPU takes part
twice: as it is, and dressed as a GPU (one lane, groups of 64), so that both drivers of every kernel
are tested without a GPU.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import hypothesis
import pytest
from limited_devices import as_gpu, limited

import rift_cl as rift

pytest_plugins = ["selection", "costs", "touched"]

# The same examples every time; a failure is then there again tomorrow.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.load_profile("repeatable")


def pytest_configure(config: pytest.Config) -> None:
    """Keep compiled kernels in the tests' own folder, which stays warm from run to run."""
    if "RIFT_CACHE_DIR" not in os.environ and hasattr(config, "cache"):
        os.environ["RIFT_CACHE_DIR"] = str(config.cache.mkdir("rift_cl_kernels"))


@cache
def _devices() -> list[rift.Device]:
    return [rift.open_device()] if os.environ.get("RIFT_DEVICE") else list(rift.devices())


@cache
def _variants(*, optimized: bool) -> list[rift.Device]:
    devices = _devices() if optimized else [_unoptimized(device) for device in _devices()]
    cpus = (device for device in _devices() if device.traits.is_cpu)
    return [*devices, *(as_gpu(device, optimized=optimized) for device in cpus)]


def _unoptimized(device: rift.Device) -> rift.Device:
    """A CPU whose compiler leaves out what takes most of its time; any other device as it is."""
    return limited(device, optimized=False) if device.traits.is_cpu else device


def _label(device: rift.Device) -> str:
    return f"{device.selector}-{'cpu' if device.traits.is_cpu else 'gpu'}"


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test that asks for ``device`` on each of them; they are opened but once.

    A test that is marked ``once`` is spared a CPU's second kind: it puts kernels together that have
    tests of their own.
    """
    if "device" in metafunc.fixturenames:
        once = metafunc.definition.get_closest_marker("once") is not None
        marked = metafunc.definition.get_closest_marker("variants") is not None
        many = marked or metafunc.definition.path.parent.name == "splat"
        chosen = _devices() if once else _variants(optimized=not many)
        metafunc.parametrize("device", chosen, ids=_label, scope="session")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real scans and captures, which the repository does not carry."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real data: {folder} is absent")
    return folder


@pytest.fixture(scope="session")
def python() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run code in a process of its own, with a changed environment (None takes a variable out).

    The time limit is there to turn a hang into a failure.
    """

    def run(code: str, **changes: str | None) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
        # What this process told its own driver is nothing that a fresh one would find.
        environment.pop("POCL_CACHE_DIR", None)
        environment.update({name: value for name, value in changes.items() if value is not None})
        for name in (name for name, value in changes.items() if value is None):
            environment.pop(name, None)
        return subprocess.run(
            [sys.executable, "-c", code],
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    return run
