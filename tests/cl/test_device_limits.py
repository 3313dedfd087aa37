"""Every limit of a device, at a small value: what crosses it has the same bits as without it.

A device is opened with fake traits, within which it then works; the driver's own are larger.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from limited_devices import Arrays, as_gpu, assert_same, limited, normal
from observations_of_all_kinds import random_observations
from projection_scenes import camera_of
from projection_scenes import random_splats as visible_splats
from test_image_loss import mask, pair
from test_renderer_bits import gradient
from voxel_scenes import drawn as voxels
from voxel_scenes import random_splats

import rift_cl as rift
from rift_cl.cl import program, reductions
from rift_cl.cl.build.source import kernel_names, kernel_source
from rift_cl.cl.grid_parts import GridPart, grid_parts
from rift_cl.cl.launch_times import LaunchTimes
from rift_cl.cl.program import Programs, kernel_needs
from rift_cl.errors import DeviceError, ResourceLimitError
from rift_cl.operators import ViewFilter
from rift_cl.operators.fourier.spectrum import SpectralFilter
from rift_cl.reconstruct.preprocess.columns import DetectorColumns, mend_columns
from rift_cl.sampling.coverage.device import coverage, coverage_grad
from rift_cl.sampling.targets.target import Target
from rift_cl.splat import Renderer, Splats, SplatSettings
from rift_cl.train.loss.image_loss import ImageLoss

pytestmark = pytest.mark.variants


def tomography(device: rift.Device) -> Arrays:
    grid, scan = rift.Grid((5, 44, 40)), rift.Parallel(np.linspace(0, 3, 37), 60)
    A = rift.Projector(grid, scan, device=device)
    y = normal(*A.range)
    return [A(normal(*A.domain)), A.T(y), rift.fbp(A, y)]


def fast_tomography(device: rift.Device) -> Arrays:
    grid, scan = rift.Grid((3, 16, 16)), rift.Parallel(np.linspace(0, 3, 9), 24)
    A = rift.FastProjector(grid, scan, error=1e-2, device=device)
    return [A(normal(*A.domain)), A.T(normal(*A.range))]


def filtering(device: rift.Device) -> Arrays:
    scan = rift.Parallel(np.linspace(0, 3, 50), 40)
    return [ViewFilter(scan, rift.Ramp(), rows=9, device=device)(normal(50, 9, 40))]


def fourier_filtering(device: rift.Device) -> Arrays:
    scan = rift.Parallel(np.linspace(0, 3, 20), 400)
    return [ViewFilter(scan, rift.Ramp(), rows=3, device=device)(normal(20, 3, 400))]


def sums(device: rift.Device) -> Arrays:
    x = device.array(normal(5_000))
    return [np.array([reductions.dot(device, x, x), reductions.total(device, x)])]


def splats(device: rift.Device) -> Arrays:
    renderer = Renderer(SplatSettings(absgrad=True, tile=8), device=device)
    values = visible_splats(150)
    values["scales"] *= 6
    behind = device.array([0.2, 0.5, 0.9])
    uploaded = Splats.upload(device, **values)
    camera = camera_of("pinhole", size=(40, 56))
    frame = renderer.forward(uploaded, camera, background=behind, depth="expected")
    found = gradient(renderer, frame)
    arrays = [frame.image, *vars(found.splats).values(), found.camera, found.background]
    return [device.get(array) for array in arrays if array is not None]


def loss(device: rift.Device) -> Arrays:
    image, target = map(device.array, pair((14, 90)))
    value, grad = ImageLoss()(device, image, target, weights=device.array(mask((14, 90))))
    return [device.get(value), device.get(grad)]


def tall_loss(device: rift.Device) -> Arrays:
    # The last run of rows ends behind the image.
    image, target = map(device.array, pair((61, 90)))
    value, grad = ImageLoss()(device, image, target, weights=device.array(mask((61, 90))))
    return [device.get(value), device.get(grad)]


def spectrum(device: rift.Device) -> Arrays:
    apply = SpectralFilter(device, (33, 20), lambda ky, kx: np.sqrt(ky**2 + kx**2 + 1e-4))
    return [device.get(apply(device.array(normal(33, 20, 3))))]


def coverages(device: rift.Device) -> Arrays:
    target = Target((0, 0, 0), 3.0, points=[[0.1, 0, 0], [-0.5, 0.2, 0.4]])
    views, k = random_observations(23, 2, diameter=3.0), normal(2500, 3)
    by_views = coverage_grad(views, target, normal(2, 2500), k, device=device)
    return [coverage(views, target, k, device=device), *by_views]


def voxelised(device: rift.Device) -> Arrays:
    grid = rift.Grid((12, 20, 30), 0.06, (0.1, 0, 0))
    return [voxels(device, random_splats(300, order=1, scales=(0.03, 0.12)), grid)]


def crowded_voxels(device: rift.Device) -> Arrays:
    # Lists longer than the table of splats, and than the volume.
    grid = rift.Grid((4, 60, 120), 0.04)
    return [voxels(device, random_splats(500, order=1, scales=(0.3, 0.6)), grid)]


def columns(device: rift.Device) -> Arrays:
    def mend(found: DetectorColumns) -> None:
        found.sort()
        found.median(5)
        found.unsort()
        found.subtract(np.ones((found.rows, found.bins)))

    return [mend_columns(normal(30, 7, 25), device, mend)]


JOBS: dict[str, Callable[[rift.Device], Arrays]] = {
    job.__name__: job
    for job in (
        filtering,
        tomography,
        splats,
        loss,
        coverages,
        voxelised,
        columns,
        sums,
        spectrum,
        fourier_filtering,
        fast_tomography,
    )
}
every_job = pytest.mark.parametrize("job", JOBS.values(), ids=list(JOBS))


@pytest.mark.full
@pytest.mark.parametrize(
    ("job", "largest"),
    [
        (tomography, 1 << 16),
        (filtering, 1 << 16),
        (coverages, 30_000),
        (columns, 1 << 14),
        (splats, 40_000),
        (tall_loss, 100_000),
        (crowded_voxels, 130_000),
    ],
)
def test_no_array_is_larger_than_the_largest_buffer(device, job, largest, monkeypatch):
    sizes, check = [0], rift.Device.check_array

    def noted(asked: rift.Device, size: int, shape: tuple[int, ...]) -> None:
        sizes.append(size)
        check(asked, size, shape)

    monkeypatch.setattr(rift.Device, "check_array", noted)
    job(device)
    assert max(sizes) > largest, "the limit is crossed"
    assert_same(job(limited(device, allocation=largest)), job(device))


@pytest.mark.once
@pytest.mark.full
def test_slabs_of_rows_fit_the_largest_buffer_of_a_gpu(device):
    gpu = as_gpu(device, optimized=False)
    assert_same(fourier_filtering(limited(gpu, allocation=1 << 16)), fourier_filtering(gpu))


def test_an_array_beyond_the_largest_buffer_is_told(device):
    small = limited(device, allocation=1 << 16)
    for make in (small.empty, small.zeros, lambda n: small.array(np.zeros(n, np.float32))):
        make(1 << 14)
        with pytest.raises(ResourceLimitError, match=r"64 KiB.*parts") as caught:
            make((1 << 14) + 1)
        assert small.name in str(caught.value)


def test_an_array_as_large_as_the_largest_buffer_is_made(device):
    """The pool rounds sizes up, and the driver would refuse what it makes of this one."""
    largest = device.traits.allocation
    opened = device._open()
    assert opened.allocator(1000, largest) is opened.pool
    assert opened.allocator(1000, 1000) is not opened.pool


def test_work_whose_least_part_is_beyond_the_largest_buffer_is_told(device):
    with pytest.raises(ResourceLimitError, match=r"one view.*1\.41 KiB.*1e\+03 B"):
        filtering(limited(device, allocation=1000))
    scan = rift.Parallel(np.linspace(0, 3, 50), 40)
    gains = np.arange(50.0)
    F = ViewFilter(scan, rift.Ramp(), rows=9, gains=gains, device=limited(device, allocation=1000))
    with pytest.raises(ResourceLimitError, match=r"one view.*1\.41 KiB"):
        F(normal(50, 9, 40))


@pytest.mark.parametrize(("bins", "largest"), [(40, 1 << 15), (400, 1 << 20)])
def test_a_sinogram_beyond_the_largest_buffer_is_filtered_by_views(device, bins, largest):
    """Rows that are convolved, and longer ones that are transformed."""
    scan, y = rift.Parallel(np.linspace(0, 3, 700), bins), normal(700, bins)
    limit = limited(device, allocation=largest)
    found, wanted = (
        [F(y), F.T(y), (2 * F)(y)]
        for F in (ViewFilter(scan, rift.Ramp(), device=each) for each in (limit, device))
    )
    assert y.nbytes > largest, "the limit is crossed"
    assert_same(found, wanted)


def offsets_of(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """Where the parts of grids begin, as they are launched on a device."""
    seen, enqueue = [], Programs._enqueue

    def noted(programs, kernel, values, size, local, offset=None):
        seen.append(offset)
        enqueue(programs, kernel, values, size, local, offset)

    monkeypatch.setattr(Programs, "_enqueue", noted)
    return seen


@every_job
def test_grids_beyond_the_most_work_items_are_launched_in_parts(device, job, monkeypatch):
    """No more than a group of a GPU along x."""
    small = limited(device, items=(1, 3, 1))
    seen = offsets_of(monkeypatch)
    found = job(small)
    assert any(offset is not None and any(offset) for offset in seen), "the limit is crossed"
    assert_same(found, job(device))


@given(
    size=st.tuples(st.integers(1, 40), st.integers(1, 9), st.integers(1, 5)),
    most=st.tuples(*[st.integers(1, 12)] * 3),
    group=st.sampled_from([1, 4]),
    axes=st.integers(1, 3),
)
def test_parts_of_a_grid_hold_every_item_once(size, most, group, axes):
    size = (size[0] * group, *size[1:])[:axes]
    taken = np.zeros(size, int)
    for offset, part in grid_parts(size, most, group):
        assert offset[0] % group == part[0] % group == 0
        assert all(n <= max(m, group) for n, m in zip(part, most, strict=False))
        taken[tuple(slice(at, at + n) for at, n in zip(offset, part, strict=True))] += 1
    assert (taken == 1).all()


@pytest.mark.parametrize("asked", ["get_num_groups", "get_global_size", "get_group_id"])
def test_no_kernel_asks_for_what_is_wrong_in_a_part_of_a_grid(asked):
    for name in kernel_names():
        lines = [line for line in kernel_source(name).splitlines() if f"{asked}(" in line]
        assert all("get_global_offset" in line for line in lines), name


@pytest.mark.once
def test_filtered_views_beyond_the_groups_that_a_gpu_numbers(device):
    """65,537 rows, one to a work-item along y."""
    gpu = as_gpu(device, optimized=False)
    scan = rift.Parallel(np.zeros(1), 2)
    F = ViewFilter(scan, rift.Ramp(), rows=65_537, device=gpu)
    y = normal(*F.domain)
    alone = ViewFilter(scan, rift.Ramp(), rows=2, device=gpu)
    assert np.array_equal(F(y)[:, -2:], alone(y[:, -2:]))


def test_local_memory_beyond_the_devices_is_told(device):
    small = limited(device, local_memory=4096)
    with pytest.raises(DeviceError, match=r"ssim_map\):.*KiB.*memory.*4 KiB"):
        loss(small)


@pytest.mark.once
@pytest.mark.full
@every_job
def test_a_gpu_of_small_groups_has_results_to_rounding(device, job):
    """Sums over the items of a group are in another order there."""
    gpu = as_gpu(device, optimized=False)
    small = limited(gpu, group=20)
    assert small.traits.macros["GROUP"] == 16
    for one, other in zip(job(small), job(gpu), strict=True):
        assert np.abs(one - other).max() <= 2e-5 * np.abs(other).max()


@pytest.mark.once
@pytest.mark.parametrize("most", [32, 20])
def test_a_kernel_that_runs_in_smaller_groups_alone(device, most, monkeypatch):
    gpu = as_gpu(device, optimized=False)
    needs = kernel_needs

    def few(kernel, handle):
        return needs(kernel, handle)._replace(group=most)

    wanted = filtering(gpu)
    monkeypatch.setattr(program, "kernel_needs", few)
    small = limited(gpu)
    assert_same(filtering(small), wanted)
    groups = {kernel.group for kernel in small._programs._own.kernels.values()}
    assert groups == {32 if most == 32 else 16}
    with pytest.raises(DeviceError, match=f"ssim_map.* at most {most}"):
        loss(limited(gpu))


@every_job
def test_launches_that_would_take_too_long_are_cut(device, job, monkeypatch):
    """To the least that can be launched, for no launch is as short as this."""
    seen = offsets_of(monkeypatch)
    found = job(limited(device, seconds=1e-12))
    assert any(any(offset or ()) for offset in seen), "the limit is crossed"
    assert_same(found, job(device))


class Watch:
    """A device without work whose time passes by a rule: seconds of an item, and of a launch."""

    def __init__(self, item: float, launch: float = 0.0) -> None:
        self.now, self.pieces, self.item, self.fixed = 0.0, [], item, launch

    def start(self, piece: GridPart) -> None:
        self.pieces.append(piece)
        self.now += self.fixed + self.item * np.prod(piece.size)

    def longest(self) -> float:
        return self.item * max(np.prod(piece.size) for piece in self.pieces)


@pytest.mark.each
@pytest.mark.parametrize("size", [(64_000,), (640, 100), (64, 5, 200)])
def test_pieces_take_a_part_of_the_time_once_they_are_measured(size):
    watch = Watch(item=1e-4, launch=1e-5)
    times = LaunchTimes(1.0, lambda: None, lambda: watch.now)
    for _ in range(2):
        watch.pieces.clear()
        times.launch("work", GridPart((0,) * len(size), size), 64, watch.start)
        taken = np.zeros(size, int)
        for offset, part in watch.pieces:
            assert offset[0] % 64 == part[0] % 64 == 0
            taken[tuple(slice(at, at + n) for at, n in zip(offset, part, strict=True))] += 1
        assert (taken == 1).all() and watch.longest() <= 0.26
    assert len(watch.pieces) < 40, "what was measured is kept"
    assert watch.longest() > 0.15, "no shorter than it must be"


def test_short_launches_are_whole_and_waited_for_but_at_first():
    waits, watch = [], Watch(item=1e-9)
    times = LaunchTimes(1.0, lambda: waits.append(1), lambda: watch.now)
    grid = GridPart((0,), (1024,))
    for _ in range(5):
        times.launch("work", grid, 1, watch.start)
    assert watch.pieces[-3:] == [grid] * 3 and len(waits) == 2


def test_work_that_becomes_slower_is_measured_again():
    watch = Watch(item=1e-4)
    times = LaunchTimes(1.0, lambda: None, lambda: watch.now)
    grid = GridPart((0,), (8000,))
    times.launch("work", grid, 1, watch.start)
    watch.item *= 3
    times.launch("work", grid, 1, watch.start)
    watch.pieces.clear()
    times.launch("work", grid, 1, watch.start)
    assert watch.longest() <= 0.26
