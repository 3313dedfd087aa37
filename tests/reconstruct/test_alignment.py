"""Projections of an axis that is tilted or moves from row to row, brought to one column."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError, ShapeError
from rift_cl.metrics import psnr
from rift_cl.reconstruct.preprocess.alignment import straightened, tilt_halo, upright
from rift_cl.reconstruct.preprocess.sinc_interpolation import resampled
from rift_cl.reference import resample as twin

pytestmark = pytest.mark.dealt


@pytest.mark.parametrize("bins", [5, 16, 61])
@pytest.mark.parametrize("rows", [1, 4])
def test_bins_between_bins_are_the_twin_s(device: rift.Device, rows: int, bins: int) -> None:
    rng = np.random.default_rng(1)
    stack = rng.standard_normal((3, rows, bins)).astype(np.float32)
    for shift in rng.uniform(-7, 7, (3, rows)):
        shifts = 0.003 * np.arange(bins) + shift[:, None]
        got = resampled(device, stack, shifts, along="bins")
        positions = np.arange(bins) + shifts
        np.testing.assert_allclose(got, twin.resampled(stack, positions, 2), atol=2e-6)


@pytest.mark.parametrize("tilt", [-0.08, 0.003, 0.08])
def test_rows_between_rows_are_the_twin_s(device: rift.Device, tilt: float) -> None:
    stack = np.random.default_rng(2).standard_normal((2, 9, 53)).astype(np.float32)
    shifts = -0.1 * np.arange(4)[:, None] - tilt * (np.arange(53) - 20)
    got = resampled(device, stack, shifts, along="rows", first_row=2)
    positions = 2 + np.arange(4)[:, None] + shifts
    np.testing.assert_allclose(got, twin.resampled(stack, positions, 1), atol=2e-6)


def test_whole_bins_are_moved_to_the_bit(device: rift.Device) -> None:
    stack = np.random.default_rng(3).standard_normal((2, 3, 70)).astype(np.float32)
    moved = straightened(stack, [20.5, 17.5, 25.5], 20.5, device=device)
    np.testing.assert_allclose(moved[:, 0], stack[:, 0], atol=1e-6)
    np.testing.assert_allclose(moved[:, 1, 3:], stack[:, 1, :-3], atol=1e-6)
    np.testing.assert_allclose(moved[:, 2, :-5], stack[:, 2, 5:], atol=1e-6)


SIZE, BINS, VIEWS = 96, 139, 200
GRID = rift.Grid((SIZE, SIZE))
ANGLES = np.arange(VIEWS) * np.pi / VIEWS
CENTER = 67.0


def measured(center: float, blur: float = 0.6) -> np.ndarray:
    """The head as a detector sees it that blurs by so many bins, besides their width."""
    from scipy.ndimage import gaussian_filter1d

    fine = 6
    scan = rift.Parallel(ANGLES, BINS * fine, 1 / fine, center * fine + (fine - 1) / 2)
    sinogram = rift.phantom.shepp_logan_sinogram(GRID, scan)
    if blur:
        sinogram = gaussian_filter1d(sinogram, blur * fine, axis=1)
    return sinogram.reshape(VIEWS, BINS, fine).mean(axis=2).astype(np.float32)


def sliced(sinogram: np.ndarray) -> np.ndarray:
    A = rift.Projector(GRID, rift.Parallel(ANGLES, BINS, center=CENTER), "strip")
    return rift.fbp(A, np.ascontiguousarray(sinogram))


@pytest.mark.parametrize(("blur", "lost"), [(0.6, 0.2), (0.0, 1.5)])
def test_straightened_rows_make_the_slices_of_a_straight_axis(blur: float, lost: float) -> None:
    """But for what half a bin's distance hides of data sharper than any detector's."""
    truth = rift.phantom.shepp_logan(GRID)
    best = psnr(sliced(measured(CENTER, blur)), truth)
    centers = CENTER + np.array([-3.5, -0.25, 0.4, 2.5])
    stack = np.stack([measured(center, blur) for center in centers], axis=1)
    crooked = [psnr(sliced(stack[:, row]), truth) for row in range(4)]
    straight = straightened(stack, centers, CENTER)
    scores = [psnr(sliced(straight[:, row]), truth) for row in range(4)]
    print(f"blur {blur}: {best:.2f} dB, straightened {np.round(scores, 2)}")
    assert min(scores) > best - lost
    assert all(score > before + 0.4 for score, before in zip(scores, crooked, strict=True))


# Spheres: x, y, z, radius, density, in samples about the axis and the row 0.
SPHERES = np.array(
    [
        [0.0, 0.0, 33.0, 40.0, 1.0],
        [-14.0, 9.0, 31.0, 11.0, -0.5],
        [16.0, -12.0, 25.0, 12.0, 0.8],
        [5.0, 22.0, 36.0, 9.0, 0.6],
    ]
)


def spheres_on_a_detector(
    tilt: float, rows: np.ndarray, bins: int, center: float, aspect: float = 1.0
) -> np.ndarray:
    """Line integrals through spheres, means over pixels, by a detector turned about row 0."""
    fine = (np.arange(4) + 0.5) / 4 - 0.5
    v = aspect * (rows[:, None] + fine).reshape(-1, 1)
    u = (np.arange(bins)[:, None] + fine).reshape(1, -1) - center
    t, z = u * np.cos(tilt) - v * np.sin(tilt), v * np.cos(tilt) + u * np.sin(tilt)
    stack = np.zeros((VIEWS, len(rows), bins), np.float32)
    for view, angle in enumerate(ANGLES):
        total = np.zeros(np.broadcast_shapes(t.shape, z.shape))
        for x0, y0, z0, radius, density in SPHERES:
            t0 = x0 * np.cos(angle) + y0 * np.sin(angle)
            rest = radius**2 - (t - t0) ** 2 - (z - z0) ** 2
            total += 2 * density * np.sqrt(np.clip(rest, 0, None))
        stack[view] = total.reshape(len(rows), 4, bins, 4).mean(axis=(1, 3))
    return stack


def test_slices_of_a_tilted_scan_are_those_of_an_upright_one() -> None:
    tilt, center, bins = np.deg2rad(1.5), 47.3, 101
    halo = tilt_halo(tilt, bins, center)
    rows = np.arange(30 - halo, 34 + halo)
    tilted = spheres_on_a_detector(tilt, rows, bins, center)
    kept = (halo, halo + 4)
    turned = upright(tilted, tilt, center, pivot=halo - 30, rows=kept)
    straight = spheres_on_a_detector(0.0, np.arange(30, 34), bins, center)
    z, y, x = np.meshgrid(np.arange(30, 34), *(np.arange(400) / 4 - 49.875,) * 2, indexing="ij")
    truth = np.zeros(z.shape)
    for x0, y0, z0, radius, density in SPHERES:
        truth += density * ((x - x0) ** 2 + (y - y0) ** 2 + (z - z0) ** 2 < radius**2)
    truth = truth.reshape(4, 100, 4, 100, 4).mean(axis=(2, 4))
    scan = rift.Parallel(ANGLES, bins, center=center)
    A = rift.Projector(rift.Grid((4, 100, 100)), scan, "strip")
    best, again, before = (
        psnr(rift.fbp(A, np.ascontiguousarray(stack)), truth)
        for stack in (straight, turned, tilted[:, kept[0] : kept[1]])
    )
    assert again > best - 0.2
    assert before < best - 0.5


@pytest.mark.parametrize("aspect", [0.7, 2.0])
def test_rows_of_another_height_are_turned_by_the_same_angle(aspect: float) -> None:
    tilt, center, bins = np.deg2rad(3), 47.3, 101
    halo = tilt_halo(tilt, bins, center, aspect=aspect)
    first = round(30 / aspect)
    rows = np.arange(first - halo, first + 4 + halo)
    tilted = spheres_on_a_detector(tilt, rows, bins, center, aspect)
    straight = spheres_on_a_detector(0.0, np.arange(first, first + 4), bins, center, aspect)
    kept, pivot = (halo, halo + 4), halo - first
    turned, square, before = (
        np.abs(stack - straight).max() / straight.max()
        for stack in (
            upright(tilted, tilt, center, pivot=pivot, rows=kept, aspect=aspect),
            upright(tilted, tilt, center, pivot=pivot, rows=kept),
            tilted[:, halo : halo + 4],
        )
    )
    assert turned < 0.02 and min(square, before) > 0.06
    with pytest.raises(InputError, match="the aspect is 0"):
        upright(tilted, tilt, center, pivot=pivot, aspect=0)
    # Half as high, twice as many rows are crossed.
    with pytest.raises(InputError, match=r"2\.5 degrees"):
        upright(tilted, tilt, center, pivot=pivot, aspect=0.5)


@pytest.mark.parametrize(
    ("tilt", "pivot", "aspect"),
    [(0.02, 25.3, 1), (-0.08, 700.1, 1), (0.05, -3000.7, 1), (0.02, 25.3, 0.4), (-0.08, 70.1, 3)],
)
def test_rows_are_the_same_bits_in_every_slab(
    device: rift.Device, tilt: float, pivot: float, aspect: float
) -> None:
    center, bins = 30.3, 64
    halo = tilt_halo(tilt, bins, center, away=abs(pivot) + 90, aspect=aspect)
    stack = np.random.default_rng(4).standard_normal((2, 40 + 2 * halo, bins)).astype(np.float32)
    kept = (halo, halo + 40)
    set_up = {"aspect": aspect, "device": device}
    whole = upright(stack, tilt, center, pivot=halo + pivot, rows=kept, **set_up)
    for start, stop in ((0, 8), (8, 13), (30, 31), (13, 40)):
        part = stack[:, start : stop + 2 * halo]
        rows = (halo, halo + stop - start)
        there = halo + pivot - start
        got = upright(part, tilt, center, pivot=there, rows=rows, **set_up)
        np.testing.assert_array_equal(got, whole[:, start:stop])


def test_what_cannot_be_straightened() -> None:
    stack = np.zeros((2, 3, 20), np.float32)
    with pytest.raises(ShapeError, match="each of 3"):
        straightened(stack, [1.0, 2.0], 3.0)
    with pytest.raises(ShapeError, match="angle, row, bin"):
        straightened(stack[0], [1.0, 2.0, 3.0], 3.0)
    for centers in ([1.0, 2.0, 40.0], [1.0, 2.0, np.nan]):
        with pytest.raises(InputError, match="centres run from"):
            straightened(stack, centers, 3.0)
    for tilt in (0.2, -0.2, np.nan):
        with pytest.raises(InputError, match="5 degrees"):
            upright(stack, tilt, 3.0, pivot=0)
        with pytest.raises(InputError, match="5 degrees"):
            tilt_halo(tilt, 20)
    with pytest.raises(InputError, match="rows 0 to 3"):
        upright(stack, 0.01, 3.0, pivot=0, rows=(1, 4))
