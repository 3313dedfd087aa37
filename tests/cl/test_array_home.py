"""Arrays beside a device: what is done to them has the bits of what is done on it."""

from __future__ import annotations

import numpy as np
import pytest
from limited_devices import limited, normal

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array_home import ArrayHome, mapped_file
from rift_cl.cl.elementwise import clip_between, clip_negative, copy, multiply, pull_to_levels
from rift_cl.cl.reductions import dot, norm, total
from rift_cl.errors import ResourceLimitError
from rift_cl.reconstruct.solvers.tv_functional import TotalVariation

SIZE = 3 * 4096 * 4 + 117
STEPS = {
    "axpby": lambda device, x, y, z: axpby(device, 1.3, x, -0.7, y),
    "copy": lambda device, x, y, z: copy(device, x, y),
    "multiply": lambda device, x, y, z: multiply(device, x, y),
    "clip_negative": lambda device, x, y, z: clip_negative(device, y),
    "clip_between": lambda device, x, y, z: clip_between(device, x, z, y),
    "pull": lambda device, x, y, z: pull_to_levels(
        device, device.array(np.array([0, 0.5, 2.0])), 0.1, x, y
    ),
}


@pytest.fixture
def small(device):
    """A device on which four runs of an array are worked on one after another."""
    return limited(device, 4 * SIZE)


@pytest.mark.full
@pytest.mark.parametrize("step", STEPS)
def test_runs_of_host_arrays_have_the_same_bits(device, small, step):
    x, y = normal(2, SIZE)
    z = x + 1
    there = [device.array(each) for each in (x, y, z)]
    STEPS[step](device, *there)
    STEPS[step](small, x, y, z)
    assert np.array_equal(y, device.get(there[1]))


def test_sums_of_host_arrays_are_those_of_the_device(device, small):
    x, y = normal(2, 10 * SIZE)
    there = device.array(x), device.array(y)
    pairs = [
        (dot(device, *there), dot(small, x, y)),
        (norm(device, there[0]), norm(small, x)),
        (total(device, there[0]), total(small, x)),
    ]
    for wanted, found in pairs:
        assert found == wanted
    assert total(small, x[:0]) == 0


@pytest.mark.full
@pytest.mark.parametrize("shape", [(23, 17, 5), (40, 31)])
def test_total_variation_of_runs_of_slices_has_the_same_bits(device, small, shape):
    few = limited(device, 20 * 4 * int(np.prod(shape[1:])))
    on, beside = ArrayHome(device, "float32"), ArrayHome(few, "float32", beside=1)
    image, found = normal(*shape), {}
    for home in (on, beside):
        variation = TotalVariation(home, shape, (1.0, 0.7, 2.0)[: len(shape)])
        x, u, out = home.array(image), home.zeros(variation.field_shape), home.empty(shape)
        variation.dual_step(u, x, u, step=0.4, radius=0.3)
        variation.denoise(x, u, out, weight=0.2, steps=2, nonnegative=True)
        found[home] = [variation.value(x), *(home.host(each).copy() for each in (u, out))]
    for one, other in zip(found[on], found[beside], strict=True):
        assert np.array_equal(one, other)


def test_arrays_beside_a_device_hold_what_they_are_given(device):
    random = [np.random.default_rng(1).random for _ in range(2)]
    for home in (ArrayHome(device, "float32"), ArrayHome(device, "float32", beside=1)):
        assert not home.host(home.zeros((3, 5))).any()
        assert np.array_equal(home.host(home.array(np.arange(6.0))), np.arange(6))
        assert home.empty((2, 0)).shape == (2, 0)
        made = home.host(home.made((3, 7), random.pop()))
        assert np.array_equal(made, np.random.default_rng(1).random((3, 7)).astype("float32"))


def test_a_file_that_finds_no_room_is_told(monkeypatch):
    def full(*given):
        raise OSError(28, "No space left on device")

    assert mapped_file((4, 3), "float64").sum() == 0
    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    with pytest.raises(ResourceLimitError, match="temporary files"):
        mapped_file((4, 3), "float64")


@pytest.mark.parametrize("call", ["gettempdir", "TemporaryFile"])
def test_a_folder_that_cannot_be_used_is_told(device, monkeypatch, call):
    def unusable(*given, **options):
        raise FileNotFoundError(2, "No usable temporary directory found")

    monkeypatch.setattr(f"tempfile.{call}", unusable)
    with pytest.raises(ResourceLimitError, match="No usable temporary directory"):
        ArrayHome(limited(device, is_cpu=True), "float32", beside=8).empty((2,))


@pytest.mark.parametrize("kind", ["tmpfs", "ext4"])
def test_files_in_memory_take_no_more_than_memory(device, monkeypatch, tmp_path, kind):
    mounts = f"none / ext4 rw 0 0\nnone {tmp_path} {kind} rw 0 0\n"
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "below"))
    (tmp_path / "below").mkdir()
    monkeypatch.setattr("pathlib.Path.read_text", lambda path, **options: mounts)
    monkeypatch.setattr("rift_cl.cl.array_home.host_budget", lambda: 1000)
    cpu = limited(device, is_cpu=True)
    assert ArrayHome(cpu, "float32", beside=999).empty((2,)).shape == (2,)
    if kind == "tmpfs":
        with pytest.raises(ResourceLimitError, match="in memory"):
            ArrayHome(cpu, "float32", beside=1001)
    else:
        ArrayHome(cpu, "float32", beside=1001)
