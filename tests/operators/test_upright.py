"""Upright detectors behind tilted ones: where rays meet them, what is read, and its transpose."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Cone, Grid, Vectors
from rift_cl.errors import InputError
from rift_cl.operators.projector.cone.rectification import Rectification
from rift_cl.operators.projector.cone.upright import looking_along_z, rectified
from rift_cl.reference.upright import places_on_plane, reading_matrix

GRID = Grid((20, 24, 22), center=(1.0, -2.0, 0.5))


def turned(vectors, degrees, seed=0):
    """Detectors that are tilted about all three axes and shifted, view by view."""
    random = np.random.default_rng(seed)
    tilts = np.deg2rad(degrees) * random.standard_normal((vectors.views, 3))
    turns = np.array([_turn(tilt) for tilt in tilts])
    across, down = (np.einsum("nij,nj->ni", turns, v) for v in (vectors.across, vectors.down))
    middle = vectors.middle + 0.02 * degrees * random.standard_normal((vectors.views, 3))
    source = vectors.source + 0.02 * degrees * random.standard_normal((vectors.views, 3))
    return Vectors(source, middle, across, down, vectors.rows, vectors.bins)


def _turn(tilt):
    x, y, z = tilt
    generator = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.linalg.solve(np.eye(3) - generator / 2, np.eye(3) + generator / 2)


def circle(views=5, rows=26, bins=30):
    angles = np.linspace(0, 2 * np.pi, views, endpoint=False) + 0.1
    return Cone(angles, rows, bins, 1.4, 90.0, 130.0).vectors()


def lying(views=3):
    """Sources on a small circle below, detectors above: laminography."""
    angles = np.linspace(0, 2 * np.pi, views, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.full(views, -2.0)], axis=1)
    across = np.broadcast_to([1.4, 0.0, 0.0], (views, 3))
    down = np.broadcast_to([0.0, 1.4, 0.0], (views, 3))
    return Vectors(40 * ring, -20 * ring, across, down, 26, 30)


SCANS = {
    "tilted": (turned(circle(), 8), False),
    "rolled": (turned(circle(), 50, seed=4), False),
    "lying": (turned(lying(), 8), True),
}


@pytest.fixture(params=list(SCANS))
def case(request):
    return SCANS[request.param]


def rays(scan, view):
    k = np.arange(scan.bins) - (scan.bins - 1) / 2
    i = np.arange(scan.rows) - (scan.rows - 1) / 2
    pixels = k[None, :, None] * scan.across[view] + i[:, None, None] * scan.down[view]
    return (pixels + scan.middle[view] - scan.source[view]).reshape(-1, 3)


def matrices(scan, found, along_z, spline):
    """Matrices from each upright view to the pixels of its tilted one, by plane and ray alone."""
    axes = [0, 2, 1] if along_z else [0, 1, 2]
    upright = found.upright
    for n, view in enumerate(found.views):
        sine, cosine = np.sin(upright.angles[n]), np.cos(upright.angles[n])
        along = np.array([cosine, sine, 0.0]) * upright.pitch[1]
        up = np.array([0.0, 0.0, 1.0]) * upright.pitch[0]
        ahead = np.array([-sine, cosine, 0.0]) * upright.source_to_detector
        foot = ahead - upright.center[1] * along - upright.center[0] * up
        places = places_on_plane(rays(scan, view)[:, axes], foot, along, up, ahead)
        yield reading_matrix(places, upright.rows, upright.bins, spline=spline)


def reading(device, scan, found, *, spline=False):
    tilted, upright = (scan.rows, scan.bins), (found.upright.rows, found.upright.bins)
    dtype = np.dtype(np.float32)
    return Rectification(device, tilted, upright, found.views, found.forms, dtype, spline=spline)


@pytest.mark.full
@pytest.mark.each
@pytest.mark.parametrize("spline", [False, True])
def test_reading_and_its_transpose_equal_the_matrices(device, case, spline):
    scan, along_z = case
    found = rectified(GRID, scan, along_z=along_z)
    assert len(found.views) == scan.views
    read = reading(device, scan, found, spline=spline)
    random = np.random.default_rng(1)
    upright = random.standard_normal((scan.views, found.upright.rows, found.upright.bins))
    data = random.standard_normal((scan.views, scan.rows, scan.bins))
    out = device.empty(data.shape)
    read.read(device.array(upright, np.float32), out, 0, scan.views)
    back = device.empty(upright.shape)
    read.spread(device.array(data, np.float32), back, 0, scan.views)
    wanted = list(matrices(scan, found, along_z, spline))
    for n, matrix in enumerate(wanted):
        assert matrix.any()
        np.testing.assert_allclose(out.get()[n].ravel(), matrix @ upright[n].ravel(), atol=3e-4)
        np.testing.assert_allclose(back.get()[n].ravel(), matrix.T @ data[n].ravel(), atol=3e-4)


def test_smooth_views_are_read_as_they_are(device):
    """A function of the ray alone reads the same on either detector, to the cubic's error."""
    scan = turned(circle(), 3)
    found = rectified(Grid((60, 60, 60)), scan, along_z=False)
    upright = found.upright
    rows = (np.arange(upright.rows) - upright.center[0]) * upright.pitch[0]
    columns = (np.arange(upright.bins) - upright.center[1]) * upright.pitch[1]
    smooth = np.exp(-(rows[:, None] ** 2 + columns**2) / (2 * 6.0**2))
    read = reading(device, scan, found)
    out = device.empty((scan.views, scan.rows, scan.bins))
    views = np.broadcast_to(smooth, (scan.views, *smooth.shape))
    read.read(device.array(views, np.float32), out, 0, scan.views)
    for n in range(scan.views):
        sine, cosine = np.sin(upright.angles[n]), np.cos(upright.angles[n])
        way = rays(scan, n)
        way = way * (upright.source_to_detector / (way @ [-sine, cosine, 0.0]))[:, None]
        u, v = way @ [cosine, sine, 0.0], way[:, 2]
        wanted = np.exp(-(u**2 + v**2) / (2 * 6.0**2))
        np.testing.assert_allclose(out.get()[n].ravel(), wanted, atol=2e-3)


@pytest.mark.parametrize(("spline", "kept"), [(True, 7 / 8), (False, 11 / 16)])
def test_a_wave_of_three_samples_keeps_most_of_its_height_between_them(device, spline, kept):
    rows, bins, count = 36, 44, 3
    steps = np.arange(bins) * 2 * np.pi / 3 + np.array([[[0.0]], [[0.4]], [[1.1]]])
    samples = np.broadcast_to(np.cos(steps), (count, rows, bins)).astype(np.float32)
    aside = np.tile(np.eye(3)[[1, 2, 0]].reshape(9), 2)
    aside[[0, 9]] = 0.5, -0.5
    forms, views = np.tile(aside, (count, 1)), np.arange(count, dtype=np.int32)
    read = Rectification(
        device, (rows, bins), (rows, bins), views, forms, np.dtype(np.float32), spline=spline
    )
    out = device.empty(samples.shape)
    read.read(device.array(samples), out, 0, count)
    inner = np.s_[:, 14:-14, 14:-14]
    wanted = np.broadcast_to(kept * np.cos(steps + np.pi / 3), samples.shape)
    np.testing.assert_allclose(out.get()[inner], wanted[inner], atol=2e-6)


def test_views_are_told_by_where_they_look():
    both = (
        np.concatenate(pair)
        for pair in zip(
            *((v.source, v.middle, v.across, v.down) for v in (circle(), lying())), strict=True
        )
    )
    assert looking_along_z(Vectors(*both, 26, 30)).tolist() == [False] * 5 + [True] * 3


def test_what_no_upright_detector_sees_is_refused():
    scan = circle(2)
    aside = Vectors(
        scan.source, np.add(scan.source, [[1.0, 300.0, 0.0]]), scan.across, scan.down, 26, 9000
    )
    with pytest.raises(InputError, match="view"):
        rectified(GRID, aside, along_z=False)
