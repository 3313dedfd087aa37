"""The projector against its twin and the exact transform, and the laws of a matched pair.

Tolerances. Against the twin only float32 rounding differs: sums of some hundred terms of random
sign, about 1e-7 measured, up to 2.5e-7. Against the exact transform the phases differ by
sqrt(step^3 / (10 phases^3)) on white noise (see tests/reference/test_phase_table_twin.py), which is
at most 1.4e-2 for 8 phases in the mean, and half as much again on scans as small as these. A
strip's shadow has edges, which 8 phases blunt by an eighth of a pixel, where bins are narrow.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rift_cl import Grid, Parallel, Projector, dot_test
from rift_cl.errors import InputError
from rift_cl.operators.projector.footprint import FOOTPRINTS
from rift_cl.reference import phase_table, radon

ROUNDING = 1e-6
PHASES_ON_NOISE = 2.1e-2
EDGES_ON_NOISE = 6e-2


def relative(value, truth):
    return np.linalg.norm(value - truth) / max(np.linalg.norm(truth), 1e-30)


def test_projection_equals_its_twin(device, geometry):
    x, _ = geometry.white(1)
    y = geometry.projector(device)(x)
    assert relative(y, geometry.twin.project(x)) <= ROUNDING


def test_backprojection_equals_its_twin(device, geometry):
    _, y = geometry.white(2)
    x = geometry.projector(device).T(y)
    assert relative(x, geometry.twin.backproject(y)) <= ROUNDING


def test_projection_is_near_the_exact_transform(device, geometry):
    x, y = geometry.white(3)
    A = geometry.projector(device)
    narrow = geometry.scan.pitch < max(geometry.grid.spacing[-2:]) / 2
    most = EDGES_ON_NOISE if geometry.footprint == "strip" and narrow else PHASES_ON_NOISE
    assert relative(A(x), geometry.exact.project(x)) <= most
    assert relative(A.T(y), geometry.exact.backproject(y)) <= most


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_smooth_images_hardly_see_the_phases(device, footprint):
    grid, scan = Grid((64, 64)), Parallel(np.linspace(0, np.pi, 30, endpoint=False), bins=94)
    y, x = np.mgrid[:64, :64] - 31.5
    blob = np.exp(-(x**2 + y**2) / (2 * 9.0**2))
    A = Projector(grid, scan, footprint, device=device)
    assert relative(A(blob), radon(grid, scan, footprint).project(blob)) < 2e-3


def test_the_pair_is_matched(device, geometry):
    A = geometry.projector(device)
    x, y = (abs(values) for values in geometry.white(4))
    forward, back = np.vdot(A(x).astype(float), y), np.vdot(x, A.T(y).astype(float))
    assert forward == pytest.approx(back, rel=1e-6)
    # White data of a view that is little more than one number cancel to nothing but rounding.
    if geometry.scan.bins > 3 and geometry.grid.shape != (1, 1):
        assert dot_test(A, seed=4) <= 1e-6
        assert dot_test(A.T, seed=5) <= 1e-6


def test_linear(device, geometry):
    A = geometry.projector(device)
    (x, u), (z, v) = geometry.white(6), geometry.white(7)
    assert relative(A(2 * x - 3 * z), 2 * A(x) - 3 * A(z)) <= ROUNDING
    assert relative(A.T(2 * u - 3 * v), 2 * A.T(u) - 3 * A.T(v)) <= ROUNDING
    assert not A(np.zeros_like(x)).any()
    assert not A.T(np.zeros_like(u)).any()


def test_a_stack_is_its_slices_to_the_bit(device, stack):
    x, y = stack.white(8)
    A = Projector(stack.grid, stack.scan, device=device)
    one = Projector(stack.grid.slice(), stack.scan, device=device)
    views, volume = A(x), A.T(y)
    for k in range(len(x)):
        assert np.array_equal(views[:, k], one(x[k]))
        assert np.array_equal(volume[k], one.T(y[:, k]))


def test_a_detector_that_misses_sees_nothing(device):
    A = Projector(Grid((20, 20), center=(400, 400)), Parallel([0.1, 0.7], bins=32), device=device)
    assert not A(np.ones(A.domain)).any()
    assert not A.T(np.ones(A.range)).any()


@pytest.mark.parametrize("far", [1e7, 1e10, 1e300])
def test_a_detector_that_misses_by_far_sees_nothing(device, far):
    for grid, axis in ((Grid((8, 9), center=(far, far)), None), (Grid((8, 9)), -far)):
        A = Projector(grid, Parallel([0.1, 0.7, 1.4], 12, center=axis), device=device)
        with suppress(InputError):
            assert not A(np.ones(A.domain)).any()
            assert not A.T(np.ones(A.range)).any()


@pytest.mark.parametrize("pitch", [1e4, 1e7, 1e10])
def test_an_object_far_smaller_than_a_bin_is_a_point(device, pitch):
    """All of its mass falls into the bin that it stands in."""
    A = Projector(Grid((8, 9)), Parallel([0.1, 2.0], 3, pitch), device=device)
    with suppress(InputError):
        np.testing.assert_allclose(A(np.ones(A.domain))[:, 1], 72 / pitch, rtol=1e-2)
        np.testing.assert_allclose(A.T(np.ones(A.range)), 2 / pitch, rtol=1e-2)


@pytest.mark.parametrize("pitch", [1e-4, 1e-10])
def test_a_pixel_far_larger_than_a_bin_is_even(device, pitch):
    """A detector under it sees the peak of its hat, which 8 phases blunt by up to 1 / 16."""
    A = Projector(Grid((9, 9)), Parallel([0.1, 2.0], 31, pitch), device=device)
    pixel = np.zeros(A.domain)
    pixel[4, 4] = 1
    with suppress(InputError):
        peak = 1 / np.array([[np.cos(0.1)], [np.sin(2.0)]])
        np.testing.assert_allclose(A(pixel), np.broadcast_to(peak, A.range), rtol=0.07)


@st.composite
def geometries(draw):
    length = st.floats(0.05, 20)
    shape = draw(st.lists(st.integers(1, 40), min_size=2, max_size=3))
    shape = (min(shape[0], 4), *shape[1:]) if len(shape) == 3 else tuple(shape)
    spacing = draw(st.lists(length, min_size=len(shape), max_size=len(shape)))
    center = draw(st.lists(st.floats(-50, 50), min_size=len(shape), max_size=len(shape)))
    angles = draw(st.lists(st.floats(-20, 20), min_size=1, max_size=20))
    bins = draw(st.integers(1, 70))
    axis = draw(st.none() | st.floats(-80, 80))
    scan = Parallel(angles, bins, draw(length), axis)
    return Grid(shape, spacing, center), scan, draw(st.sampled_from(FOOTPRINTS))


@pytest.mark.full
@settings(
    max_examples=150, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck)
)
@given(geometries())
def test_any_scan_is_matched_and_equals_its_twin(device, scene):
    grid, scan, footprint = scene
    A, twin = Projector(grid, scan, footprint, device=device), phase_table(grid, scan, footprint)
    random = np.random.default_rng(9)
    x, y = abs(random.standard_normal(A.domain)), abs(random.standard_normal(A.range))
    # A detector may see no more than the last of a hat's slope, where rounding is all there is:
    # so errors are measured against a pixel's weight, too.
    dy, dx = grid.spacing[-2:]
    weight = dx * dy / max(scan.pitch if footprint != "joseph" else 0, min(dx, dy))
    # A place within a bin has the rounding of a bin, which is more to a footprint that is narrower,
    # and a place within a shadow of many bins that of the shadow, which is more to a strip's edge.
    finer, wider = scan.pitch / min(dx, dy), max(dx, dy) / scan.pitch / 8
    rounding = ROUNDING * (1 if footprint == "linear" else max(1, finer, wider))
    pairs = ((A(x), twin.project(x), x), (A.T(y), twin.backproject(y), y))
    for value, truth, given_to in pairs:
        scale = np.linalg.norm(truth) + weight * np.linalg.norm(given_to)
        assert np.linalg.norm(value - truth) <= rounding * scale
    scale = (np.linalg.norm(pairs[0][1]) + weight * np.linalg.norm(x)) * np.linalg.norm(y)
    mismatch = np.vdot(A(x).astype(float), y) - np.vdot(x, A.T(y).astype(float))
    assert abs(mismatch) <= 1e-6 * scale
