"""Bounds, supports, directional variation and the pull to levels: laws, twins, and gains."""

from __future__ import annotations

import numpy as np
import pytest
from solver_cases import GRID, SCAN, Matrix, finished, problem

from rift_cl import FastProjector, Grid, Parallel, Projector
from rift_cl.cl.array_home import ArrayHome
from rift_cl.cl.elementwise import clip_between, pull_to_levels
from rift_cl.errors import InputError, RiftError, ShapeError
from rift_cl.io import open_scan, read_image
from rift_cl.reconstruct import (
    DirectionWeights,
    FewLevels,
    Fista,
    Pdhg,
    find_disc,
    material_lengths,
    rebin_fan,
)
from rift_cl.reconstruct.direct.fan_rebin import covered_rays
from rift_cl.reconstruct.solvers.tv_functional import TotalVariation
from rift_cl.reference import total_variation as twin
from rift_cl.reference.level_pull import level_penalty, level_pull

pytestmark = pytest.mark.dealt

RANDOM = np.random.default_rng(21)
WEDGE = DirectionWeights(0.7, seen=1.3, unseen=0.2)
LEVELS = (-0.5, 0.2, 1.0, 1.5)


def directional(device, shape, spacing, dtype="float32", weights=WEDGE):
    if dtype == "float64" and not device.traits.fp64:
        pytest.skip("a device without float64")
    return TotalVariation(ArrayHome(device, dtype), shape, spacing, weights)


SHAPES = [((17, 23), (1.0, 1.0)), ((12, 9), (0.3, 2.5)), ((5, 7, 9), (4.0, 0.5, 1.5))]


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize(("shape", "spacing"), SHAPES)
def test_a_directional_variation_equals_its_twin(device, shape, spacing, dtype):
    variation = directional(device, shape, spacing, dtype)
    close = {"rtol": 1e-5, "atol": 1e-5} if dtype == "float32" else {"rtol": 1e-12, "atol": 1e-12}
    image, field = RANDOM.standard_normal(shape), RANDOM.standard_normal(variation.field_shape)
    u, x = device.zeros(variation.field_shape, dtype), device.array(image, dtype)
    variation.dual_step(u, x, u, step=1.0, radius=np.inf)
    expected = twin.directed(twin.gradient(image, spacing), WEDGE.matrix)
    np.testing.assert_allclose(device.get(u), expected, **close)
    out = device.empty(shape, dtype)
    variation.add_adjoint(0.0, x, 1.0, device.array(field, dtype), out)
    back = twin.gradient_adjoint(twin.directed(field, WEDGE.matrix), spacing)
    np.testing.assert_allclose(device.get(out), back, **close)
    assert np.vdot(expected, field) == pytest.approx(np.vdot(image, back))
    lengths = np.sqrt((expected**2).sum(axis=0))
    assert variation.value(x) == pytest.approx(lengths.sum() * np.prod(spacing), rel=1e-5)
    assert np.sum(expected**2) <= variation.norm_squared * np.sum(image**2)


def test_equal_directions_are_the_isotropic_variation(device):
    equal = DirectionWeights(1.1, seen=1.0, unseen=1.0)
    image = device.array(RANDOM.random((15, 11)))
    values = [
        directional(device, (15, 11), (1.0, 2.0), weights=w).value(image) for w in (equal, None)
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-6)


def test_an_edge_counts_by_its_direction(device):
    """Edges across x and across y, of length 20 and jump 3, where x is the seen direction."""
    weights = DirectionWeights(0.0, seen=2.0, unseen=0.5)
    for axis, weight in ((1, 2.0), (0, 0.5)):
        image = np.zeros((20, 20))
        image[(slice(None),) * axis + (slice(7),)] = 3
        variation = directional(device, image.shape, (1.0, 1.0), weights=weights)
        assert variation.value(device.array(image)) == pytest.approx(3 * 20 * weight, rel=1e-6)


def test_the_middle_direction_of_views():
    angles = np.deg2rad(np.linspace(20, 50, 31))
    for turn in (0, np.pi, -2 * np.pi):
        found = DirectionWeights.of(angles + turn, unseen=0.3)
        assert np.mod(found.angle, np.pi) == pytest.approx(np.deg2rad(35))
        assert (found.seen, found.unseen) == (1.0, 0.3)
    across = DirectionWeights.of(np.deg2rad([170, 175, 0, 5, 10]))
    assert np.sin(across.angle) == pytest.approx(0, abs=1e-9)
    with pytest.raises(InputError, match="evenly all round"):
        DirectionWeights.of(np.arange(12) * np.pi / 12)
    for given in ({"angle": np.nan}, {"angle": 0, "seen": 0}, {"angle": 0, "unseen": -1}):
        with pytest.raises(InputError):
            DirectionWeights(**given)
    with pytest.raises(InputError, match="finite numbers"):
        DirectionWeights.of([0.1, np.inf])


@pytest.mark.parametrize("size", [0, 1, 5000])
def test_values_are_clipped_and_pulled_as_their_twins_say(device, size):
    x = RANDOM.uniform(-2, 3, size).astype(np.float32)
    low = RANDOM.uniform(-1, 0, size).astype(np.float32)
    high = (low + RANDOM.random(size)).astype(np.float32)
    y = device.array(x)
    clip_between(device, device.array(low), device.array(high), y)
    np.testing.assert_array_equal(device.get(y), np.clip(x, low, high))
    pulled = device.array(np.ones(size, np.float32))
    levels = device.array(np.array(LEVELS, np.float32))
    pull_to_levels(device, levels, 0.3, device.array(x), pulled)
    np.testing.assert_allclose(device.get(pulled), 1 + 0.3 * level_pull(x, LEVELS), atol=1e-5)


def test_the_pull_is_the_slope_of_the_penalty():
    x, way = RANDOM.uniform(-0.4, 1.4, (2, 60))
    slope = (level_penalty(x + 1e-6 * way, LEVELS) - level_penalty(x - 1e-6 * way, LEVELS)) / 2e-6
    assert slope == pytest.approx(np.vdot(level_pull(x, LEVELS), way), rel=1e-6)
    assert level_penalty(LEVELS, LEVELS) == 0


def test_clipping_shows_nan(device):
    y = device.array(np.array([np.nan, 5.0], np.float32))
    clip_between(device, device.zeros((2,)), device.array(np.ones(2, np.float32)), y)
    np.testing.assert_array_equal(device.get(y), [np.nan, 1.0])


@pytest.mark.full
def test_bounds_give_the_bounded_least_squares_solution(device):
    from scipy.optimize import lsq_linear

    if not device.traits.fp64:
        pytest.skip("a device without float64")
    random = np.random.default_rng(2)
    matrix, y = random.random((60, 20)) + 2 * np.eye(60, 20), random.random(60)
    A = Matrix(matrix, (4, 5), (60,), device, "float64")
    low, high = random.uniform(-0.2, 0, (4, 5)), random.uniform(0, 0.1, (4, 5))
    solver = Pdhg(A, y, 0.0, bounds=(low, high))
    finished(solver, 2000)
    expected = lsq_linear(matrix, y, (low.ravel() - 1e-12, high.ravel() + 1e-12)).x
    np.testing.assert_allclose(device.get(solver.image).ravel(), expected, atol=1e-5)


@pytest.mark.full
def test_fista_and_pdhg_reach_the_same_directional_minimum(device):
    A, _, _, y = problem(device, noise=0.1)
    values = [
        finished(method(A, y, 0.1, direction_weights=WEDGE), 150)[-1].values["objective"]
        for method in (Fista, Pdhg)
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-3)
    assert finished(Fista(A, y, 0.1), 150)[-1].values["objective"] != pytest.approx(
        values[0], rel=0.02
    )


def test_bounds_zero_and_much_are_nonnegativity(device):
    A, _, _, y = problem(device, noise=0.3)
    one, other = Pdhg(A, y, 0.05, nonnegative=True), Pdhg(A, y, 0.05, bounds=(0, 1e6))
    finished(one, 20), finished(other, 20)
    assert np.array_equal(device.get(one.image), device.get(other.image))


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_resumed_run_gives_the_same_bits(device, dtype, monkeypatch):
    if dtype == "float64" and not device.traits.fp64:
        pytest.skip("a device without float64")
    monkeypatch.setattr("rift_cl.reconstruct.solvers.few_levels._SETTLED", 2)
    A, _, _, y = problem(device, noise=0.1, dtype=dtype)
    given = {"pull": 1e-2, "direction_weights": WEDGE, "support": RANDOM.random(A.domain)}
    whole, first = (FewLevels(A, y, 0.05, **given) for _ in range(2))
    finished(whole, 9), finished(first, 5)
    second = FewLevels(A, y, 0.05, **given)
    second.restore(first.state())
    finished(second, 9)
    for name, value in whole.state().items():
        assert np.array_equal(second.state()[name], value), name
    still = FewLevels(A, y, 0.05, **{**given, "pull": 0.0})
    finished(still, 9)
    assert not np.array_equal(device.get(still.image), device.get(whole.image))


def test_images_stay_within_their_levels_and_support(device):
    A, _, _, y = problem(device, noise=0.5)
    support = RANDOM.random(A.domain) > 0.5
    solver = FewLevels(A, y, 0.02, (-0.1, 0.3, 0.8), support=support, start=9 * np.ones(A.domain))
    image = device.get(solver.image)
    for _ in solver.run(20):
        image = device.get(solver.image)
        assert image.min() >= np.float32(-0.1) and image.max() <= np.float32(0.8)
        assert (image[~support] == np.float32(-0.1)).all()
    labels = solver.labels()
    assert labels.dtype == np.uint8 and labels.shape == A.domain
    np.testing.assert_array_equal(labels, np.digitize(image, [0.1, 0.55], right=True))


@pytest.mark.full
@pytest.mark.parametrize("kind", ["fast", "volume", "matrix"])
def test_any_operator_will_do(device, kind):
    A, matrix, truth, y = problem(device)
    if kind == "volume":
        A = Projector(Grid((2, *GRID.shape)), SCAN, device=device)
        y, truth = np.stack([y, y], axis=1), np.stack([truth, truth])
    A = {
        "fast": lambda: FastProjector(GRID, SCAN, device=device),
        "volume": lambda: A,
        "matrix": lambda: Matrix(matrix.toarray(), A.domain, A.range, device),
    }[kind]()
    solver = FewLevels(
        A, y, 0.01, (0, 1.7), support=np.ones(A.domain[-2:]), direction_weights=WEDGE, pull=1e-4
    )
    reports = finished(solver, 60)
    assert reports[-1].values["residual"] < 0.2 * reports[0].values["residual"]


@pytest.mark.full
def test_bounds_directions_and_a_pull_gain_where_directions_are_missing(device):
    """A disc with holes, seen over thirty degrees."""
    grid = Grid((48, 48))
    y, x = np.meshgrid(grid.coordinates(0), grid.coordinates(1), indexing="ij")
    disc = np.hypot(x, y) < 20
    truth = disc & ~(np.hypot(x - 7, y + 3) < 5) & ~(np.hypot((x + 8) / 2, y - 5) < 3)
    wedge = np.deg2rad(np.arange(0, 31))
    A = Projector(grid, Parallel(wedge, 71), "strip", device=device)
    data = A(truth.astype(np.float32)) + 0.1 * np.random.default_rng(3).standard_normal(A.range)

    def errors(solver, steps=300):
        finished(solver, steps)
        return int(np.sum((device.get(solver.image) > 0.5) != truth))

    directions = DirectionWeights.of(wedge)
    given = {"support": disc, "direction_weights": directions}
    free = errors(Pdhg(A, data, 0.3, nonnegative=True))
    inside = errors(FewLevels(A, data, 0.3, support=disc))
    directed = errors(FewLevels(A, data, 0.3, **given))
    pulled = errors(FewLevels(A, data, 0.3, pull=3e-5, **given), 1200)
    print(f"wrong pixels: TV {free}, in the disc {inside}, directed {directed}, pulled {pulled}")
    assert inside < 0.5 * free
    assert directed < 1.2 * inside
    assert pulled <= directed


@pytest.mark.parametrize(
    ("given", "kind", "message"),
    [
        ({"values": (1, 0)}, InputError, "two or more levels, ascending"),
        ({"values": (1,)}, InputError, "two or more levels"),
        ({"values": "many"}, InputError, "two or more levels"),
        ({"values": (0, np.nan)}, InputError, "two or more levels"),
        ({"support": np.ones(3)}, ShapeError, "support has shape"),
        ({"support": np.full((22, 25), 2.0)}, InputError, "no shares"),
        ({"support": np.full((22, 25), np.nan)}, InputError, "no shares"),
        ({"pull": -1}, InputError, "pull is -1"),
        ({"sigma": 0}, InputError, "sigma is 0"),
        ({"weight": -1}, InputError, "weight is -1"),
    ],
)
def test_what_cannot_be_used_is_refused(device, given, kind, message):
    A, _, _, y = problem(device)
    with pytest.raises(kind, match=message):
        FewLevels(A, y, **{"weight": 0.1, **given})
    with pytest.raises(RiftError, match="wanted a LinearOperator"):
        FewLevels(3, y, 0.1, support=np.ones((22, 25)))


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ((1, 0), "bounds cross"),
        ((0, np.inf), "NaN"),
        ((0, np.ones(7)), "wanted as two"),
        (3, "wanted as two"),
        ((0, "x"), "wanted as two"),
    ],
)
def test_bounds_that_cannot_be_are_refused(device, bounds, message):
    A, _, _, y = problem(device)
    with pytest.raises(InputError, match=message):
        Pdhg(A, y, 0.1, bounds=bounds)
    with pytest.raises(InputError, match="lower bound"):
        Pdhg(A, y, 0.1, bounds=(0, 1), nonnegative=True)


@pytest.mark.full
@pytest.mark.parametrize(("name", "least"), [("ta", 0.88), ("tb", 0.75)])
def test_the_wedge_of_the_helsinki_challenge(shared_data, name, least):
    """Plain total variation reaches 0.78 and 0.57 with the best of its weights."""
    file = open_scan(shared_data / "htc2022" / f"{name}_category7.mat")
    truth = read_image(shared_data / "htc2022" / f"{name}_category7_truth.png")[::-1] > 0.5
    projections = file.read(0, 1).projections[:, 0]
    sinogram, scan = rebin_fan(projections, file.angles, file.fan, whole=False)
    _, seen = covered_rays(file.angles, projections.shape[1], file.fan, whole=False)
    grid = Grid((128, 128), 4 * 0.14832)
    disc = find_disc(sinogram, scan, seen=seen)
    lengths = material_lengths(sinogram, scan, disc, seen=seen).lengths
    given = {"support": disc.coverage(grid), "direction_weights": DirectionWeights.of(scan.angles)}
    solver = FewLevels(Projector(grid, scan), lengths, 1.0, weights=seen, **given)
    finished(solver, 300)
    found = np.kron(solver.labels(), np.ones((4, 4)))
    score = np.corrcoef(found.ravel(), truth.ravel())[0, 1]
    print(f"{name}: {score:.3f}")
    assert score > least
