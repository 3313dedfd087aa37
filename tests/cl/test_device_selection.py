"""Which device a selector means: always the right one or a named error, never a question."""

from __future__ import annotations

import pickle
from types import SimpleNamespace

import pytest

import rift_cl as rift
from rift_cl.cl import discovery
from rift_cl.errors import NoDeviceError


@pytest.fixture(autouse=True)
def no_choice(monkeypatch):
    monkeypatch.delenv("RIFT_DEVICE", raising=False)


@pytest.fixture
def pocl():
    found = [d for d in rift.devices() if d.traits.pocl]
    if not found:
        pytest.skip("PoCL is not installed")
    return found[0]


def test_devices_are_listed_once_and_stay_the_same():
    found = rift.devices()
    assert found is rift.devices()
    assert len({d.selector for d in found}) == len(found) > 0
    assert all(d.name and d.platform and d.driver for d in found)
    assert all(d.selector in repr(d) and d.name in repr(d) for d in found)


@pytest.mark.parametrize("number", range(len(rift.devices())))
def test_number_and_platform_number_select_the_same_device(number):
    device = rift.devices()[number]
    assert rift.open_device(str(number)) is device
    assert rift.open_device(f" {number} ") is device
    assert rift.open_device(device.selector) is device


@pytest.mark.parametrize("selector", ["pocl", "PoCL", "portable", "Portable Computing Language"])
def test_part_of_a_name_selects(pocl, selector):
    assert rift.open_device(selector).platform == pocl.platform


def test_device_name_selects(pocl):
    assert rift.open_device(pocl.name).name == pocl.name
    assert rift.open_device(pocl.name[:8].upper()).name[:8] == pocl.name[:8]


def test_gpus_come_first_and_of_cpus_pocl(monkeypatch):
    kinds = {"fpga": "accelerator", "other": "CPU", "pocl": "CPU", "gpu": "GPU"}
    found = [
        SimpleNamespace(name=name, kind=kind, traits=SimpleNamespace(pocl=name == "pocl"))
        for name, kind in kinds.items()
    ]
    monkeypatch.setattr(discovery, "devices", lambda: tuple(found))
    assert [device.name for device in discovery.by_rank()] == ["gpu", "pocl", "other", "fpga"]


def test_kind_selects(pocl):
    assert rift.open_device("cpu").traits.is_cpu
    if any(not d.traits.is_cpu for d in rift.devices()):
        assert not rift.open_device("GPU").traits.is_cpu
    else:
        with pytest.raises(NoDeviceError, match="'GPU'"):
            rift.open_device("GPU")


@pytest.mark.parametrize(
    "selector", ["nonsense", "99", "9:9", "0:99", "-1", "0:", ":", "0.0", " ", "*", "pocl; rm -rf"]
)
def test_nonsense_is_refused_with_the_list_of_what_there_is(selector):
    with pytest.raises(NoDeviceError) as caught:
        rift.open_device(selector)
    for device in rift.devices():
        assert device.name in str(caught.value)
        assert device.selector in str(caught.value)
    assert repr(selector) in str(caught.value)


def test_environment_selects_where_no_selector_is_given(monkeypatch):
    last = rift.devices()[-1]
    monkeypatch.setenv("RIFT_DEVICE", last.selector)
    assert rift.default_device() is last
    monkeypatch.setenv("RIFT_DEVICE", "nonsense")
    with pytest.raises(NoDeviceError, match="'nonsense'"):
        rift.default_device()
    assert rift.open_device("0") is rift.devices()[0]


def test_a_gpu_comes_first_where_there_is_one():
    assert rift.default_device().traits.is_cpu == all(d.traits.is_cpu for d in rift.devices())


class Accelerator:
    """A handle of PoCL's device that calls itself an accelerator."""

    def __init__(self, handle):
        self._handle, self.type = handle, 1 << 3

    def __getattr__(self, name):
        return getattr(self._handle, name)


def test_an_accelerator_comes_last_and_is_no_gpu(pocl, monkeypatch):
    other = rift.Device(Accelerator(pocl._handle), "9:0")
    assert (pocl.kind, other.kind) == ("CPU", "accelerator")
    monkeypatch.setattr("rift_cl.cl.discovery._found", lambda: (other, pocl))
    assert rift.open_device() is pocl
    assert rift.open_device("accelerator") is other
    with pytest.raises(NoDeviceError, match="'gpu'"):
        rift.open_device("gpu")
    monkeypatch.setattr("rift_cl.cl.discovery._found", lambda: (other,))
    assert rift.open_device() is other


class Newer(Accelerator):
    """The same device by a newer driver of the same name."""

    driver_version = "99"


def test_drivers_of_one_name_differ_by_their_version_and_are_told(pocl, monkeypatch):
    newer = rift.Device(Newer(pocl._handle), "9:0")
    assert newer.identity != pocl.identity
    monkeypatch.setattr("rift_cl.cl.discovery._found", lambda: (pocl, newer))
    with pytest.warns(UserWarning, match=rf"2 devices .*{pocl.selector}.*9:0 \(driver 99\).*'9:0'"):
        assert rift.open_device(pocl.name) is pocl
    assert rift.open_device("9:0") is newer
    assert rift.open_device() is pocl


def test_two_devices_of_one_driver_are_no_question_of_drivers(pocl, monkeypatch):
    twin = rift.Device(Accelerator(pocl._handle), "9:0")
    monkeypatch.setattr("rift_cl.cl.discovery._found", lambda: (pocl, twin))
    assert twin.driver == pocl.driver
    assert rift.open_device(pocl.name) is pocl


def test_device_travels_as_its_selector(monkeypatch):
    monkeypatch.setenv("RIFT_DEVICE", "nonsense")
    for device in rift.devices():
        assert pickle.loads(pickle.dumps(device)) is device
    limited = pickle.loads(pickle.dumps(rift.open_device("0", memory=12345)))
    assert (limited.selector, limited.budget) == (rift.devices()[0].selector, 12345)


def test_threads_that_ask_first_are_given_one_context(python):
    done = python(
        "import sys, threading, rift_cl as rift\n"
        "sys.setswitchinterval(1e-6)\n"
        "found, start = [], threading.Barrier(8)\n"
        "def ask():\n"
        "    start.wait()\n"
        "    device = rift.open_device('0')\n"
        "    found.append((id(device), device.context.int_ptr, device.queue.int_ptr))\n"
        "threads = [threading.Thread(target=ask) for _ in range(8)]\n"
        "[t.start() for t in threads], [t.join() for t in threads]\n"
        "print(len(found), len(set(found)))"
    )
    assert done.stdout.split() == ["8", "1"], done.stderr
