"""The projector of cones against its twin and analytic line integrals, and its laws.

Tolerances. Against the twin only float32 rounding differs: places to 1e-6 of a bin on the scans
here, whose shares make it 4e-6 of white data. Two sides of a dot test of so few random numbers
differ by some 1e-8 of their norms.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rift_cl import Cone, Grid, Parallel, Projector, dot_test, open_device, phantom
from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.operators.projector.cone import slab_projector
from rift_cl.reference.cone import ConeProjector

pytestmark = pytest.mark.variants

ROUNDING = 6e-6
TURN = np.array([0, 0.3, np.pi / 4, np.pi / 4 + 1e-9, np.pi / 2, 2, 3 * np.pi / 4 - 1e-9, 4, 5.5])
STEPS = np.arange(9) - 3.0

SCANS: dict[str, tuple[Grid, Cone]] = {
    "all at once": (
        Grid((5, 9, 11), (1.3, 0.8, 1.1), (1, 2, -1)),
        Cone(TURN, 10, 11, (1.2, 1.7), 40, 60, center=(3.2, 6.1), heights=STEPS),
    ),
    "plain": (Grid((9, 10, 11)), Cone(TURN, 12, 13, 1.5, 40, 60)),
    "taller than a tile": (Grid((66, 2, 3)), Cone([0.1, 2], 70, 5, 1.4, 150, 200)),
    "wider than a tile": (Grid((2, 2, 66)), Cone([0.1, 3], 4, 70, 1.4, 150, 200)),
    "bins finer than shadows": (Grid((4, 5, 6)), Cone(TURN, 16, 18, 0.4, 30, 45)),
    "bins much finer": (Grid((3, 2, 2)), Cone(TURN[:5], 50, 20, (0.1, 0.4), 30, 45)),
    "bins much wider": (Grid((9, 9, 9)), Cone(TURN, 4, 5, 6, 40, 60)),
    "curved": (Grid((9, 10, 11)), Cone(TURN, 12, 13, 1.5, 20, 30, curved=True)),
    "source near the volume": (Grid((8, 8, 8)), Cone(TURN, 14, 14, 3, 9, 25)),
    "one voxel": (Grid((1, 1, 1)), Cone(TURN, 3, 3, 1, 40, 60)),
    "detector smaller": (Grid((20, 9, 9)), Cone(TURN, 4, 4, 1, 40, 60, (1, 7), STEPS)),
    "detector that misses": (Grid((4, 4, 4)), Cone(TURN, 6, 6, 1, 40, 60, center=(90, -70))),
}


def relative(value, truth):
    return np.linalg.norm(value - truth) / max(np.linalg.norm(truth), 1e-30)


@pytest.fixture(
    scope="module", params=[(n, f) for f in ("strip", "linear", "point") for n in SCANS], ids=str
)
def scan(request):
    """A grid, a scan, a footprint and the projector's twin."""
    name, footprint = request.param
    grid, scan = SCANS[name]
    return grid, scan, footprint, ConeProjector(grid, scan, footprint)


@pytest.mark.full
def test_the_pair_equals_its_twin_and_is_matched(device, scan):
    grid, scan, footprint, twin = scan
    A = Projector(grid, scan, footprint, device=device)
    random = np.random.default_rng(1)
    x, y = random.standard_normal(A.domain), random.standard_normal(A.range)
    assert relative(A(x), twin.project(x)) <= ROUNDING
    assert relative(A.T(y), twin.backproject(y)) <= ROUNDING
    x, y = abs(x), abs(y)
    forward, back = np.vdot(A(x).astype(float), y), np.vdot(x, A.T(y).astype(float))
    assert forward == pytest.approx(back, rel=1e-6)


def covering(n, views=9, *, far=3.0, magnification=1.5, **changes):
    """A cone that sees the ball in a volume of edge n; views at 45 degrees and beside them."""
    distance = far * n
    reach = magnification * distance
    pitch = 1.02 * 2 * reach * np.tan(np.arcsin(0.5 / far)) / n
    angles = TURN if views == len(TURN) else np.arange(views) * 2 * np.pi / views
    return changed(Cone(angles, n, n, pitch, distance, reach), **changes)


def changed(scan, **changes):
    names = [field.name for field in dataclasses.fields(scan)]
    return Cone(**{name: getattr(scan, name) for name in names} | changes)


@pytest.mark.full
def test_the_adjoint_is_exact_and_bits_repeat(device):
    A = Projector(Grid((37, 40, 45)), covering(44), device=device)
    random = np.random.default_rng(2)
    x = random.standard_normal(A.domain).astype(np.float32)
    y = random.standard_normal(A.range).astype(np.float32)
    seen, back = A(x), A.T(y)
    assert np.array_equal(A(x), seen)
    assert np.array_equal(A.T(y), back)
    for volume, data in ((x, y), (abs(x), abs(y)), (x, seen)):
        forward = np.vdot(A(volume).astype(float), data.astype(float))
        backward = np.vdot(volume.astype(float), A.T(data).astype(float))
        scale = np.linalg.norm(A(volume)) * np.linalg.norm(data)
        assert abs(forward - backward) <= 1e-8 * scale


@pytest.mark.full
@pytest.mark.parametrize("name", ["all at once", "curved", "bins much wider"])
def test_doubles(device, name):
    grid, scan = SCANS[name]
    A, twin = Projector(grid, scan, device=device, dtype="float64"), ConeProjector(grid, scan)
    x = np.random.default_rng(3).standard_normal(A.domain)
    assert relative(A(x), twin.project(x)) <= 1e-13
    assert dot_test(A) <= 1e-13


@pytest.mark.parametrize("magnification", [1.5, 1.2, 8])
def test_it_measures_line_integrals(device, magnification):
    """Of smooth ellipsoids; of a ball, the chord through its middle as well."""
    n = 48
    scan = covering(n, magnification=magnification)
    grid = Grid((n, n, n))
    ball = [phantom.Ellipsoid.ball(18)]
    seen = Projector(grid, scan, device=device)(phantom.render(ball, grid))
    truth = phantom.project(ball, grid, scan)
    assert relative(seen, truth) < 0.04
    assert seen.sum() == pytest.approx(truth.sum(), rel=2e-3)
    middle = seen[:, n // 2 - 1 : n // 2 + 1, n // 2 - 1 : n // 2 + 1]
    np.testing.assert_allclose(middle, 36, rtol=6e-3)
    assert middle.mean() == pytest.approx(36, rel=3e-3)


def test_turning_volume_and_scan_by_a_right_angle_changes_nothing(device):
    grid = Grid((9, 14, 14))
    scan = covering(14)
    turned = changed(scan, angles=scan.angles + np.pi / 2)
    x = np.random.default_rng(4).standard_normal(grid.shape)
    # A quarter turn takes x to y: sample (y, x) goes to (x, -y).
    quarter = x[:, :, ::-1].transpose(0, 2, 1)[:, ::-1, ::-1]
    A, B = (Projector(grid, each, device=device) for each in (scan, turned))
    assert relative(B(quarter), A(x)) <= ROUNDING


def test_lengths_of_another_unit_scale_the_integrals(device):
    grid, scan = Grid((9, 10, 11)), covering(11)
    larger = Cone(scan.angles, 11, 11, 7 * scan.pitch[0], 7 * 33, 7 * scan.source_to_detector)
    x = np.random.default_rng(5).standard_normal(grid.shape)
    seen = Projector(grid, scan, device=device)(x)
    scaled = Projector(Grid(grid.shape, 7), larger, device=device)(x)
    assert relative(scaled, 7 * seen) <= ROUNDING


def test_a_mirror_along_z_mirrors_the_rows(device):
    A = Projector(Grid((9, 10, 11)), covering(11), device=device)
    x = np.random.default_rng(6).standard_normal(A.domain)
    assert relative(A(x[::-1]), A(x)[:, ::-1]) <= ROUNDING


def test_a_detector_moved_by_whole_bins_moves_the_data(device):
    grid, scan = Grid((9, 10, 11)), covering(11)
    moved = changed(scan, center=(scan.center[0] + 2, scan.center[1] - 3))
    x = np.random.default_rng(7).standard_normal(grid.shape)
    A, B = (Projector(grid, each, device=device) for each in (scan, moved))
    assert relative(B(x)[:, 2:, :-3], A(x)[:, :-2, 3:]) <= ROUNDING


def test_raising_source_and_volume_together_changes_nothing(device):
    scan = covering(11)
    raised = changed(scan, heights=np.full(scan.views, 4.0))
    A = Projector(Grid((9, 10, 11)), scan, device=device)
    B = Projector(Grid((9, 10, 11), center=(4, 0, 0)), raised, device=device)
    x = np.random.default_rng(8).standard_normal(A.domain)
    assert relative(B(x), A(x)) <= ROUNDING


@pytest.mark.full
def test_a_source_far_away_sees_parallel_rays(device):
    """On a volume that is the same in every slice, so that the stretch changes nothing."""
    n, views = 32, 12
    angles = np.arange(views) * np.pi / views + 0.1
    y, x = np.mgrid[:n, :n] - (n - 1) / 2
    blob = np.exp(-((x - 3) ** 2 + (y + 2) ** 2) / (2 * 5.0**2))
    cone = Cone(angles, 5, n, 1, 1e6, 1e6)
    volume = np.broadcast_to(blob, (13, n, n))
    seen = Projector(Grid(volume.shape), cone, device=device)(volume)[:, 2]
    straight = Projector(Grid((n, n)), Parallel(angles, n), device=device)(blob)
    assert relative(seen, straight) < 5e-3


@pytest.mark.parametrize(
    ("grid", "scan", "about"),
    [
        (Grid((8, 8, 8)), Cone(TURN, 8, 8, 1, 5, 60), "source_to_axis"),
        (Grid((8, 30, 8)), Cone(TURN, 8, 8, 1, 14, 60), "source_to_axis"),
        (Grid((8, 8, 8)), Cone(TURN, 8, 800, 1, 50, 60), "fan"),
        (Grid((8, 8, 8)), Cone(TURN, 8, 8, 1e-3, 50, 60), "pitch"),
        (Grid((8, 8, 8)), Cone(TURN, 1, 1, 1e5, 50, 60), "pitch"),
        (Grid((8, 8)), Cone(TURN, 8, 8, 1, 50, 60), "volume"),
    ],
    ids=["inside", "beside", "wide fan", "fine bins", "wide bins", "image"],
)
def test_what_cannot_be_projected_is_refused(device, grid, scan, about):
    with pytest.raises(InputError, match=about):
        Projector(grid, scan, device=device)


@pytest.mark.full
def test_runs_of_any_length_give_the_same_bits(device, monkeypatch):
    A = Projector(Grid((9, 10, 11)), covering(11), device=device)
    random = np.random.default_rng(10)
    x, y = random.standard_normal(A.domain), random.standard_normal(A.range)
    whole = A(x), A.T(y)
    monkeypatch.setattr(slab_projector, "_TABLE_BYTES", {"cpu": 1, "gpu": 1})
    monkeypatch.setattr(slab_projector, "_FEWEST_VIEWS", 3)
    assert np.array_equal(A(x), whole[0])
    assert np.array_equal(A.T(y), whole[1])


def test_memory_is_counted_before_it_is_taken():
    device = open_device(memory=10_000)
    A = Projector(Grid((9, 10, 11)), covering(11), device=device)
    with pytest.raises(ResourceLimitError, match=r"part of a volume"):
        A(np.zeros(A.domain))


def test_an_unknown_footprint_is_refused(device):
    with pytest.raises(InputError, match="joseph"):
        Projector(Grid((8, 8, 8)), covering(8), "joseph", device=device)
