"""Backprojection is quantitative, equal to its twin, and the operator that it says it is.

Levels are those of a slanted ellipse off the axis, so that no symmetry can hide a wrong weight.
Its exact line integrals are the data where the reconstruction is tested alone; the projector's own
where the pair is.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest

import rift_cl as rift
from rift_cl import Grid, Parallel, Projector, backproject, fbp, phantom
from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.operators import Ramp, ViewFilter
from rift_cl.reconstruct import FilteredBackprojection
from rift_cl.reconstruct.direct.filtered_backprojection import unfiltered_backprojection
from rift_cl.reconstruct.direct.view_weights import view_weights
from rift_cl.reference import filter_rows, radon, ramp_taps

pytestmark = pytest.mark.once

LEVEL = 1.7
RANDOM = np.random.default_rng(11)
HALF = np.linspace(0, np.pi, 96, endpoint=False)
SMALL = (Grid((20, 23)), Parallel(HALF[::8], bins=33))

SPACINGS = [0.1, 1.0, 7.3, (1.0, 2.0), (0.5, 0.2)]
ANGLES = {
    "half turn": HALF,
    "half turn from elsewhere": HALF - 5.1,
    "backwards": -HALF,
    "full turn": np.linspace(0, 2 * np.pi, 200, endpoint=False),
    "full turn, odd": np.linspace(0, 2 * np.pi, 135, endpoint=False),
    "one turn and a half": np.linspace(0, 3 * np.pi, 150, endpoint=False),
    "three quarters of a turn": np.linspace(0, 1.5 * np.pi, 150, endpoint=False),
    "with the end point": np.linspace(0, np.pi, 97),
    "full turn with the end point": np.linspace(0, 2 * np.pi, 193),
    "unsorted": RANDOM.permutation(HALF),
    "jittered": HALF + RANDOM.uniform(-0.45, 0.45, 96) * np.pi / 96,
    "at random": np.pi * RANDOM.uniform(0, 1, 400) ** 1.2,
    "coarse, but for a sixth": np.deg2rad(np.r_[0:30:0.5, 30:180:6]),
    "denser on one side": np.concatenate([HALF, np.linspace(0, 0.3, 300)]),
}


def ellipses(grid):
    """The ellipse, and one inside it that stays clear of its edge."""
    size = min(n * d for n, d in zip(grid.shape, grid.spacing, strict=True))
    middle = (0.0, grid.center[0] - 0.06 * size, grid.center[1] + 0.05 * size)
    return [
        phantom.Ellipsoid(middle, (size, share * 0.18 * size, share * 0.36 * size), 0.4, LEVEL)
        for share in (1.0, 0.6)
    ]


def levels(grid, scan, device, **settings):
    """Relative errors of the mean inside, from exact data and from the projector's."""
    whole, inner = ellipses(grid)
    inside = phantom.render([inner], grid) > 0.999 * LEVEL
    A = Projector(grid, scan, device=device)
    data = phantom.project([whole], grid, scan), A(phantom.render([whole], grid))
    return [float(fbp(A, y, **settings)[inside].mean() / LEVEL - 1) for y in data]


def covering(grid, angles, pitch):
    """A scan whose detector sees the whole grid."""
    across = np.hypot(*(n * d for n, d in zip(grid.shape, grid.spacing, strict=True)))
    return Parallel(angles, int(across / pitch) + 3, pitch)


@pytest.mark.parametrize("shape", [(64, 64), (63, 65)])
@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("spacing", SPACINGS)
def test_levels_are_right_at_any_spacing_and_pitch(device, shape, share, spacing):
    grid = Grid(shape, spacing)
    scan = covering(grid, HALF, share * min(grid.spacing))
    exact, own = levels(grid, scan, device)
    assert abs(exact) < 0.004
    assert abs(own) < 0.004


@pytest.mark.parametrize("angles", ANGLES.values(), ids=ANGLES)
def test_levels_are_right_for_any_angles_that_cover_a_half_turn(device, angles):
    grid = Grid((64, 64))
    exact, own = levels(grid, covering(grid, angles, 1.0), device)
    assert abs(exact) < 0.004
    assert abs(own) < 0.004


@pytest.mark.parametrize("angles", ANGLES.values(), ids=ANGLES)
def test_voronoi_levels_are_right(device, angles):
    grid = Grid((64, 64))
    exact, _ = levels(grid, covering(grid, angles, 1.0), device, compensate="voronoi")
    assert abs(exact) < 0.004


@pytest.mark.parametrize(
    ("grid", "scan"),
    [
        (Grid((64, 64), center=(20, -10)), Parallel(HALF, bins=160)),
        (Grid((64, 64)), Parallel(HALF, bins=120, center=40.3)),
        (Grid((64, 64)), Parallel(HALF, bins=64)),
        (Grid((20, 70), spacing=(3, 1)), Parallel(HALF, bins=95)),
    ],
)
def test_levels_are_right_off_the_axis(device, grid, scan):
    exact, own = levels(grid, scan, device)
    assert abs(exact) < 0.004
    assert abs(own) < 0.004


@pytest.mark.parametrize(
    "filter", ["shepp-logan", "cosine", "hamming", "hann", "high-pass", Ramp("hann", 0.6), np.abs]
)
def test_levels_are_right_with_any_ramp(device, filter):
    grid = Grid((64, 64))
    exact, own = levels(grid, covering(grid, HALF, 1.0), device, filter=filter)
    assert abs(exact) < 0.004
    assert abs(own) < 0.004


def psnr(image, truth, where):
    return -10 * np.log10(np.mean((image - truth)[where] ** 2))


@pytest.mark.full
def test_phases_cost_next_to_nothing(device):
    """Against the exact transform's transpose, from the head's exact line integrals."""
    grid, scan = Grid((128, 128)), Parallel(np.linspace(0, np.pi, 192, endpoint=False), bins=182)
    y = phantom.shepp_logan_sinogram(grid, scan)
    truth = phantom.shepp_logan(grid)
    filtered = filter_rows(y, ramp_taps(182, 1.0), 1.0)
    exact = radon(grid, scan).backproject(filtered) * np.pi / 192
    radius = np.hypot(*np.meshgrid(grid.coordinates(0), grid.coordinates(1)))
    ours = fbp(Projector(grid, scan, device=device), y)
    # 0.01 dB measured.
    assert abs(psnr(ours, truth, radius < 64) - psnr(exact, truth, radius < 64)) < 0.05
    assert psnr(ours, truth, radius < 64) > 25


def test_fbp_is_filter_weights_and_backprojection(device):
    grid, scan = Grid((20, 23), spacing=(0.5, 2)), Parallel(RANDOM.uniform(0, 9, 11), 33, 0.8)
    A = Projector(grid, scan, device=device)
    y = RANDOM.standard_normal(A.range)
    gains = view_weights(scan.angles, "voronoi") * 0.8 / (0.5 * 2)
    expected = A.T(ViewFilter(scan, Ramp("hann"), gains=gains, device=device)(y))
    assert np.array_equal(fbp(A, y, "hann", "voronoi"), expected)


def test_fbp_is_an_operator(device):
    grid, scan = SMALL
    A = Projector(Grid((3, *grid.shape)), scan, device=device)
    F = FilteredBackprojection(A, "cosine")
    assert (F.domain, F.range) == (A.range, A.domain)
    assert rift.dot_test(F, seed=3) <= 1e-6
    y = RANDOM.standard_normal(A.range)
    assert np.array_equal(F(y), fbp(A, y, "cosine"))


def test_backproject_is_the_scaled_adjoint(device):
    grid, scan = Grid((20, 23), spacing=(0.5, 2)), Parallel(HALF[::8], 33, 0.8)
    A = Projector(grid, scan, device=device)
    y = RANDOM.standard_normal(A.range)
    factor = np.pi / 12 * 0.8 / (0.5 * 2)
    np.testing.assert_allclose(backproject(A, y), factor * A.T(y), rtol=1e-6)
    even = Parallel(np.linspace(0, np.pi, 12, endpoint=False), 33, 0.8)
    A = Projector(grid, even, device=device)
    with pytest.warns(UserWarning, match="'ones_like' is .* times the ramp"):
        alike = fbp(A, y, np.ones_like)
    np.testing.assert_allclose(backproject(A, y), alike, atol=1e-5 * abs(y).max())


def test_a_copy_of_the_backprojection_makes_slabs_too(device):
    A = Projector(Grid((3, 8, 8)), Parallel([0.1, 1.2], 9), device=device)
    formula, y = unfiltered_backprojection(A), np.ones(A.range, np.float32)
    slabs = copy.copy(formula).slabs(y, device.budget)
    assert np.array_equal(np.concatenate(list(slabs)), formula(y))


def test_a_stack_is_its_slices_to_the_bit(device):
    grid, scan = SMALL
    A = Projector(Grid((5, *grid.shape)), scan, device=device)
    one = Projector(grid, scan, device=device)
    y = RANDOM.standard_normal(A.range)
    for method in (fbp, backproject):
        volume = method(A, y)
        for k in range(5):
            assert np.array_equal(volume[k], method(one, y[:, k]))


def test_results_stay_where_the_data_are(device):
    A = Projector(*SMALL, device=device)
    y = RANDOM.standard_normal(A.range).astype(np.float32)
    for method in (fbp, backproject):
        out = np.empty(A.domain, np.float32)
        assert method(A, y, out=out) is out
        there = method(A, device.array(y))
        assert np.array_equal(device.get(there), out)
        assert method(A, device.array(y), out=there) is there


@pytest.mark.parametrize("method", [fbp, backproject])
def test_data_that_cannot_be_used_are_refused(device, method):
    A = Projector(*SMALL, device=device)
    with pytest.raises(ShapeError, match=r"\(12, 32\).*\(12, 33\)"):
        method(A, np.zeros((12, 32)))
    spoilt = np.zeros(A.range)
    spoilt[4, 5] = np.nan
    with pytest.raises(NonFiniteError, match=r"\(4, 5\)"):
        method(A, spoilt)


def test_unknown_names_are_refused(device):
    A = Projector(*SMALL, device=device)
    with pytest.raises(InputError, match=r"filter is 'nope'"):
        fbp(A, np.zeros(A.range), "nope")
    with pytest.raises(InputError, match=r"compensate is 'nope'"):
        fbp(A, np.zeros(A.range), compensate="nope")
