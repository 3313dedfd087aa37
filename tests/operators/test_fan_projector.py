"""The projector of a fan against its matrix, and the laws of a matched pair.

Against the matrix only float32 rounding differs: places of rays are off by 1e-7 of the grid's
width, which white images show with their full contrast, most where bins are a part of a pixel.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from rift_cl import Fan, Grid, Parallel, Projector, dot_test
from rift_cl.errors import InputError, RiftError
from rift_cl.operators.projector.fan.fan_projector import FanProjector
from rift_cl.operators.projector.footprint import FOOTPRINTS
from rift_cl.reference import fan

ROUNDING = 6e-6
TURN = np.linspace(0, 2 * np.pi, 19, endpoint=False) + 0.011
TIES = np.arange(8) * np.pi / 4

GEOMETRIES = {
    "odd": (Grid((33, 31)), Fan(TURN, 49, 1.4, 99.0, 150.0)),
    "off centre": (
        Grid((28, 19), spacing=(1.0, 1.3), center=(2.0, -3.0)),
        Fan(TURN, 61, 1.1, 60.0, 100.0, center=27.3),
    ),
    "curved, walk changes": (Grid((33, 20)), Fan(TIES, 60, 1.1, 60.0, 100.0, curved=True)),
    "a hair beside": (Grid((21, 34)), Fan(TIES + 1e-9, 60, 1.1, 60.0, 100.0)),
    "source near": (Grid((17, 20)), Fan(TURN, 28, 1.5, 15.0, 30.0)),
    "bins of a fifth": (Grid((17, 20)), Fan(TURN, 150, 0.2, 40.0, 60.0)),
    "wide bins": (Grid((33, 20)), Fan(TURN, 9, 11.0, 40.0, 100.0)),
    "bins beside the grid reach in": (
        Grid((20, 30)),
        Fan(TURN, 5, 60.0, 60.0, 100.0, center=1.3),
    ),
    "wide bins of an arc about a near source": (
        Grid((24, 20)),
        Fan(TURN, 7, 18.0, 19.0, 45.0, center=2.2, curved=True),
    ),
    "wide bins reach where narrow ones do not": (
        Grid((7, 3), spacing=(1.0, 1.3), center=(1.3, -1.0)),
        Fan([3.334, 5.2], 29, 168.0, 22.4, 46.6, center=0.49),
    ),
    "rays steep to slabs": (
        Grid((11, 26), center=(1.5, 0.4)),
        Fan(TIES + 0.01, 27, 3.45, 20.3, 54.1, center=21.5, curved=True),
    ),
    "partly outside": (Grid((30, 30)), Fan(TURN, 20, 1.0, 60.0, 100.0, center=2.5)),
    "single pixel": (Grid((1, 1)), Fan(TURN, 5, 1.0, 40.0, 60.0)),
    "single row": (Grid((1, 40)), Fan(TURN, 30, 3.0, 60.0, 100.0)),
    "single bin": (Grid((20, 30)), Fan(TURN, 1, 1.0, 60.0, 100.0)),
    "fine spacing": (Grid((25, 30), spacing=0.01), Fan(TURN, 44, 0.015, 0.9, 1.3)),
}


@pytest.fixture(params=list(GEOMETRIES))
def geometry(request):
    return GEOMETRIES[request.param]


def relative(value, truth):
    return np.linalg.norm(value - truth) / max(np.linalg.norm(truth), 1e-30)


def white(A, seed):
    random = np.random.default_rng(seed)
    shapes = A.domain, A.range
    return tuple(random.standard_normal(shape).astype(np.float32) for shape in shapes)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_both_halves_equal_the_matrix(device, geometry, footprint):
    A, matrix = Projector(*geometry, footprint, device=device), fan(*geometry, footprint)
    x, y = white(A, 1)
    assert isinstance(A, FanProjector)
    assert relative(A(x), matrix.project(x)) <= ROUNDING
    assert relative(A.T(y), matrix.backproject(y)) <= ROUNDING


@pytest.mark.parametrize("bins", [1, 2])
def test_strips_wider_than_the_image_equal_the_matrix(device, bins):
    geometry = Grid((20, 30)), Fan(TURN, bins, 100.0, 60.0, 100.0)
    A, matrix = Projector(*geometry, device=device), fan(*geometry)
    x, y = white(A, 1)
    assert relative(A(x), matrix.project(x)) <= ROUNDING
    assert relative(A.T(y), matrix.backproject(y)) <= ROUNDING


@pytest.mark.full
@pytest.mark.parametrize("curved", [False, True])
def test_weights_of_the_inverse_square_equal_the_matrix(device, curved):
    grid, scan = Grid((33, 31)), Fan(TURN, 49, 1.4, 60.0, 90.0, curved=curved)
    A, matrix = FanProjector(grid, scan, device=device, depth_power=2), fan(grid, scan, "strip", 2)
    x, y = white(A, 2)
    assert relative(A(x), matrix.project(x)) <= ROUNDING
    assert relative(A.T(y), matrix.backproject(y)) <= ROUNDING


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_the_pair_is_matched(device, footprint):
    scan = Fan(np.concatenate([TURN, TIES, TIES + 1e-9]), 130, 1.5, 300.0, 450.0)
    A = Projector(Grid((96, 91)), scan, footprint, device=device)
    assert dot_test(A, seed=3) <= 1e-8
    assert dot_test(A.T, seed=4) <= 1e-8


@pytest.mark.parametrize("footprint", ["strip", "linear"])
def test_the_pair_is_matched_where_bins_are_wider_than_the_margin(device, footprint):
    """Of bins of 30 lines there are so few that float32's rounding hardly averages out."""
    scan = Fan(np.concatenate([TURN, TIES, TIES + 1e-9]), 7, 45.0, 300.0, 450.0)
    assert dot_test(Projector(Grid((96, 91)), scan, footprint, device=device)) <= 1e-7
    try:
        A = Projector(Grid((96, 91)), scan, footprint, device=device, dtype=np.float64)
    except RiftError:
        return
    assert dot_test(A) <= 1e-8


@pytest.mark.parametrize("name", ["single bin", "source near", "wide bins"])
def test_pixels_beside_a_strip_get_nothing_of_it(device, name):
    grid, scan = GEOMETRIES[name]
    A, matrix = Projector(grid, scan, device=device), fan(grid, scan)
    for view in range(0, scan.views, 4):
        y = np.zeros(A.range, np.float32)
        y[view, scan.bins // 2] = 1
        assert not A.T(y)[matrix.backproject(y) == 0].any()


def test_repeats_to_the_bit(device):
    A = Projector(*GEOMETRIES["odd"], device=device)
    x, y = white(A, 5)
    again = Projector(*GEOMETRIES["odd"], device=device)
    assert np.array_equal(A(x), again(x))
    assert np.array_equal(A.T(y), again.T(y))


def test_travels_as_its_arguments(device):
    A = FanProjector(*GEOMETRIES["odd"], "linear", device=device, depth_power=2)
    again = pickle.loads(pickle.dumps(A))
    assert (again.grid, again.scan, again.footprint) == (A.grid, A.scan, A.footprint)
    assert again.depth_power == 2


def test_a_quarter_turn_of_image_and_source_changes_nothing(device):
    scan = Fan(TURN, 60, 1.5, 90.0, 140.0, center=28.1)
    turned = Fan(TURN + np.pi / 2, 60, 1.5, 90.0, 140.0, center=28.1)
    grid = Grid((32, 32))
    x = np.random.default_rng(6).standard_normal(grid.shape).astype(np.float32)
    # From x to y is the sense of the angles; rows grow with y.
    moved = np.ascontiguousarray(np.rot90(x, -1))
    y = Projector(grid, scan, device=device)(x)
    assert relative(Projector(grid, turned, device=device)(moved), y) <= ROUNDING


def test_lengths_scale_values(device):
    grid, scan = GEOMETRIES["off centre"]
    larger = Grid(grid.shape, np.multiply(3, grid.spacing), np.multiply(3, grid.center))
    y = Projector(grid, scan, device=device)(np.eye(*grid.shape))
    seen = Projector(larger, Fan(TURN, 61, 3.3, 180.0, 300.0, center=27.3), device=device)
    assert relative(seen(np.eye(*grid.shape)), 3 * y) <= ROUNDING


def test_far_sources_are_parallel_beams(device):
    grid, far = Grid((30, 41)), 1e7
    scan = Fan(TURN, 60, 1.0, far, far)
    x = np.random.default_rng(7).standard_normal(grid.shape).astype(np.float32)
    beams = Projector(grid, Parallel(TURN, 60), device=device)(x)
    # Phase tables blend 8 phases to a column, which white noise sees.
    assert relative(Projector(grid, scan, device=device)(x), beams) <= 2.5e-2
    smooth = np.hanning(30)[:, None] * np.hanning(41)
    beams = Projector(grid, Parallel(TURN, 60), device=device)(smooth)
    assert relative(Projector(grid, scan, device=device)(smooth), beams) <= 1e-3


def test_moving_the_detector_by_bins_moves_the_data(device):
    grid = Grid((25, 25))
    x = np.random.default_rng(8).standard_normal(grid.shape).astype(np.float32)
    y = Projector(grid, Fan(TURN, 70, 1.2, 60.0, 90.0, center=30.2), device=device)(x)
    moved = Projector(grid, Fan(TURN, 70, 1.2, 60.0, 90.0, center=33.2), device=device)(x)
    assert relative(moved[:, 3:], y[:, :-3]) <= ROUNDING


def test_bins_that_see_nothing_change_nothing(device):
    """A fan of 160 degrees, of which the outer rays run beside the slabs and never cross them."""
    grid = Grid((17, 20))
    wide = Projector(grid, Fan(TURN, 240, 1.5, 15.0, 30.0), device=device)
    A = Projector(grid, Fan(TURN, 28, 1.5, 15.0, 30.0), device=device)
    x, y = white(A, 12)
    assert relative(wide(x)[:, 106:134], A(x)) <= ROUNDING
    assert relative(wide.T(np.pad(y, ((0, 0), (106, 106)))), A.T(y)) <= ROUNDING
    assert not wide(x)[:, [0, -1]].any()


@pytest.mark.parametrize("pitch", [1.3, 0.3])
@pytest.mark.parametrize("curved", [False, True])
def test_a_uniform_square_has_the_lengths_of_its_rays(device, pitch, curved):
    """Within a row of pixels a bin's mean is its central ray's, so that lengths are exact."""
    scan = Fan([0.0, 0.35], int(60 / pitch), pitch, 80.0, 120.0, curved=curved)
    y = Projector(Grid((24, 200)), scan, device=device)(np.ones((24, 200)))
    gamma = scan.fan_angles()
    exact = 24 / np.cos(scan.angles[:, None] - gamma)
    # Edges are placed to 1e-7 of the grid's width, which is 1e-4 of the narrower bins.
    np.testing.assert_allclose(y, exact, rtol=1e-4)


def test_every_view_holds_the_whole_mass(device):
    """Strips and hats that tile the line differ by how they end, not by what they hold."""
    scan = Fan(TURN, 120, 0.9, 70.0, 100.0)
    grid = Grid((20, 20))
    A = Projector(grid, scan, device=device)
    x = np.random.default_rng(9).random(grid.shape).astype(np.float32)
    one = Projector(grid, scan, "linear", device=device)
    sums = A(x).sum(axis=1), one(x).sum(axis=1)
    np.testing.assert_allclose(sums[0], sums[1], rtol=4e-3)


def test_the_peer_s_strips_give_the_same_data(device):
    astra = pytest.importorskip("astra")
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False) + 0.1
    scan, grid = Fan(angles, 64, 1.5, 120.0, 180.0), Grid((48, 48))
    x = np.random.default_rng(10).random(grid.shape).astype(np.float32)
    # Its y axis points up, ours along the rows.
    volume = astra.create_vol_geom(48, 48)
    views = astra.create_proj_geom("fanflat", 1.5, 64, angles, 120.0, 60.0)
    projector = astra.create_projector("strip_fanflat", views, volume)
    number, y = astra.create_sino(np.ascontiguousarray(x[::-1]), projector)
    astra.data2d.delete(number)
    astra.projector.delete(projector)
    assert relative(Projector(grid, scan, device=device)(x), y) <= 3e-3


def test_what_is_wrong_is_said():
    grid = Grid((64, 64))
    with pytest.raises(InputError, match="source_to_axis"):
        Projector(grid, Fan([0.0, 0.8], 90, 1.0, 20.0, 90.0))
    with pytest.raises(InputError, match="source_to_axis"):
        Projector(grid, Fan([0.0, 0.785], 90, 1.0, 40.0, 90.0))
    with pytest.raises(InputError, match="depth_power"):
        FanProjector(grid, Fan([0.0], 90, 1.0, 120.0, 180.0), depth_power=3)
    with pytest.raises(InputError, match="footprint"):
        Projector(grid, Fan([0.0], 90, 1.0, 120.0, 180.0), "gauss")


@pytest.mark.parametrize("scale", [1e-9, 1e9, 1e30])
def test_extreme_lengths_are_refused_or_finite(device, scale):
    grid = Grid((12, 11))
    for pitch, to_detector, center, curved in (
        (scale, 60.0, None, False),
        (1.0, 40.0 * max(scale, 1), None, False),
        (1.0, 60.0, scale, False),
        (1.0, 60.0, -scale, True),
    ):
        try:
            scan = Fan([0.3, 2.0], 12, pitch, 40.0, to_detector, center, curved)
            A = Projector(grid, scan, device=device)
        except RiftError:
            continue
        assert np.isfinite(A(np.ones(A.domain))).all()
        assert np.isfinite(A.T(np.ones(A.range))).all()


def test_double_precision_is_that_of_the_matrix(device):
    grid, scan = GEOMETRIES["off centre"]
    try:
        A = Projector(grid, scan, device=device, dtype=np.float64)
    except RiftError:
        pytest.skip("no float64")
    x, y = white(A, 11)
    matrix = fan(grid, scan)
    assert relative(A(x), matrix.project(x)) <= 1e-12
    assert relative(A.T(y), matrix.backproject(y)) <= 1e-12
