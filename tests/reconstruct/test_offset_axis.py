"""A full turn with the axis near one end of the detector: every line counts once."""

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.metrics import psnr
from rift_cl.reconstruct import FilteredBackprojection
from rift_cl.reconstruct.direct.offset_axis import (
    is_bridged,
    is_full_turn,
    is_offset,
    is_uneven,
    is_weighed,
    offset_weights,
    passes_half,
    widened,
    widest_hole,
)

SIZE, BINS, VIEWS, CENTER = 160, 92, 480, 11.3
ANGLES = np.arange(VIEWS) * 2 * np.pi / VIEWS
GRID = rift.Grid((SIZE, SIZE))


def half_sinogram(center, bins=BINS, angles=ANGLES):
    scan = rift.Parallel(angles, bins, center=center)
    return rift.phantom.shepp_logan_sinogram(GRID, scan).astype(np.float32), scan


@pytest.mark.parametrize("center", [0.5, 7.0, 11.3, 43.0, 44.5, BINS - 9.6])
def test_weights_of_a_line_and_its_opposite_add_up(center):
    scan = rift.Parallel(ANGLES, BINS, center=center)
    weights, t = offset_weights(scan), np.arange(BINS) - center
    short = min(center, BINS - 1 - center)
    opposite = np.interp(-t, t, weights, left=0, right=0)
    inside = np.abs(t) <= short
    if center % 0.5 == 0:  # there, opposite bins are bins
        np.testing.assert_allclose((weights + opposite)[inside], 2)
    once = np.abs(t) > short
    assert np.all(np.isclose(weights[once], 2))


@pytest.mark.parametrize("center", [CENTER, BINS - 1 - CENTER])
def test_the_slice_is_that_of_a_detector_twice_as_wide(center):
    truth = rift.phantom.shepp_logan(GRID)
    sinogram, scan = half_sinogram(center)
    joined, wide = widened(sinogram, scan)
    image = rift.fbp(rift.Projector(GRID, wide), joined)
    # What fbp does to a scan whose rays were not weighed.
    np.testing.assert_array_equal(rift.fbp(rift.Projector(GRID, scan), sinogram), image)
    whole, scan = half_sinogram(80.0, 161, ANGLES[: VIEWS // 2])
    best = psnr(rift.fbp(rift.Projector(GRID, scan), whole), truth)
    assert psnr(image, truth) > best - 0.7


def test_weighing_is_part_of_the_operator(device):
    angles, grid = ANGLES[::16], rift.Grid((3, 24, 20))
    A = rift.Projector(grid, rift.Parallel(angles, 26, center=7.3), device=device)
    F, y = FilteredBackprojection(A, "hann"), np.random.default_rng(0).standard_normal(A.range)
    assert F.domain == A.range and rift.dot_test(F) < 1e-6
    y = y.astype(np.float32)
    whole = F(y)
    # One step after the other on the host.
    steps, back = np.empty_like(whole), np.empty_like(y)
    F._apply_steps(y, steps)
    np.testing.assert_array_equal(steps, whole)
    F._apply_adjoint_steps(whole, back)
    np.testing.assert_array_equal(back, F.T(whole))
    again, given = F.__reduce__()
    np.testing.assert_array_equal(again(*given)(y), whole)


def test_a_view_stands_for_its_own_side_where_its_opposite_is_missing():
    angles = np.delete(ANGLES[::8], np.arange(0, 60, 8))
    best, errors = half_sinogram(CENTER, angles=ANGLES[::8]), []
    for sinogram, scan in (best, half_sinogram(CENTER, angles=angles)):
        image = rift.fbp(rift.Projector(GRID, scan), sinogram)
        joined, wide = widened(sinogram, scan)
        np.testing.assert_array_equal(rift.fbp(rift.Projector(GRID, wide), joined), image)
        whole, every = best
        again = rift.Projector(GRID, every)(image)
        errors.append(np.linalg.norm(again - whole) / np.linalg.norm(whole))
    assert errors[1] < 1.5 * errors[0]


def test_views_beside_a_hole_stand_for_what_is_missing():
    """A ball beyond the shorter side keeps its density, up to holes of 15 degrees."""
    angles = np.delete(ANGLES[::4], range(20, 23))
    assert not is_full_turn(angles) and is_bridged(angles)
    scan = rift.Parallel(angles, BINS, center=CENTER)
    away = np.arange(BINS) - CENTER - 40 * np.cos(angles - 0.6)[:, None]
    chords = 2 * np.sqrt(np.clip(20.0**2 - away**2, 0, None)).astype(np.float32)
    image = rift.fbp(rift.Projector(GRID, scan), chords)
    y, x = (GRID.coordinates(axis) for axis in (0, 1))
    ball = np.hypot(x - 40 * np.cos(0.6), y[:, None] - 40 * np.sin(0.6)) < 14
    assert image[ball].mean() == pytest.approx(1, abs=0.02)
    assert not is_bridged(np.delete(angles, range(20, 23)))
    first, last = widest_hole(np.append(angles[::-1], angles[:3] + 2 * np.pi))
    np.testing.assert_allclose([first, last], ANGLES[[76, 92]])
    first, last = widest_hole(ANGLES[:400])
    np.testing.assert_allclose([first, last], [ANGLES[399], 2 * np.pi])


def test_more_than_half_a_turn_is_clearly_so():
    degrees = [np.deg2rad(np.arange(span)) for span in (181, 190, 200, 300)]
    assert [passes_half(angles) for angles in degrees] == [False, False, True, True]
    assert not passes_half(-degrees[0]) and passes_half(-degrees[3])


@pytest.mark.parametrize("center", [11.3, 44.6, 45.2])
def test_rays_are_weighed_once(center):
    """Whether the sides of what ``widened`` gives are of one length or not."""
    scan = rift.Parallel(ANGLES, BINS, center=center)
    _, wide = widened(np.zeros((VIEWS, BINS), np.float32), scan)
    assert is_weighed(scan) == (center != 45.2)
    assert not is_weighed(wide)
    assert not is_weighed(rift.Parallel(ANGLES[: VIEWS // 2], BINS, center=center))


def disc_sinogram(scan, radius, fine=8):
    """Line integrals of a uniform disc about the axis, each the mean over its bin."""
    over = (np.arange(scan.bins * fine) + 0.5) / fine - 0.5 - scan.center
    chords = 2 * np.sqrt(np.clip(radius**2 - over**2, 0, None)).reshape(-1, fine).mean(axis=1)
    return np.tile(chords.astype(np.float32), (scan.angles.size, 1))


def rim(sinogram, scan, radius):
    """Error in the outer fifth of a disc, root mean square, short of its edge."""
    grid = rift.Grid((160, 160), spacing=0.5)
    image = rift.fbp(rift.Projector(grid, scan), sinogram)
    away = np.hypot(grid.coordinates(0)[:, None], grid.coordinates(1))
    within = (away > 0.8 * radius) & (away < radius - 1.2)
    return float(np.sqrt(np.mean((image[within] - 1) ** 2)))


@pytest.mark.parametrize(
    "off", [pytest.param(off, marks=pytest.mark.full) for off in (-1.0, 1.0, 4.0)] + [2.0]
)
def test_an_object_that_fills_the_longer_side_has_its_rim(off):
    angles = ANGLES[::2]
    scan = rift.Parallel(angles, 64, center=31.5 - off)
    radius = 0.99 * (31.5 + abs(off))
    whole = rift.Parallel(angles, 81)
    best = rim(disc_sinogram(whole, radius), whole, radius)
    cut = disc_sinogram(scan, radius)
    assert rim(*widened(cut, scan), radius) < 1.2 * best + 2e-3
    assert rim(cut, scan, radius) < 1.2 * best + 2e-3


def test_sides_that_differ_by_a_rounding_are_even():
    assert not is_uneven(31.7, 64)
    assert is_uneven(31.8, 64)
    assert is_uneven(30.0, 64)
    assert not is_uneven(-1.0, 64)


def test_only_full_turns_with_an_axis_off_the_middle_are_offset():
    half = ANGLES[: VIEWS // 2]
    assert is_offset(rift.Parallel(ANGLES, BINS, center=CENTER))
    assert not is_offset(rift.Parallel(half, BINS, center=CENTER))
    assert not is_offset(rift.Parallel(ANGLES, BINS))
    assert not is_offset(rift.Parallel(ANGLES, BINS, center=-3))
    assert is_full_turn(np.append(ANGLES, 2 * np.pi))
    assert is_full_turn(np.random.default_rng(0).permutation(ANGLES))
    assert is_full_turn(np.arange(720) * 2 * np.pi / 360)
    assert is_full_turn(np.delete(np.deg2rad(np.arange(360)), [100, 101]))
    assert not is_full_turn(np.delete(np.deg2rad(np.arange(360)), range(100, 110)))
    assert is_full_turn(np.random.default_rng(0).uniform(0, 2 * np.pi, 160))
    two_holes = [*range(100, 120), *range(200, 220)]
    assert not is_full_turn(np.delete(np.deg2rad(np.arange(360)), two_holes))
    assert not is_full_turn(half)


@pytest.mark.parametrize("views", [16, 40, 41, 60])
@pytest.mark.parametrize("every", [3, 8, 20])
def test_a_full_turn_stays_one_where_every_so_many_views_are_left_out(views, every):
    turn = np.arange(views) * 2 * np.pi / views + 0.3
    assert is_full_turn(np.delete(turn, np.arange(0, views, every)))


@pytest.mark.parametrize("views", [7, 8, 12, 40])
@pytest.mark.parametrize("degrees", [180, 200, 230])
def test_short_scans_are_no_full_turns_with_holes(views, degrees):
    span = np.linspace(0, np.deg2rad(degrees), views)
    assert not is_full_turn(span)
    assert not is_full_turn(np.delete(span, np.arange(1, views, 8)))
    assert not is_full_turn(np.concatenate([span / 3, np.pi + span / 3]))


@pytest.mark.parametrize("center", [6.0, CENTER, 30.25, BINS - 8.4])
@pytest.mark.parametrize("noise", [0, 0.02])
def test_the_axis_is_found_near_an_end(center, noise):
    sinogram, _ = half_sinogram(center)
    noisy = sinogram + np.random.default_rng(2).normal(0, noise * sinogram.max(), sinogram.shape)
    found = rift.find_center(noisy.astype(np.float32), ANGLES)
    assert found.center == pytest.approx(center, abs=0.1)
    assert found.by == "opposite views"


def test_an_odd_number_of_views_has_opposites_too():
    angles = np.arange(241) * 2 * np.pi / 241
    sinogram, _ = half_sinogram(CENTER, angles=angles)
    assert rift.find_center(sinogram, angles).center == pytest.approx(CENTER, abs=0.1)


def test_half_turns_and_axes_off_the_detector_are_told():
    sinogram, scan = half_sinogram(CENTER)
    with pytest.raises(InputError, match="--center"):
        rift.find_center(sinogram[: VIEWS // 2], ANGLES[: VIEWS // 2])
    with pytest.raises(InputError, match="overlap"):
        offset_weights(rift.Parallel(ANGLES, BINS, center=-4))
    assert scan.bins == BINS
