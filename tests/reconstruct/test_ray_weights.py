"""Weighted least squares: what NumPy and SciPy find, and what weights by counts are worth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import diags, linalg
from solver_cases import GRID, METHODS, SCAN, Matrix, finished, problem, twin_matrix

from rift_cl import FastProjector, Grid, Parallel, Projector, metrics
from rift_cl.errors import CheckpointError, InputError, NonFiniteError, RiftError, ShapeError
from rift_cl.reconstruct import (
    Cgls,
    Fista,
    MeasuredRays,
    Pdhg,
    Sirt,
    cgls,
    poisson_weights,
    sirt,
    tv,
)
from rift_cl.reference import total_variation as twin

pytestmark = pytest.mark.once

RANDOM = np.random.default_rng(11)
every_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


def uneven(shape, *, unmeasured=0.1, seed=3):
    """Weights over two decades, some of them zero."""
    random = np.random.default_rng(seed)
    weights = 10 ** random.uniform(-1, 1, shape)
    return np.where(random.random(shape) < unmeasured, 0, weights)


def double(device):
    if not device.traits.fp64:
        pytest.skip("a device without float64")
    return "float64"


def test_conjugate_gradients_are_scipys_lsqr_on_the_weighted_system(device):
    A, matrix, _, y = problem(device, noise=0.3, dtype=double(device))
    weights = uneven(A.range)
    roots = np.sqrt(weights.ravel())
    for steps in (1, 4, 9):
        given = {"iter_lim": steps, "atol": 0, "btol": 0, "conlim": 0}
        expected = linalg.lsqr(diags(roots) @ matrix, roots * y.ravel(), **given)[0]
        found = cgls(A, y, steps, weights=weights).ravel()
        assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("method", ["cgls", "sirt", "fista", "pdhg"])
def test_every_method_ends_at_the_dense_weighted_solution(device, method):
    random = np.random.default_rng(5)
    matrix = random.random((60, 20)) + 3 * np.eye(60, 20)
    A = Matrix(matrix, (4, 5), (60,), device, double(device))
    weights, y = uneven((60,)), random.random(60)
    roots = np.sqrt(weights)
    expected = np.linalg.lstsq(roots[:, None] * matrix, roots * y, rcond=None)[0]
    unweighted = np.linalg.lstsq(matrix, y, rcond=None)[0]
    run = {
        "cgls": lambda: cgls(A, y, 60, weights=weights),
        "sirt": lambda: sirt(A, y, 3000, weights=weights, relaxation=1.9),
        "fista": lambda: tv(A, y, 0.0, 1500, weights=weights, method="fista"),
        "pdhg": lambda: tv(A, y, 0.0, 3000, weights=weights),
    }[method]
    np.testing.assert_allclose(run().ravel(), expected, atol=2e-4 * np.abs(expected).max())
    assert np.linalg.norm(unweighted - expected) > 0.02 * np.linalg.norm(expected)


def test_sirt_with_weights_is_its_formula(device):
    A, matrix, _, y = problem(device, noise=0.5)
    weights = uneven(A.range)
    w = weights.ravel()
    pixels = matrix.T @ (w * np.asarray(matrix.sum(axis=1)).ravel())
    x = np.zeros(matrix.shape[1])
    for _ in range(12):
        x = np.maximum(x + 1.5 / pixels * (matrix.T @ (w * (y.ravel() - matrix @ x))), 0)
    found = sirt(A, y, 12, relaxation=1.5, nonnegative=True, weights=weights).ravel()
    np.testing.assert_allclose(found, x, atol=2e-4 * x.max())


@pytest.mark.full
@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_fista_and_pdhg_reach_the_same_weighted_minimum(device, precondition):
    A, _, _, y = problem(device, noise=0.1)
    weights = uneven(A.range)
    given = {"nonnegative": True, "weights": weights, "precondition": precondition}
    fista, pdhg = (method(A, y, 0.05, **given) for method in (Fista, Pdhg))
    values = [finished(s, n)[-1].values["objective"] for s, n in ((fista, 150), (pdhg, 700))]
    assert values[0] == pytest.approx(values[1], rel=2e-3)
    image, F = device.get(fista.image), fista.data.weight
    residual = np.sqrt(weights) * (A(image).astype(float) - y)
    square = np.vdot(residual, residual if F is None else F(residual))
    strength = 0.05 * weights[weights > 0].mean()
    assert square / 2 + strength * twin.total_variation(image, GRID.spacing) == pytest.approx(
        values[0], rel=1e-4
    )


@every_method
def test_the_scale_of_the_weights_does_not_change_the_image(device, method):
    """Relative inverse variances, such as counts, do as well as those of mean 1.

    Powers of four have roots that round nothing, which conjugate gradients would make much of.
    """
    A, _, _, y = problem(device, noise=0.1)
    weights = uneven(A.range)
    images, residuals = [], []
    for scale in (1.0, 4.0**5, 4.0**-5):
        solver = method(A, y, weights=scale * weights)
        residuals.append(finished(solver, 8)[-1].values["residual"] / np.sqrt(scale))
        images.append(device.get(solver.image))
    atol = 1e-5 * np.abs(images[0]).max()
    np.testing.assert_allclose(images[1:], [images[0]] * 2, atol=atol)
    assert residuals == pytest.approx([residuals[0]] * 3, rel=1e-5)


@every_method
def test_equal_weights_change_nothing_but_the_unit(device, method):
    A, _, _, y = problem(device, noise=0.1)
    plain, weighted = method(A, y), method(A, y, weights=np.ones(A.range))
    residuals = [finished(s, 6)[-1].values["residual"] for s in (plain, weighted)]
    if isinstance(plain, Sirt):
        # Its plain steps weigh a ray by its length; with these weights it no longer does.
        assert residuals[1] == pytest.approx(residuals[0], rel=0.5)
    else:
        assert np.array_equal(device.get(plain.image), device.get(weighted.image))
        assert residuals[1] == residuals[0]


@every_method
@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_rays_of_weight_zero_are_rays_unseen(device, method, precondition):
    A, _, _, y = problem(device, noise=0.1)
    seen = RANDOM.random(A.range) > 0.3
    spoilt = np.where(seen, y, np.nan)
    if method is Sirt and precondition is None:
        rays = method(A, np.where(seen, 99.0, y), weights=~seen)
        assert finished(rays, 30)[-1].values["residual"] < 0.3
        return
    masked = method(MeasuredRays(A, seen), np.where(seen, y, 0), precondition=precondition)
    weighted = method(A, spoilt, weights=seen, precondition=precondition)
    finished(masked, 5), finished(weighted, 5)
    expected = device.get(masked.image)
    np.testing.assert_allclose(
        device.get(weighted.image), expected, atol=1e-5 * np.abs(expected).max()
    )


@every_method
@pytest.mark.parametrize("precondition", [None, "ramp"])
def test_a_weighted_run_stops_at_the_noise_of_weight_one(device, method, precondition):
    A, _, _, clean = problem(device)
    weights = uneven(A.range)
    noise = 0.1 / np.sqrt(np.maximum(weights, 1e-3)) * RANDOM.standard_normal(A.range)
    given = {"weights": weights, "noise": 0.1, "precondition": precondition}
    solver = method(A, clean + noise, **given)
    reports = finished(solver, 600)
    assert reports[-1].done < 600
    residual = np.sqrt(weights) * (A(device.get(solver.image)) - clean - noise)
    rms = np.sqrt((residual**2).sum() / np.count_nonzero(weights))
    assert reports[-1].values["residual"] == pytest.approx(rms, rel=1e-3)
    # SIRT under a ramp may end on the residual that the ramp weighs.
    assert rms <= 0.1 * (1.5 if method is Sirt and precondition else 1)


@every_method
def test_a_weighted_run_resumes_to_the_same_bits(device, method):
    A, _, _, y = problem(device, noise=0.1)
    weights = uneven(A.range)
    whole, first = (method(A, y, weights=weights) for _ in range(2))
    finished(whole, 7), finished(first, 3)
    second = method(A, y, weights=weights)
    second.restore(first.state())
    finished(second, 7)
    for name, value in whole.state().items():
        assert np.array_equal(second.state()[name], value), name
    with pytest.raises(CheckpointError, match="another A or another y"):
        method(A, y, weights=weights**2).restore(first.state())


def test_a_fast_projector_and_a_volume_take_weights(device):
    grid = Grid((2, *GRID.shape), spacing=(1.0, *GRID.spacing))
    A = Projector(grid, SCAN, device=device)
    y = np.stack([problem(device)[3]] * 2, axis=1)
    weights = uneven(A.range)
    assert np.isfinite(tv(A, y, 0.05, 5, weights=device.array(weights.astype("f4")))).all()
    fast = FastProjector(GRID, SCAN, device=device)
    close = cgls(fast, y[:, 0], 5, weights=weights[:, 0])
    exact = cgls(Projector(GRID, SCAN, device=device), y[:, 0], 5, weights=weights[:, 0])
    assert np.linalg.norm(close - exact) < 0.1 * np.linalg.norm(exact)


def starved_scan():
    """A disc with soft parts and two rods of metal, its scan, and the pixels without metal."""
    grid, scan = Grid((64, 64)), Parallel(np.linspace(0, np.pi, 60, endpoint=False), 91)
    y, x = np.meshgrid(grid.coordinates(0), grid.coordinates(1), indexing="ij")
    truth = 0.02 * (np.hypot(x, y) < 28) + 0.01 * (np.hypot(x + 8, y - 9) < 6)
    rods = (np.hypot(x - 13, y - 2) < 4) | (np.hypot(x + 13, y + 6) < 4)
    truth[rods] = 0.6
    counts = np.random.default_rng(7).poisson(
        2e4 * np.exp(-(twin_matrix(grid, scan) @ truth.ravel()))
    )
    p = -np.log(np.maximum(counts, 0.5) / 2e4).reshape(len(scan.angles), scan.bins)
    return grid, scan, truth, p, ~rods


def best_score(A, solver, steps, truth, soft):
    """The best PSNR on the way, so that no method loses by where it stops."""
    scores = [
        metrics.psnr(A.device.get(solver.image), truth, peak=0.03, mask=soft)
        for _ in solver.run(steps)
    ]
    return max(scores)


@pytest.mark.parametrize(
    ("name", "method", "steps", "gain"),
    [
        ("CGLS", Cgls, 30, 10),
        ("FISTA-TV", lambda A, p, **given: Fista(A, p, 0.02, nonnegative=True, **given), 150, 10),
    ],
)
def test_weights_by_counts_beat_none_where_metal_starves_rays(device, name, method, steps, gain):
    grid, scan, truth, p, soft = starved_scan()
    A = Projector(grid, scan, device=device)
    weights, _ = poisson_weights(p, 2e4)
    ramp = None if method is Cgls else "ramp"
    plain = best_score(A, method(A, p), steps, truth, soft)
    weighted = best_score(A, method(A, p, weights=weights, precondition=ramp), steps, truth, soft)
    print(f"{name}: {plain:.1f} dB without weights, {weighted:.1f} dB with weights by counts")
    assert weighted > plain + gain


def test_the_weights_are_the_inverse_variances_of_counts():
    p = np.array([[0.0, 1.0, 2.0], [3.0, 0.5, 4.0]])
    counts = np.random.default_rng(1).poisson(5e3 * np.exp(-p), (20000, 2, 3))
    variance = np.var(-np.log(counts / 5e3), axis=0)
    weights, noise = poisson_weights(p, 5e3)
    np.testing.assert_allclose(noise**2 / weights, variance, rtol=0.05)
    assert weights.mean() == pytest.approx(1)
    read = counts + np.random.default_rng(2).normal(0, 40, counts.shape)
    weights, noise = poisson_weights(p, 5e3, read_noise=40)
    variance = np.var(-np.log(np.maximum(read, 1) / 5e3), axis=0)
    np.testing.assert_allclose((noise**2 / weights)[0], variance[0], rtol=0.05)


def test_weights_of_odd_data():
    weights, noise = poisson_weights([[np.nan, 0.0, 800.0], [np.inf, -np.inf, -0.1]], [1, 2, 3])
    assert np.isfinite(weights).all() and np.isfinite(noise)
    assert (weights == 0).tolist() == [[True, False, True], [True, True, False]]
    assert weights.dtype == np.float32
    assert weights[1, 2] / weights[0, 1] == pytest.approx(1.5 * np.exp(0.1))
    for given, message in [
        (([np.nan], 1.0), "no measured ray"),
        (([1.0], 0.0), "flat_counts hold"),
        (([1.0, 2.0], [1.0, 2.0, 3.0]), "does not fit"),
        (([], 1.0), "no measured ray"),
    ]:
        with pytest.raises(RiftError, match=message):
            poisson_weights(*given)
    with pytest.raises(InputError, match="read_noise is -1"):
        poisson_weights([1.0], read_noise=-1)


@pytest.mark.parametrize(
    ("weights", "kind", "message"),
    [
        (np.ones(3), ShapeError, "weights have shape"),
        (-np.ones((18, 33)), InputError, "weights hold -1"),
        (np.zeros((18, 33)), InputError, "0 everywhere"),
        (np.full((18, 33), 1e-60), InputError, "0 everywhere"),
        (np.full((18, 33), np.nan), NonFiniteError, "NaN"),
        (np.full((18, 33), 1e60), NonFiniteError, "beyond float32"),
        ("many", RiftError, "weights"),
    ],
)
def test_weights_that_cannot_be_used_are_refused(device, weights, kind, message):
    A, _, _, y = problem(device)
    with pytest.raises(kind, match=message):
        Cgls(A, y, weights=weights)
