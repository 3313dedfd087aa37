"""The phantoms against brute-force sampling, quadrature along rays, and laws of projections."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rift_cl import phantom
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Cone, Fan, Grid, Parallel
from rift_cl.phantom import Ellipsoid, rendering

TILTED = Ellipsoid((0.3, -0.7, 1.1), (1.5, 2.0, 3.1), 0.6, 1.7)
SMALL = Ellipsoid((-0.4, 1.9, -2.3), (0.9, 0.8, 0.35), -1.2, -0.6)
PAIR = (TILTED, SMALL)


def inside(part: Ellipsoid, z, y, x):
    """Indicator of an ellipsoid, by rotating the point into its own axes."""
    dz, dy, dx = z - part.center[0], y - part.center[1], x - part.center[2]
    c, s = math.cos(part.angle), math.sin(part.angle)
    own = np.stack(np.broadcast_arrays(dz, -s * dx + c * dy, c * dx + s * dy), axis=-1)
    return ((own / np.array(part.semi_axes)) ** 2).sum(axis=-1) <= 1


def density(parts, z, y, x):
    return sum(part.value * inside(part, z, y, x) for part in parts)


def equatorial(parts):
    return [replace(part, center=(0.0, *part.center[1:])) for part in parts]


def fine(grid: Grid, axis: int, factor: int):
    offsets = ((np.arange(factor) + 0.5) / factor - 0.5) * grid.spacing[axis]
    return (grid.coordinates(axis)[:, None] + offsets).ravel()


def test_an_image_is_the_mean_over_each_pixel():
    grid = Grid((23, 31), spacing=(0.37, 0.29), center=(0.2, -0.1))
    y, x = fine(grid, 0, 24)[:, None], fine(grid, 1, 24)
    expected = density(equatorial(PAIR), 0.0, y, x).reshape(23, 24, 31, 24).mean(axis=(1, 3))
    found = phantom.render(PAIR, grid, oversampling=24)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected, atol=0.03)
    assert abs(found - expected).mean() < 1e-3


def test_a_volume_is_the_mean_over_each_voxel():
    grid = Grid((7, 11, 12), spacing=(0.5, 0.6, 0.7), center=(0.2, -0.3, 0.4))
    z, y, x = (fine(grid, axis, 8) for axis in range(3))
    samples = density(PAIR, z[:, None, None], y[:, None], x)
    expected = samples.reshape(7, 8, 11, 8, 12, 8).mean(axis=(1, 3, 5))
    found = phantom.render(PAIR, grid, oversampling=8)
    np.testing.assert_allclose(found, expected, atol=0.05)
    assert abs(found - expected).mean() < 2e-3


def test_a_pixel_covered_in_part_has_its_share():
    wide = Ellipsoid((0, 0, 0), (1, 1e6, 2.25), 0.0, 1.0)
    found = phantom.render([wide], Grid((1, 8)), oversampling=3)
    np.testing.assert_allclose(found[0], [0, 0.25, 1, 1, 1, 1, 0.25, 0], atol=1e-6)


def test_an_edge_in_the_first_pixel_leaves_nothing_behind():
    grid = Grid((60, 60), spacing=0.1117)
    bar = Ellipsoid((0, 0, -19.5 * 0.1117), (1, 1000, 10 * 0.1117), 0.004, 1.0)
    found = phantom.render([bar], grid, oversampling=7)
    assert (found[:, 25:] == 0).all()
    assert (found[:, 2:18] == 1).all()


def test_an_image_is_the_same_in_strips_of_any_height(monkeypatch):
    grid = Grid((33, 20), spacing=0.4)
    whole = phantom.render(PAIR, grid)
    monkeypatch.setattr(rendering, "_STRIP_SAMPLES", 7 * 20)
    np.testing.assert_array_equal(phantom.render(PAIR, grid), whole)


def test_the_mass_of_image_and_volume():
    area = math.pi * 3.1 * 2.0 * 1.7
    image = phantom.render([TILTED], Grid((80, 90), spacing=(0.1, 0.13)))
    assert image.sum(dtype=float) * 0.1 * 0.13 == pytest.approx(area, rel=1e-4)
    body = phantom.render([TILTED], Grid((20, 40, 40), spacing=(0.2, 0.21, 0.22)))
    volume = 4 / 3 * math.pi * 1.5 * 2.0 * 3.1 * 1.7
    assert body.sum(dtype=float) * 0.2 * 0.21 * 0.22 == pytest.approx(volume, rel=1e-3)


def test_line_integrals_against_quadrature():
    scan = Parallel([0.0, 0.4, math.pi / 2, 2.9, -1.3], bins=17, pitch=0.55, center=7.2)
    along = (np.arange(40_000) + 0.5) / 40_000 * 14 - 7
    c, s = np.cos(scan.angles)[:, None, None], np.sin(scan.angles)[:, None, None]
    t = scan.coordinates()[:, None]
    expected = density(equatorial(PAIR), 0.0, t * s + along * c, t * c - along * s)
    found = phantom.project(PAIR, Grid((4, 4)), scan)
    np.testing.assert_allclose(found, expected.sum(axis=-1) * 14 / 40_000, atol=2e-3)


def test_a_picture_and_its_line_integrals_agree():
    grid = Grid((300, 200), spacing=(0.02, 0.05), center=(0.4, -0.8))
    image = phantom.shepp_logan(grid, oversampling=16)
    for angle, axis, sums in (
        (0.0, 1, image.sum(axis=0) * 0.02),
        (math.pi / 2, 0, image.sum(axis=1) * 0.05),
    ):
        n, spacing, middle = grid.shape[axis], grid.spacing[axis], grid.center[axis]
        pitch = spacing / 16
        scan = Parallel([angle], bins=16 * n, pitch=pitch, center=8 * n - 0.5 - middle / pitch)
        view = phantom.shepp_logan_sinogram(grid, scan).reshape(n, 16).mean(axis=1)
        np.testing.assert_allclose(view, sums, atol=0.005)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, -4.0])
def test_every_view_holds_the_whole_mass(angle):
    scan = Parallel([angle], bins=4000, pitch=0.005)
    view = phantom.project(PAIR, Grid((4, 4)), scan)
    mass = sum(math.pi * p.semi_axes[1] * p.semi_axes[2] * p.value for p in PAIR)
    assert view.sum(dtype=float) * 0.005 == pytest.approx(mass, rel=1e-4)


def test_projection_is_linear():
    grid, scan = Grid((3, 4, 4)), Parallel([0.1, 1.2], bins=30, pitch=0.4)
    apart = phantom.project([TILTED], grid, scan) + phantom.project([SMALL], grid, scan)
    np.testing.assert_allclose(phantom.project(PAIR, grid, scan), apart, atol=1e-5)
    assert not phantom.project([], grid, scan).any()


def test_a_centred_disc_looks_the_same_from_everywhere():
    disc = Ellipsoid((0, 0, 0), (1, 3, 3), 0.9, 2.0)
    scan = Parallel(np.linspace(0, 7, 13), bins=9, pitch=0.7)
    views = phantom.project([disc], Grid((4, 4)), scan)
    chord = 4 * np.sqrt(np.maximum(9 - scan.coordinates() ** 2, 0))
    np.testing.assert_allclose(views, np.broadcast_to(chord, views.shape), rtol=1e-6)


def test_half_a_turn_mirrors_a_view():
    angles = np.array([0.3, 1.9])
    grid = Grid((4, 4))
    there = phantom.project(PAIR, grid, Parallel(angles, bins=21, pitch=0.5))
    back = phantom.project(PAIR, grid, Parallel(angles + math.pi, bins=21, pitch=0.5))
    np.testing.assert_allclose(back, there[:, ::-1], atol=1e-5)


def test_a_shifted_centre_shifts_the_sinogram():
    grid, angles = Grid((64, 64)), [0.0, 0.8, 2.2]
    plain = phantom.shepp_logan_sinogram(grid, Parallel(angles, bins=96))
    shifted = phantom.shepp_logan_sinogram(grid, Parallel(angles, bins=96, center=47.5 + 3))
    np.testing.assert_array_equal(shifted[:, 3:], plain[:, :-3])


def test_a_row_of_a_volume_is_the_section_at_its_z():
    grid = Grid((5, 4, 4), spacing=(0.45, 1, 1), center=(0.1, 0, 0))
    scan = Parallel([0.3, 2.0], bins=25, pitch=0.4)
    stack = phantom.project(PAIR, grid, scan)
    assert stack.shape == (2, 5, 25)
    for row, z in enumerate(grid.coordinates(0)):
        section = [_cut(part, z) for part in PAIR]
        expected = phantom.project([part for part in section if part], grid.slice(), scan)
        np.testing.assert_allclose(stack[:, row], expected, atol=1e-5)


def _cut(part: Ellipsoid, z: float) -> Ellipsoid | None:
    level = 1 - ((z - part.center[0]) / part.semi_axes[0]) ** 2
    if level <= 0:
        return None
    axes = tuple(a * math.sqrt(level) for a in part.semi_axes)
    return replace(part, semi_axes=axes)


def test_the_head_stands_as_everyone_shows_it():
    from skimage.data import shepp_logan_phantom

    theirs = shepp_logan_phantom()
    ours = phantom.shepp_logan(Grid(theirs.shape))

    def likeness(image):
        return np.corrcoef(image.ravel(), theirs.ravel())[0, 1]

    assert likeness(ours) > 0.97
    for wrong in (ours[::-1], ours[:, ::-1], ours.T):
        assert likeness(wrong) < likeness(ours) - 0.02


def test_the_head_has_the_classic_contrasts():
    head = phantom.shepp_logan(Grid((400, 400)))
    assert head.min() == 0
    assert head.max() == pytest.approx(1, abs=1e-6)
    assert head[200, 150] == pytest.approx(0, abs=1e-6)  # left ventricle
    assert head[290, 200] == pytest.approx(0.2, abs=1e-6)  # brain
    assert head[110, 200] == pytest.approx(0.3, abs=1e-6)  # upper ellipse
    assert head[180, 200] == pytest.approx(0.3, abs=1e-6)  # small ellipse above the middle


def test_the_head_goes_with_its_grid():
    near = Grid((40, 60), spacing=(0.5, 0.4))
    far = Grid((40, 60), spacing=(0.5, 0.4), center=(3.0, -7.0))
    np.testing.assert_allclose(phantom.shepp_logan(far), phantom.shepp_logan(near), atol=1e-5)
    scan = Parallel([0.0], bins=99, pitch=0.5)
    there = phantom.shepp_logan_sinogram(far, scan)[0]
    here = phantom.shepp_logan_sinogram(near, scan)[0]
    np.testing.assert_allclose(there[:-14], here[14:], atol=1e-5)


def test_the_head_fills_the_shorter_side_whatever_the_spacing():
    head = phantom.shepp_logan(Grid((100, 300), spacing=(0.2, 0.1)))
    assert np.ptp(np.flatnonzero(head.any(axis=1))) * 0.2 == pytest.approx(0.92 * 20, abs=0.4)
    assert np.ptp(np.flatnonzero(head.any(axis=0))) * 0.1 == pytest.approx(0.69 * 20, abs=0.3)


def test_the_head_as_a_volume():
    grid = Grid((64, 32, 32))
    head = phantom.shepp_logan(grid)
    assert np.ptp(np.flatnonzero(head.any(axis=(1, 2)))) == pytest.approx(0.81 * 32, abs=2)
    stack = phantom.shepp_logan_sinogram(grid, Parallel([0.0], bins=320, pitch=0.1))
    assert stack.shape == (1, 64, 320)
    rows = head.sum(axis=(1, 2))
    found = stack[0].sum(axis=1) * 0.1
    np.testing.assert_allclose(found[21:43], rows[21:43], rtol=0.03)  # away from the caps


def test_the_head_is_not_symmetric_in_z():
    head = phantom.shepp_logan(Grid((100, 100, 100)))
    above, below = head[50 + 12], head[50 - 13]  # 0.25 of the radius off the middle
    np.testing.assert_allclose([above[55, 50], below[55, 50]], [0.3, 0.2], atol=1e-6)
    above, below = head[50 + 17], head[50 - 18]  # beyond one end of the upper ellipsoid
    np.testing.assert_allclose([above[33, 50], below[33, 50]], [0.2, 0.3], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "error", "word"),
    [
        ({"center": (1.0, 2.0)}, ShapeError, "center"),
        ({"semi_axes": (1.0, 2.0, 3.0, 4.0)}, ShapeError, "semi_axes"),
        ({"semi_axes": (1.0, 0.0, 3.0)}, InputError, "semi_axes"),
        ({"semi_axes": (1.0, math.nan, 3.0)}, InputError, "finite"),
        ({"value": math.nan}, InputError, "finite"),
    ],
)
def test_a_useless_ellipsoid_is_refused(change, error, word):
    with pytest.raises(error, match=word):
        replace(TILTED, **change)


@pytest.mark.parametrize("oversampling", [0, -1, 1.5])
def test_a_useless_oversampling_is_refused(oversampling):
    with pytest.raises(InputError, match="oversampling"):
        phantom.shepp_logan(Grid((8, 8)), oversampling=oversampling)


ANGLES = np.array([0.3, 1.9, -2.5])


def from_a_point(curved: bool, **changes) -> Cone:
    given = {"center": (5.4, 9.1), "heights": [0.4, -0.7, 0.2], "curved": curved, **changes}
    return Cone(ANGLES, 12, 19, (0.9, 0.8), 11.0, 17.0, **given)


@pytest.mark.parametrize("curved", [False, True])
def test_rays_of_a_cone_against_quadrature(curved):
    scan = from_a_point(curved)
    along = ((np.arange(20_000) + 0.5) / 20_000 * 14 + 4)[:, None]
    found = phantom.project(PAIR, Grid((4, 4, 4)), scan, dtype=np.float64)
    for view, row, column in ((0, 5, 11), (1, 7, 7), (2, 6, 8)):
        angle, height = scan.angles[view], scan.heights[view]
        gamma = scan.fan_angles()[column]
        v = (row - scan.center[0]) * scan.pitch[0]
        across = np.array([math.cos(angle), math.sin(angle), 0])
        ahead = np.array([-math.sin(angle), math.cos(angle), 0])
        depth = math.cos(gamma) if curved else 1.0
        ray = 17 * depth * (math.tan(gamma) * across + ahead) + [0, 0, v]
        x, y, z = (np.array([0, 0, height]) - 11 * ahead + along * ray / np.linalg.norm(ray)).T
        expected = density(PAIR, z, y, x).sum() * 14 / 20_000
        assert found[view, row, column] == pytest.approx(expected, abs=4e-3)
        assert expected > 1


def test_rays_through_a_ball_are_its_chords():
    ball = Ellipsoid.ball(3.0, 2.0, center=(0.5, -1.0, 0.7))
    scan = from_a_point(False)
    corner, far = scan.vectors().corners()[0], scan.vectors().source
    ray = corner - far
    offset = np.linalg.norm(np.cross(ray, far - [0.7, -1.0, 0.5]), axis=1)
    offset /= np.linalg.norm(ray, axis=1)
    chord = 4 * np.sqrt(np.maximum(9 - offset**2, 0))
    views = phantom.project([ball], Grid((4, 4, 4)), scan, dtype=np.float64)
    np.testing.assert_allclose(views[:, 0, 0], chord, rtol=1e-12)
    assert views.max() == pytest.approx(12, rel=0.02)


def test_a_cone_and_its_vectors_see_the_same():
    grid, scan = Grid((4, 4, 4)), from_a_point(False)
    cone = phantom.project(PAIR, grid, scan, dtype=np.float64)
    np.testing.assert_allclose(phantom.project(PAIR, grid, scan.vectors()), cone, atol=1e-6)


@pytest.mark.parametrize("curved", [False, True])
def test_the_middle_row_of_a_cone_is_its_fan(curved):
    scan = from_a_point(curved, center=(5, 9.1), heights=[0.4] * 3)
    row = phantom.project(PAIR, Grid((4, 4, 4)), scan)[:, 5]
    slices = Grid((3, 4, 4), spacing=(0.4, 1, 1))
    stack = phantom.project(PAIR, slices, scan.fan())
    np.testing.assert_allclose(stack[:, 2], row, atol=1e-5)
    image = phantom.project(equatorial(PAIR), slices.slice(), scan.fan())
    np.testing.assert_allclose(image.max(), stack.max(), rtol=0.1)
    assert image.shape == row.shape


def test_a_source_far_away_has_parallel_rays():
    grid, far = Grid((3, 4, 4)), 1e7
    fan = Fan(ANGLES, 31, 0.4, far, far, center=14.3)
    parallel = Parallel(ANGLES, 31, 0.4, center=14.3)
    there, here = phantom.project(PAIR, grid, fan), phantom.project(PAIR, grid, parallel)
    np.testing.assert_allclose(there, here, atol=1e-4)
    assert there.shape == here.shape == (3, 3, 31)
