"""The rasterizer on GPUs of every kind: small groups, little local memory, images of one pixel."""

import dataclasses

import numpy as np
import pytest
from limited_devices import as_gpu, limited
from scenes import lists_of, numbers_of, random_scene

from rift_cl.cl import program
from rift_cl.reference.splat_raster import Rules
from rift_cl.reference.splat_raster import raster as twin_raster
from rift_cl.splat.raster import raster_grad, rasterize, sum_slots
from rift_cl.splat.settings import SplatSettings

SIZE = (20, 37)


def drawn(device, scene, settings=None):
    """Image, transmittance, and each splat's sums of the gradient of a fixed loss."""
    settings = settings or SplatSettings()
    splats, lists = scene.upload(device)
    raster = rasterize(device, splats, lists, scene.size, settings=settings)
    random = np.random.default_rng(3)
    coming = (device.array(random.normal(size=raster.image.shape).astype(np.float32)),)
    records = raster_grad(device, splats, lists, raster, *coming, settings=settings)
    sums = sum_slots(device, lists.slots, records)
    return [device.get(each) for each in (raster.image, raster.transmittance, sums)]


def assert_alike(found, wanted):
    for one, other in zip(found, wanted, strict=True):
        assert np.abs(one - other).max() <= 2e-5 * np.abs(other).max()


def groups_of(device):
    return {
        key[0]: kernel.group
        for key, kernel in device._programs._own.kernels.items()
        if key[0].endswith("_gpu")
    }


@pytest.mark.full
@pytest.mark.once
@pytest.mark.parametrize(
    ("group", "channels"),
    [(32, 3), *(pytest.param(*case, marks=pytest.mark.full) for case in ((1, 3), (20, 19)))],
)
def test_small_groups_draw_the_same_picture(device, group, channels):
    """A tile is then drawn in parts, whose sums a slot holds together."""
    gpu = as_gpu(device, optimized=False)
    small = limited(gpu, group=group)
    scene = random_scene(60, SIZE, channels=channels)
    assert_alike(drawn(small, scene), drawn(gpu, scene))
    assert set(groups_of(small).values()) == {1 << (group.bit_length() - 1)}


@pytest.mark.once
@pytest.mark.full
@pytest.mark.parametrize("channels", [3, 8])
def test_little_local_memory_is_enough(device, channels):
    gpu = as_gpu(device, optimized=False)
    small = limited(gpu, local_memory=16 << 10)
    scene = random_scene(60, SIZE, channels=channels)
    assert_alike(drawn(small, scene), drawn(gpu, scene))
    groups = groups_of(small)
    assert groups["splat_raster_gpu"] == 256 > groups["splat_raster_grad_gpu"]


@pytest.mark.once
@pytest.mark.full
def test_a_driver_that_runs_them_in_smaller_groups(device, monkeypatch):
    gpu = as_gpu(device, optimized=False)
    scene = random_scene(60, SIZE)
    wanted, needs = drawn(gpu, scene), program.kernel_needs
    monkeypatch.setattr(program, "kernel_needs", lambda *kernel: needs(*kernel)._replace(group=100))
    small = limited(gpu)
    assert_alike(drawn(small, scene), wanted)
    assert set(groups_of(small).values()) == {64}


@pytest.mark.full
@pytest.mark.once
def test_an_image_of_one_pixel(device):
    gpu = as_gpu(device, optimized=False)
    scene = random_scene(40, (1, 1), scale=3.0)
    found, wanted = drawn(gpu, scene), drawn(device, scene)
    assert 0 < found[1][0, 0] < 0.9
    assert_alike(found, wanted)


@pytest.mark.once
def test_what_lies_behind_finished_pixels_leaves_nothing(device):
    """Ten splats that end every pixel, and fifty behind them."""
    gpu = as_gpu(device, optimized=False)
    scene = random_scene(60, (16, 16), scale=60.0, weights=(0.97, 0.99))
    splats, lists = scene.upload(gpu)
    raster = rasterize(gpu, splats, lists, (16, 16), settings=SplatSettings())
    coming = gpu.array(np.ones((16, 16, 3), np.float32))
    records = raster_grad(gpu, splats, lists, raster, coming, settings=SplatSettings())
    live = gpu.get(records.live)[scene.entries[:, 1]]
    deepest = gpu.get(raster.last).max()
    assert 0 < deepest < 30 and not live[deepest:].any()
    assert live[deepest - 1] and np.isfinite(numbers_of(gpu, records)).all()


@pytest.mark.once
def test_needles_lose_no_pixel(device):
    """Of widths to lengths of 1 to 1000, in every direction, without any blur."""
    gpu = as_gpu(device, optimized=False)
    scene = random_scene(200, SIZE)
    random, screen = np.random.default_rng(7), scene.screen.copy()
    turn, long = random.uniform(0, np.pi, 200), np.exp(random.uniform(0, np.log(300), 200))
    wide = 0.3
    c, s = np.cos(turn), np.sin(turn)
    a, b = c**2 / long**2 + s**2 / wide**2, c * s * (1 / long**2 - 1 / wide**2)
    screen[:, 2:5] = np.stack([a, b, s**2 / long**2 + c**2 / wide**2], axis=1)
    screen[:, 5] *= 0.05
    screen[:, 6:] = 4 * np.sqrt(
        np.stack([(c * long) ** 2 + (s * wide) ** 2, (s * long) ** 2 + (c * wide) ** 2], axis=1)
    )
    slots, entries, starts, _ = lists_of(screen, scene.depths, scene.tiles, 16)
    needles = dataclasses.replace(scene, screen=screen, slots=slots, entries=entries, starts=starts)
    twin, _ = twin_raster(
        *(screen.astype(float), scene.features.astype(float), entries, starts, SIZE),
        *(Rules(16, 0.99, False, False), None),
    )
    image = drawn(gpu, needles)[0]
    assert (np.abs(image - twin) > 1e-3).sum() == 0
    assert twin.max() > 0.05
