"""FDK is quantitative, chooses by the scan, and is the operator that it says it is.

Densities are those of a uniform ball, whose exact line integrals, averaged over the bins, are the
data: means over the ball in the middle plane say whether weights and scales are right, whatever the
magnification, the pitch and the detector's shape.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from averaged_rays import averaged_on

import rift_cl as rift
from rift_cl import Cone, Grid, Projector, backproject, fbp, phantom
from rift_cl.errors import InputError
from rift_cl.operators import as_filter
from rift_cl.reconstruct import FDK, extended
from rift_cl.reconstruct.calibration import turned
from rift_cl.reference import filter_rows

pytestmark = pytest.mark.once

N = 32
GRID = Grid((N, N, N))
BALL = phantom.Ellipsoid.ball(0.35 * N, 1.7)
AWAY = np.arange(N) - (N - 1) / 2
RADIUS = np.sqrt(AWAY[:, None, None] ** 2 + AWAY[:, None] ** 2 + AWAY**2)
FULL = np.arange(90) * 2 * np.pi / 90
averaged = partial(averaged_on, GRID)


def circle(angles=FULL, magnification=1.5, distance=3.0, share=1.0, **changes):
    """A scan whose detector just sees the ball about the grid, with bins of a share of a voxel."""
    to_axis = distance * N
    to_detector = to_axis * magnification
    width = 2.04 * to_detector * np.tan(np.arcsin(0.5 / distance))
    bins = round(N / share)
    return Cone(angles, bins, bins, width / bins, to_axis, to_detector, **changes)


def level(volume, within):
    """The mean in a part of the ball, over its density."""
    return float(volume[within].mean() / BALL.value)


def test_fdk_is_its_formula(device):
    scan = circle(FULL[::9], heights=np.full(10, 0.7), center=(14.0, 15.6))
    A = Projector(GRID, scan, device=device)
    y = np.random.default_rng(0).standard_normal(A.range).astype(np.float32)
    u = (np.arange(scan.bins) - scan.center[1]) * scan.pitch[1]
    v = (np.arange(scan.rows) - scan.center[0]) * scan.pitch[0]
    S, magnification = scan.source_to_detector, scan.magnification
    cosine = S / np.sqrt(S**2 + u**2 + v[:, None] ** 2)
    pitch = scan.pitch[1] / magnification
    taps = as_filter("hann").taps(scan.bins, pitch)
    factor = np.pi / 10 * scan.pitch[0] * scan.pitch[1] / magnification**2
    filtered = factor * cosine * filter_rows(cosine * y, taps, pitch)
    expected = Projector(GRID, scan, "point", device=device).T(filtered.astype(np.float32))
    found = FDK(A, "hann")(y)
    np.testing.assert_allclose(found, expected, atol=2e-5 * np.abs(expected).max())


@pytest.mark.parametrize("curved", [False, True], ids=["flat", "curved"])
@pytest.mark.parametrize("magnification", [1.2, 15.0])
def test_the_middle_of_a_ball_has_its_density(device, magnification, curved):
    scan = circle(magnification=magnification, curved=curved)
    volume = FDK(Projector(GRID, scan, device=device))(averaged([BALL], scan))
    middle = (RADIUS < 0.28 * N) & (np.abs(AWAY) < 1)[:, None, None]
    assert level(volume, middle) == pytest.approx(1, abs=1e-3)


def test_a_whole_ball_has_its_density_in_a_narrow_cone(device):
    scan = circle(distance=10.0)
    volume = FDK(Projector(GRID, scan, device=device))(averaged([BALL], scan))
    assert level(volume, RADIUS < 0.28 * N) == pytest.approx(1, abs=1e-3)


def test_fdk_is_linear_and_has_an_adjoint(device):
    A = Projector(GRID, circle(FULL[::6]), device=device)
    F = FDK(A, "hann")
    assert rift.dot_test(F) < 1e-8
    one, other = np.random.default_rng(1).standard_normal((2, *A.range)).astype(np.float32)
    sum_of_two = F((2 * one + other).astype(np.float32))
    np.testing.assert_allclose(sum_of_two, 2 * F(one) + F(other), atol=1e-4 * np.ptp(sum_of_two))


# Balls of 17 bins across and more: fewer leave a ripple of their edge, whatever the rays.
@pytest.mark.parametrize(
    ("share", "voxel"),
    [(0.5, 1.0), (0.75, 1.0), (1.3, 1.0), (1.0, 0.5)],
    ids=["0.5", "0.75", "1.3", "2"],
)
def test_levels_are_right_at_any_pitch(device, share, voxel):
    scan = circle(FULL[::2], share=share)
    # The rows that two slices next to the orbit are seen in, and those next to them.
    scan = replace(scan, rows=8, center=(3.5, scan.center[1]))
    grid = Grid((2, round(N / voxel), round(N / voxel)), spacing=voxel)
    plane = fbp(Projector(grid, scan, device=device), averaged([BALL], scan, 12))
    away = grid.coordinates(2)
    middle = np.hypot(away[:, None], away) < 0.28 * N
    assert level(plane, np.broadcast_to(middle, plane.shape)) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("rows", [8, pytest.param(1, marks=pytest.mark.full)])
def test_levels_are_right_from_the_first_row_to_the_last(device, rows):
    """Of a cylinder, whose densities no cone's angle lowers."""
    scan = circle(FULL[::2], distance=10.0, share=2.0)
    scan = replace(scan, rows=rows, center=((rows - 1) / 2, scan.center[1]))
    row = scan.pitch[0] / scan.magnification
    places = np.arange(4 * rows - 3)
    grid = Grid((len(places), 3, 3), (row / 4, 1, 1))
    cylinder = phantom.Ellipsoid((0.0, 0.0, 0.0), (1e5, 0.35 * N, 0.35 * N), 0.0, 1.0)
    y = phantom.project([cylinder], GRID, scan)
    levels = FDK(Projector(grid, scan, device=device))(y).mean(axis=(1, 2))
    np.testing.assert_allclose(levels, levels[len(levels) // 2], rtol=2e-3)
    np.testing.assert_allclose(levels[0], 1, rtol=5e-2)


HEAD = phantom.head(GRID)
HEAD_VOLUME = phantom.render(HEAD, GRID)
SPAN = np.pi + 2.2 * np.arcsin(0.5 / 3)
SHORT = 0.3 + np.arange(60) * SPAN / 60


def quality(device, scan, data_scan=None):
    """PSNR of the head in the ball about the grid, in dB."""
    y = phantom.project(HEAD, GRID, scan if data_scan is None else data_scan)
    volume = FDK(Projector(GRID, scan, device=device))(y)
    off = (volume - HEAD_VOLUME)[RADIUS < 0.48 * N]
    return -10 * np.log10(np.mean(off.astype(float) ** 2))


@pytest.mark.parametrize("first", [0, 3.0], ids=["from its start", "past the full turn"])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_short_scan_is_nearly_a_full_turn_in_either_sense(device, sense, first):
    scan = circle((first + SHORT)[::sense])
    assert quality(device, scan) > quality(device, circle()) - 1.5


def test_a_short_scan_taken_in_the_wrong_sense_is_worse(device):
    right = circle(SHORT)
    assert quality(device, circle(-SHORT), right) < quality(device, right) - 3


def test_uneven_views_are_weighed_by_their_gaps(device):
    angles = np.sort(np.random.default_rng(0).uniform(0, 2 * np.pi, 90))
    assert quality(device, circle(angles)) > quality(device, circle()) - 1.5


def test_a_helix_is_refused_with_the_methods_that_take_it(device):
    scan = circle(FULL[::30], heights=[0.0, 1.0, 2.0])
    with pytest.raises(InputError, match=r"heights.*cgls"):
        FDK(Projector(GRID, scan, device=device))


def test_a_short_span_is_refused_with_the_methods_that_take_it(device):
    with pytest.raises(InputError, match=r"half a turn.*cgls"):
        FDK(Projector(GRID, circle(FULL[:40]), device=device))


@pytest.mark.parametrize("center", [8.5, 22.5], ids=["left", "right"])
def test_a_detector_to_one_side_of_the_axis_sees_all_in_a_full_turn(device, center):
    whole = circle()
    first = 15.5 - center if center < 15.5 else 0
    cut = replace(whole, bins=N - round(abs(15.5 - center)), center=(15.5, 15.5 - first))
    if center > 15.5:
        cut = replace(cut, center=(15.5, 15.5))
    F = FDK(Projector(GRID, cut, device=device))
    assert "Wang" in F.sentence
    assert quality(device, cut) > quality(device, whole) - 0.8
    assert rift.dot_test(F) < 1e-8


def test_a_full_turn_of_a_displaced_detector_may_lack_every_eighth_view(device):
    whole = replace(circle(FULL[::2]), bins=N - 7, center=(15.5, 8.5))
    left = whole.subset([view for view in range(whole.views) if view % 8])
    assert quality(device, left) > quality(device, whole) - 1.5


def rim(device, scan, parts):
    """Error in the outer fifth of a disc, root mean square, short of its edge."""
    grid = Grid((2, 2 * N, 2 * N), spacing=0.5)
    plane = fbp(Projector(grid, scan, device=device), averaged(parts, scan, 8))
    away, radius = grid.coordinates(2), parts[0].semi_axes[0]
    distance = np.hypot(away[:, None], away)
    within = (distance > 0.8 * radius) & (distance < radius - 1.2)
    return float(np.sqrt(np.mean((plane[:, within] - parts[0].value) ** 2)))


@pytest.mark.parametrize(
    "off", [pytest.param(off, marks=pytest.mark.full) for off in (0.5, 3.0, 10.0)] + [1.0, 2.0]
)
def test_an_object_that_fills_the_longer_side_has_its_rim(device, off):
    whole = replace(circle(distance=1.5), rows=8, bins=64, center=(3.5, 31.5))
    cut = replace(whole, bins=32, center=(3.5, 15.5 - off))
    radius = 0.99 * cut.source_to_axis * np.sin(cut.fan_angles()[-1])
    parts = [phantom.Ellipsoid.ball(radius, 1.0)]
    best = rim(device, whole, parts)
    assert rim(device, cut, parts) < 1.2 * best + 2e-3


@pytest.mark.full
def test_backprojection_alone_has_the_unit_of_a_parallel_one(device):
    scan = circle(distance=20.0)
    parallel = rift.Parallel(FULL, scan.bins, scan.pitch[1] / scan.magnification)
    ball = [phantom.Ellipsoid.ball(0.2 * N)]
    cone = backproject(Projector(GRID, scan, device=device), phantom.project(ball, GRID, scan))
    A = Projector(GRID, parallel, device=device)
    flat = backproject(A, phantom.project(ball, GRID, parallel))
    assert cone[16, 16, 16] == pytest.approx(flat[16, 16, 16], rel=0.02)


def test_circular_vectors_are_reconstructed_as_their_cone(device):
    scan = circle(FULL[::3])
    y = phantom.project(HEAD, GRID, scan)
    there = fbp(Projector(GRID, scan, device=device), y)
    here = fbp(Projector(GRID, scan.vectors(), device=device), y)
    np.testing.assert_allclose(here, there, atol=1e-4)


def test_a_detector_before_the_axis_sees_what_one_behind_it_does(device):
    scan = circle(FULL[::3], center=(12.0, 17.1))
    far, y = scan.vectors(), phantom.project(HEAD, GRID, scan)
    near = replace(
        far,
        middle=far.source + 0.3 * (far.middle - far.source),
        across=0.3 * far.across,
        down=0.3 * far.down,
    )
    there = fbp(Projector(GRID, scan, device=device), y)
    here = fbp(Projector(GRID, near, device=device), y)
    np.testing.assert_allclose(here, there, atol=1e-4)


@pytest.mark.parametrize("across", [1, -1])
def test_detectors_whose_axes_run_backwards_give_the_same_volume(device, across):
    # The head leaves the detector at a side and at an end.
    scan = circle(FULL[::3], center=(12.0, 17.1))
    vectors, y = scan.vectors(), phantom.project(HEAD, GRID, scan)
    back = replace(vectors, across=across * vectors.across, down=-vectors.down)
    there = fbp(Projector(GRID, scan, device=device), y)
    here = fbp(Projector(GRID, back, device=device), y[:, ::-1, ::across].copy())
    np.testing.assert_allclose(here, there, atol=1e-4)


def test_a_tilted_detector_of_one_row_is_a_fan(device):
    scan = replace(circle(FULL), rows=1, center=(0.0, 15.5))
    slanted, grid = turned(scan, 0.0, np.deg2rad(3)), Grid((1, N, N))
    ball = [phantom.Ellipsoid.ball(0.35 * N, 1.7, (0.0, 1.0, 2.0))]
    volumes = [
        fbp(Projector(grid, each, device=device), phantom.project(ball, grid, each))
        for each in (scan, slanted)
    ]
    within = np.hypot(AWAY[:, None] - 1, AWAY - 2) < 0.25 * N
    assert volumes[1][0][within].mean() == pytest.approx(volumes[0][0][within].mean(), rel=2e-3)
    few = replace(slanted, bins=3)
    with pytest.raises(InputError, match=r"bins.*cgls"):
        fbp(Projector(grid, few, device=device), np.zeros((90, 1, 3)))


def test_the_first_row_of_a_rolled_detector_is_read(device):
    """Of a long rod; half a sample beyond the outer ones is read as they are."""
    scan = circle(FULL[::3])
    rod = [phantom.Ellipsoid((0.0, 0.0, 0.0), (4000.0, 8.0, 8.0), 0.0, 1.7)]
    A = Projector(GRID, turned(scan, np.deg2rad(1)), device=device)
    volume = fbp(A, phantom.project(rod, GRID, A.scan))
    within = np.hypot(AWAY[:, None], AWAY) < 5
    np.testing.assert_allclose(volume[:, within].mean(axis=1), 1.7, rtol=0.02)
    assert rift.dot_test(FDK(A)) < 1e-7


def test_vectors_that_are_no_circle_are_refused_with_the_methods_that_take_them(device):
    vectors = circle(FULL[::3]).vectors()
    source = vectors.source.copy()
    source[4, 2] += 3.0
    with pytest.raises(InputError, match=r"view 4.*cgls"):
        fbp(Projector(GRID, replace(vectors, source=source), device=device), np.zeros(1))


def test_a_circle_about_another_axis_is_refused_as_that(device):
    """All sources are on one circle, so that no view may be called beside the others."""
    vectors, away = circle(FULL[::3]).vectors(), np.array([2.0, 0, 0])
    beside = replace(vectors, source=vectors.source + away, middle=vectors.middle + away)
    with pytest.raises(InputError, match=r"axis x = y = 0.*another axis.*cgls") as told:
        fbp(Projector(GRID, beside, device=device), np.zeros(1))
    assert "others" not in str(told.value)


def test_tilted_detectors_are_read_as_upright_ones(device):
    scan = circle(FULL[::2])
    level, random = scan.vectors(), np.random.default_rng(4)
    turn, shift = np.deg2rad(3) * random.standard_normal((2, 45)), random.standard_normal((45, 1))
    roll = turn[0][:, None] * scan.pitch[1]
    across, down = level.across + roll * [0, 0, 1], level.down - roll * level.across / scan.pitch[1]
    tilted = replace(level, middle=level.middle + shift * across, across=across, down=down)
    y = phantom.project(HEAD, GRID, tilted)

    def off(volume):
        return np.sqrt(np.mean((volume - HEAD_VOLUME)[RADIUS < 0.45 * N] ** 2))

    F = FDK(Projector(GRID, tilted, device=device))
    best = off(fbp(Projector(GRID, scan, device=device), phantom.project(HEAD, GRID, scan)))
    assert off(F(y)) < 1.3 * best
    assert off(fbp(Projector(GRID, scan, device=device), y)) > 1.5 * best
    assert rift.dot_test(F) < 1e-7


def test_a_ball_wider_than_the_detector_is_level_where_rows_are_continued(device):
    cut = replace(circle(FULL[::2]), bins=16, center=(15.5, 7.5))
    y = phantom.project([BALL], GRID, cut)
    longer, wide = extended(y, cut, bins=6)
    assert (wide.bins, wide.center) == (28, (15.5, 13.5))

    def rise(scan, data):
        """How much brighter the border of what is seen is than its middle."""
        plane = fbp(Projector(GRID, scan, device=device), data)[15:17]
        away = np.hypot(AWAY[:, None], AWAY)
        return plane[:, (away > 6) & (away < 7)].mean() - plane[:, away < 3].mean()

    assert abs(rise(wide, longer)) < 0.5 * rise(cut, y)
