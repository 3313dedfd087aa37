"""Ordered subsets: their formula, how few passes do, and a state like any solver's."""

from __future__ import annotations

import numpy as np
import pytest
from solver_cases import GRID, SCAN, Matrix, finished, problem

from rift_cl import FastProjector, Grid, Parallel, Projector, phantom
from rift_cl.errors import CheckpointError, InputError
from rift_cl.reconstruct import MeasuredRays, OrderedSubsets, Sirt, sirt
from rift_cl.reconstruct.solvers.view_subsets import restricted, view_subsets
from rift_cl.reconstruct.solvers.weighted_rays import WeightedRays

pytestmark = pytest.mark.once

RANDOM = np.random.default_rng(4)


def weights_of(A):
    weights = 10 ** RANDOM.uniform(-1, 1, A.range)
    weights[3] = 0
    return weights


@pytest.mark.parametrize("count", [1, 2, 5, 7, 18])
def test_subsets_divide_the_views_and_spread_over_directions(device, count):
    scan = Parallel(RANDOM.permutation(SCAN.angles) + np.pi * RANDOM.integers(-2, 3, 18), 33)
    A = Projector(GRID, scan, device=device)
    subsets = view_subsets(A, count)
    assert len(subsets) == count
    assert sorted(np.concatenate(subsets)) == list(range(18))
    rank = np.argsort(np.argsort(np.mod(scan.angles, np.pi)))
    for views in subsets:
        assert np.ptp(np.diff(np.sort(rank[views]))) == 0 if len(views) > 1 else True
    if count > 2:
        # No subset follows its neighbour in angle.
        firsts = [rank[views].min() for views in subsets]
        assert np.abs(np.diff(firsts)).max() > 1 and firsts[:2] == [
            0,
            2 ** (count - 1).bit_length() // 2,
        ]


@pytest.mark.parametrize("kind", ["projector", "fast", "weighted", "seen", "multiple", "volume"])
def test_an_operator_of_some_views_gives_these_views(device, kind):
    A = Projector(GRID, SCAN, device=device)
    A = {
        "projector": lambda: A,
        "fast": lambda: FastProjector(GRID, SCAN, device=device),
        "weighted": lambda: WeightedRays(A, weights_of(A)),
        "seen": lambda: MeasuredRays(A, RANDOM.random(A.range) > 0.4),
        "multiple": lambda: 3 * A,
        "volume": lambda: Projector(Grid((2, *GRID.shape)), SCAN, device=device),
    }[kind]()
    views = np.array([1, 3, 4, 11])
    part = restricted(A, views)
    x, y = RANDOM.random(A.domain), RANDOM.random((4, *A.range[1:]))
    close = {"rtol": 1e-4, "atol": 2e-3 if kind == "fast" else 1e-4}
    np.testing.assert_allclose(part(x), A(x)[views], **close)
    whole = np.zeros(A.range)
    whole[views] = y
    np.testing.assert_allclose(part.T(y), A.T(whole), **close)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("dense", [False, True])
def test_a_pass_is_its_formula(device, weighted, dense):
    A, matrix, _, y = problem(device, noise=0.3)
    matrix = matrix.toarray()
    if dense:
        A = Matrix(matrix, A.domain, A.range, device)
    weights = weights_of(A) if weighted else None
    rows = matrix.reshape(*A.range, -1)
    chosen = view_subsets(A, 4)
    parts = []
    for views in chosen:
        part = rows[views].reshape(-1, rows.shape[-1])
        lengths = part.sum(axis=1)
        inverse = np.where(lengths > 1e-3 * lengths.max(), 1 / np.maximum(lengths, 1e-9), 0)
        rays = weights[views].ravel() if weighted else inverse
        parts.append((part, rays, y[views].ravel(), part.T @ (rays * lengths)))
    columns = np.max([columns for *_, columns in parts], axis=0)
    x, passing = np.zeros(rows.shape[-1]), 0.0
    for _ in range(3):
        passing = 0.0
        for part, rays, data, _ in parts:
            residual = part @ x - data
            passing += np.sum((rays if weighted else 1) * residual**2)
            x = np.maximum(x - 0.8 / columns * (part.T @ (rays * residual)), 0)
    given = {"nonnegative": True, "relaxation": 0.8, "weights": weights}
    solver = OrderedSubsets(A, y, 4, **given)
    last = finished(solver, 3)[-1]
    np.testing.assert_allclose(device.get(solver.image).ravel(), x, atol=3e-4 * x.max())
    counted = y.size if weights is None else np.count_nonzero(weights)
    assert last.values["residual"] == pytest.approx(np.sqrt(passing / counted), rel=1e-3)
    found = sirt(A, y, 3, subsets=4, **given)
    assert np.array_equal(found, device.get(solver.image))


def test_ten_subsets_need_a_tenth_of_the_steps(device):
    grid, scan = Grid((64, 64)), Parallel(np.linspace(0, np.pi, 100, endpoint=False), 91)
    A = Projector(grid, scan, device=device)
    y = A(phantom.shepp_logan(grid)) + 0.05 * np.random.default_rng(1).standard_normal(A.range)
    goal = np.linalg.norm(A(sirt(A, y, 100, nonnegative=True)) - y)
    solver = OrderedSubsets(A, y, 10, nonnegative=True)
    passes = next(
        report.done
        for report in solver.run(30)
        if np.linalg.norm(A(device.get(solver.image)) - y) <= goal
    )
    print(f"10 subsets reach the residual of 100 steps of SIRT in {passes} passes")
    assert passes <= 15


@pytest.mark.parametrize("weighted", [False, True])
def test_a_resumed_run_gives_the_same_bits(device, weighted):
    A, _, _, y = problem(device, noise=0.1)
    weights = weights_of(A) if weighted else None
    whole, first = (OrderedSubsets(A, y, 5, weights=weights) for _ in range(2))
    finished(whole, 7), finished(first, 3)
    second = OrderedSubsets(A, y, 5, weights=weights, start=np.ones(A.domain))
    second.restore(first.state())
    assert [report.done for report in finished(second, 7)] == [4, 5, 6, 7]
    end, expected = second.state(), whole.state()
    assert end.keys() == expected.keys()
    for name, value in expected.items():
        assert np.array_equal(end[name], value), name
    with pytest.raises(CheckpointError, match="another A or another y"):
        OrderedSubsets(A, 2 * y, 5, weights=weights).restore(first.state())


def test_a_run_stops_at_the_noise_and_leaves_what_fits_alone(device):
    noise = 0.1
    A, _, truth, y = problem(device, noise=noise)
    solver = OrderedSubsets(A, y, 6, noise=noise)
    residuals = [report.values["residual"] for report in finished(solver, 300)]
    assert residuals[-1] <= noise < min(residuals[:-1])
    start = truth.astype(np.float32)
    left = OrderedSubsets(A, A(start), 6, start=start, noise=1e-3)
    assert finished(left, 5) == [] and np.array_equal(device.get(left.image), start)


def test_a_pixel_that_one_view_alone_sees_does_not_overshoot(device):
    """Its column's sum is that of its view alone; ten times one over it would diverge."""
    scan = Parallel(np.linspace(0, np.pi, 20, endpoint=False), 9)
    A = Projector(Grid((32, 32)), scan, device=device)
    y = A(np.ones(A.domain, np.float32))
    solver = OrderedSubsets(A, y, 10, relaxation=1.9)
    residuals = [report.values["residual"] for report in finished(solver, 40)]
    assert residuals[-1] < 0.05 * residuals[0]
    assert np.abs(device.get(solver.image)).max() < 4


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("kind", ["projector", "fast", "volume"])
def test_projectors_of_every_kind(device, kind, dtype):
    if dtype == "float64" and (kind == "fast" or not device.traits.fp64):
        pytest.skip("no float64 here")
    grid = Grid((2, *GRID.shape)) if kind == "volume" else GRID
    A = (
        FastProjector(grid, SCAN, device=device)
        if kind == "fast"
        else Projector(grid, SCAN, device=device, dtype=dtype)
    )
    truth = np.maximum(RANDOM.random(A.domain), 0.4)
    y = A(truth.astype(dtype))
    given = {"nonnegative": True, "weights": np.ones(A.range)}
    plain, solver = Sirt(A, y, **given), OrderedSubsets(A, y, 6, **given)
    slow = [report.values["residual"] for report in finished(plain, 30)]
    fast = [report.values["residual"] for report in finished(solver, 8)]
    assert fast[-1] < slow[-1]
    assert device.get(solver.image).dtype == dtype


@pytest.mark.parametrize("subsets", [0, -2, 19, 2.5, "many", None, np.nan])
def test_subsets_that_cannot_be_are_refused(device, subsets):
    A, _, _, y = problem(device)
    with pytest.raises(InputError, match="1 to the 18 views"):
        OrderedSubsets(A, y, subsets)


def test_what_does_not_go_with_subsets_is_refused(device):
    A, _, _, y = problem(device)
    with pytest.raises(InputError, match="one of them"):
        sirt(A, y, subsets=3, precondition="ramp")
    with pytest.raises(InputError, match="relaxation is 2"):
        sirt(A, y, subsets=3, relaxation=2)
    with pytest.raises(InputError, match="negative sum"):
        OrderedSubsets(Matrix(-np.ones((12, 20)), (4, 5), (12,), device), np.ones(12), 3)


@pytest.mark.full
def test_one_view_to_a_subset_is_astras_sart(device):
    astra = pytest.importorskip("astra")
    size, views = 24, 30
    angles = np.linspace(0, np.pi, views, endpoint=False)
    volume = astra.create_vol_geom(size, size)
    detector = astra.create_proj_geom("parallel", 1.0, 36, angles)
    projector = astra.create_projector("strip", detector, volume)
    matrix = astra.matrix.get(astra.projector.matrix(projector))
    truth = phantom.shepp_logan(Grid((size, size)))
    y = (matrix @ truth.ravel()).reshape(views, 36)
    data, image = astra.data2d.create("-sino", detector, y), astra.data2d.create("-vol", volume)
    A = Matrix(matrix.toarray(), (size, size), (views, 36), device)
    A.scan = Parallel(angles, 36)
    order = [int(one[0]) for one in view_subsets(A, views)]
    settings = astra.astra_dict("SART")
    settings.update(ProjectorId=projector, ProjectionDataId=data, ReconstructionDataId=image)
    settings["option"] = {"ProjectionOrder": "custom", "ProjectionOrderList": order}
    algorithm = astra.algorithm.create(settings)
    astra.algorithm.run(algorithm, 5 * views)
    theirs = astra.data2d.get(image)
    astra.clear()
    ours = sirt(A, y, 5, subsets=views)
    gaps = [np.linalg.norm(matrix @ x.ravel() - y.ravel()) for x in (ours, theirs)]
    print(f"residual after 5 passes: {gaps[0]:.4f}, ASTRA's SART {gaps[1]:.4f}")
    assert gaps[0] == pytest.approx(gaps[1], rel=1e-2)
    np.testing.assert_allclose(ours, theirs, atol=0.01 * theirs.max())
