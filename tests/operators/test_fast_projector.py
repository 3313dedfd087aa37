"""The fast projector keeps the error that its caller names, and obeys the laws of a matched pair.

The oracle is a matrix in float64 (`rift_cl.reference.band_limited`). On white noise what a kernel
leaves is known beforehand, so that the named error is met with room to spare; where data nearly
cancel (a few bins as wide as the image), errors are measured against what went in as well.
Adjointness has nothing to do with the error: it holds to rounding.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import rift_cl as rift
from rift_cl import Grid, Parallel, Projector, dot_test, phantom
from rift_cl.operators import Ramp, ViewFilter
from rift_cl.operators.projector.parallel.fast_projector import FastProjector
from rift_cl.phantom import shepp_logan, shepp_logan_sinogram
from rift_cl.reconstruct.direct.filtered_backprojection import FilteredBackprojection
from rift_cl.reference import radon
from rift_cl.reference.band_limited import band_limited

pytestmark = pytest.mark.dealt

ROUNDING = 1e-5
# Errors that between them take narrow kernels and wide ones.
ERRORS = (3e-2, 1e-3, 1e-5)


RANDOM = np.random.default_rng(2024)
HALF = np.linspace(0, np.pi, 19, endpoint=False) + 0.011
SCENES = {
    "wider than a tile": (Grid((40, 91)), Parallel(HALF, bins=110)),
    "full turn": (Grid((24, 31)), Parallel(2 * HALF, bins=41)),
    "irregular and unsorted": (Grid((31, 24)), Parallel(RANDOM.uniform(-9, 9, 23), bins=40)),
    "one angle": (Grid((30, 21)), Parallel([0.3], bins=37)),
    "along the axes": (Grid((21, 34)), Parallel(np.arange(-4, 5) * np.pi / 4, bins=44)),
    "single pixel": (Grid((1, 1)), Parallel(HALF, bins=5)),
    "single row": (Grid((1, 75)), Parallel(HALF, bins=80)),
    "single bin": (Grid((20, 30)), Parallel(HALF, bins=1)),
    "off-centre axis": (Grid((28, 29)), Parallel(HALF, bins=45, center=13.37)),
    "off-centre grid": (Grid((28, 29), center=(-7.2, 11.9)), Parallel(HALF, bins=61)),
    "partly outside": (Grid((40, 40)), Parallel(HALF, bins=20, center=2.5)),
    "misses": (Grid((20, 20), center=(400, 400)), Parallel([0.1, 0.7, 1.4], bins=32)),
    "anisotropic": (Grid((40, 23), spacing=(0.5, 1.7)), Parallel(HALF, bins=60, pitch=0.8)),
    "narrow bins": (Grid((12, 15)), Parallel(HALF, bins=350, pitch=0.05)),
    "wide bins": (Grid((50, 44)), Parallel(HALF, bins=7, pitch=13.0)),
    "stack": (Grid((3, 33, 20), spacing=(3, 1, 1)), Parallel(HALF, bins=40)),
}


@pytest.fixture(params=SCENES)
def scene(request):
    return SCENES[request.param]


def white(A, seed):
    random = np.random.default_rng(seed)
    x, y = random.standard_normal(A.domain), random.standard_normal(A.range)
    return x.astype(np.float32), y.astype(np.float32)


def twin_of(A):
    return _twin(A.grid, A.scan, A.period, A.samples)


@cache
def _twin(grid, scan, period, samples):
    return band_limited(grid, scan, period=period, samples=samples)


def relative(value, truth, floor=0.0):
    return np.linalg.norm(value - truth) / max(np.linalg.norm(truth) + floor, 1e-30)


def weight(grid, scan):
    """What a bin gets of a pixel at most."""
    dy, dx = grid.spacing[-2:]
    return dx * dy / max(scan.pitch, min(dx, dy))


@pytest.mark.full
@pytest.mark.parametrize("lobes", ["image", 0, 1, 3])
def test_the_named_error_is_met_on_any_geometry(device, scene, lobes):
    grid, scan = scene
    A = FastProjector(grid, scan, 1e-3, lobes=lobes, device=device)
    (x, y), exact = white(A, 1), twin_of(A)
    floor = weight(grid, scan)
    assert relative(A(x), exact.project(x), floor * np.linalg.norm(x)) <= 1e-3
    assert relative(A.T(y), exact.backproject(y), floor * np.linalg.norm(y)) <= 1e-3


@pytest.mark.full
@pytest.mark.parametrize("n", [24, 41])
@pytest.mark.parametrize("error", ERRORS)
def test_the_named_error_is_met_at_any_size(device, n, error):
    random = np.random.default_rng(n)
    grid = Grid((n, n + 7), spacing=(0.9, 1.1), center=(3, -5))
    scan = Parallel(random.uniform(-4, 9, 2 * n), bins=2 * n, pitch=0.7, center=n + 0.3)
    A = FastProjector(grid, scan, error, device=device)
    exact = twin_of(A)
    x, y = random.standard_normal(A.domain), random.standard_normal(A.range)
    assert relative(A(x), exact.project(x)) <= error
    assert relative(A.T(y), exact.backproject(y)) <= error


@pytest.mark.full
def test_a_smaller_error_is_a_smaller_error(device):
    grid, scan = Grid((40, 40)), Parallel(np.linspace(0, np.pi, 50), bins=60)
    y = np.random.default_rng(3).standard_normal((50, 60))
    found = []
    for error in ERRORS:
        A = FastProjector(grid, scan, error, device=device)
        found.append(relative(A.T(y), twin_of(A).backproject(y)))
    assert found[0] > 5 * found[1] > 25 * found[2]


@pytest.mark.parametrize("lobes", ["image", 0, 1, 3])
def test_the_pair_is_matched(device, scene, lobes):
    grid, scan = scene
    A = FastProjector(grid, scan, 1e-3, lobes=lobes, device=device)
    x, y = (abs(values) for values in white(A, 4))
    forward, back = np.vdot(A(x).astype(float), y), np.vdot(x, A.T(y).astype(float))
    scale = weight(grid, scan) * np.linalg.norm(x) * np.linalg.norm(y)
    assert abs(forward - back) <= ROUNDING * (abs(forward) + scale)
    if scan.bins > 3 and grid.shape != (1, 1):
        assert dot_test(A, seed=4) <= ROUNDING
        assert dot_test(A.T, seed=5) <= ROUNDING


def test_linear(device, scene):
    A = FastProjector(*scene, device=device)
    (x, u), (z, v) = white(A, 6), white(A, 7)
    floor = weight(*scene)
    expected = 2 * A(x) - 3 * A(z)
    assert relative(A(2 * x - 3 * z), expected, floor * np.linalg.norm(x)) <= ROUNDING
    expected = 2 * A.T(u) - 3 * A.T(v)
    assert relative(A.T(2 * u - 3 * v), expected, floor * np.linalg.norm(u)) <= ROUNDING
    assert not A(np.zeros_like(x)).any()
    assert not A.T(np.zeros_like(u)).any()


def test_a_stack_is_its_slices_to_the_bit(device):
    grid, scan = SCENES["stack"]
    A = FastProjector(grid, scan, device=device)
    one = FastProjector(grid.slice(), scan, device=device)
    x, y = white(A, 8)
    views, volume = A(x), A.T(y)
    for k in range(len(x)):
        assert np.array_equal(views[:, k], one(x[k]))
        assert np.array_equal(volume[k], one.T(y[:, k]))


def test_two_runs_give_the_same_bits(device):
    grid, scan = Grid((70, 60)), Parallel(np.linspace(0, 3, 90), bins=100)
    runs = [FastProjector(grid, scan, device=device) for _ in range(2)]
    x = np.random.default_rng(5).standard_normal(runs[0].domain)
    y = np.random.default_rng(6).standard_normal(runs[0].range)
    assert np.array_equal(runs[0](x), runs[1](x))
    assert np.array_equal(runs[0].T(y), runs[1].T(y))


def test_more_lobes_come_nearer_to_the_area_that_pixel_and_bin_share(device):
    """Until what is left is what the direct projector's phases are off by."""
    grid, scan = Grid((90, 90)), Parallel(np.linspace(0, np.pi, 140, endpoint=False), bins=129)
    views = ViewFilter(scan, Ramp(), device=device)(shepp_logan_sinogram(grid, scan))
    direct = Projector(grid, scan, "strip", device=device).T(views)
    exact = radon(grid, scan, "strip")
    errors = []
    for lobes in (0, 1, 3):
        A = FastProjector(grid, scan, lobes=lobes, device=device)
        errors.append(relative(A.T(views), exact.backproject(views)))
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[2] < relative(direct, exact.backproject(views))


def test_line_integrals_of_a_smooth_image_are_its_own(device):
    """Of a Gaussian they are known; straight lines add a pattern near 45 degrees."""
    n, sigma = 128, 9.0
    grid, scan = Grid((n, n)), Parallel(np.linspace(0, np.pi, 180, endpoint=False), bins=183)
    y, x = np.mgrid[:n, :n] - (n - 1) / 2
    blob = np.exp(-(x**2 + y**2) / (2 * sigma**2))
    # A bin and a pixel's shadow add their own variance, 1/12 each at every angle.
    wide = sigma**2 + 1 / 6
    profile = 2 * np.pi * sigma**2 * np.exp(-(scan.coordinates() ** 2) / (2 * wide))
    truth = np.broadcast_to(profile / np.sqrt(2 * np.pi * wide), (180, 183))
    assert relative(FastProjector(grid, scan, lobes=0, device=device)(blob), truth) < 3e-4
    assert relative(Projector(grid, scan, "linear", device=device)(blob), truth) > 3e-3


def test_reconstructions_are_as_good_as_the_direct_ones(device):
    n = 128
    grid, scan = Grid((n, n)), Parallel(np.linspace(0, np.pi, 192, endpoint=False), bins=183)
    sinogram, truth = shepp_logan_sinogram(grid, scan), shepp_logan(grid)
    fast, direct = (
        rift.metrics.psnr(FilteredBackprojection(kind(grid, scan, device=device))(sinogram), truth)
        for kind in (FastProjector, Projector)
    )
    assert fast > direct


@pytest.mark.parametrize(("views", "most"), [(180, 4e-3), (360, 1e-3)])
@pytest.mark.parametrize(
    ("size", "spacing", "center"), [(255, 0.8, 2.4), (256, 1, 0), (255, 1, -3.3), (128, 2, 1.7)]
)
def test_a_uniform_disc_comes_back_flat(device, views, most, size, spacing, center):
    """The law that ``Projector`` obeys, too (test_projector_footprints.py)."""
    grid, radius = Grid((size, size), spacing), 0.4 * size * spacing
    bins = int(1.42 * size * spacing) + 4
    axis = (bins - 1) / 2 + center
    angles = np.linspace(0, np.pi, views, endpoint=False)
    scan = Parallel(angles, bins + int(2 * abs(center)), center=axis)
    A = FastProjector(grid, scan, device=device)
    disc = phantom.render([phantom.Ellipsoid((0, 0, 0), (1, radius, radius), 0, 1)], grid)
    y, x = grid.coordinates(0)[:, None], grid.coordinates(1)
    inside = np.hypot(y, x) < radius - 6 * max(1, spacing)
    values = rift.fbp(A, A(disc))[inside].astype(float)
    assert abs(values.mean() - 1) < 1e-3
    assert values.std() < most


def test_a_detector_that_misses_sees_nothing(device):
    for far in (400, 1e7, 1e300):
        for grid, axis in ((Grid((8, 9), center=(far, far)), None), (Grid((8, 9)), -far)):
            A = FastProjector(grid, Parallel([0.1, 0.7, 1.4], 12, center=axis), device=device)
            assert not A(np.ones(A.domain)).any()
            assert not A.T(np.ones(A.range)).any()


@st.composite
def geometries(draw):
    length = st.floats(0.5, 5)
    shape = tuple(draw(st.lists(st.integers(1, 30), min_size=2, max_size=2)))
    spacing = draw(st.lists(length, min_size=2, max_size=2))
    center = draw(st.lists(st.floats(-50, 50), min_size=2, max_size=2))
    angles = draw(st.lists(st.floats(-20, 20), min_size=1, max_size=20))
    bins = draw(st.integers(1, 60))
    axis = draw(st.none() | st.floats(-80, 80))
    return Grid(shape, spacing, center), Parallel(angles, bins, draw(length), axis)


@pytest.mark.full
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(geometries())
def test_any_scan_is_matched_and_near_its_twin(device, drawn):
    grid, scan = drawn
    A = FastProjector(grid, scan, 1e-3, device=device)
    exact = band_limited(grid, scan, period=A.period, samples=A.samples)
    random = np.random.default_rng(9)
    x, y = random.standard_normal(A.domain), random.standard_normal(A.range)
    scale = weight(grid, scan)
    assert relative(A(x), exact.project(x), scale * np.linalg.norm(x)) <= 2e-3
    assert relative(A.T(y), exact.backproject(y), scale * np.linalg.norm(y)) <= 2e-3
    x, y = abs(x).astype(np.float32), abs(y).astype(np.float32)
    mismatch = np.vdot(A(x).astype(float), y) - np.vdot(x, A.T(y).astype(float))
    norms = (np.linalg.norm(A(x)) + scale * np.linalg.norm(x)) * np.linalg.norm(y)
    assert abs(mismatch) <= ROUNDING * norms
