"""Projection in closed form: against line integrals, and the laws of symmetric powers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.basis import Basis, Hermite, Laguerre, SquaredHermite, footprint
from rift_cl.basis.indices import graded, n_coeff
from rift_cl.basis.projection import gamma, gamma_matrix, project, project_vjp
from rift_cl.errors import InputError, ShapeError

LINE = np.linspace(-12, 12, 241)


def splat(rng: np.random.Generator, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """A root of moderate anisotropy and an affine screen of full rank."""
    turn = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
    root = turn @ np.diag(np.exp(rng.uniform(-0.7, 0.7, dim))) @ rng.permutation(np.eye(dim))
    return root, rng.normal(size=(dim - 1, dim)) + np.eye(dim)[: dim - 1]


def along_rays(basis: Basis, coeff: np.ndarray, root, mean, P, u: np.ndarray) -> np.ndarray:
    """Line integrals at screen positions u by the trapezoid rule, which converges like exp(-n)."""
    ray = np.linalg.svd(P)[2][-1]
    start = u @ np.linalg.pinv(P).T
    start = start + ((mean - start) @ ray)[:, None] * ray
    # Each ray gets its nodes where, seen from the splat, it passes nearest.
    inner = np.linalg.solve(root, (start - mean).T).T
    way = np.linalg.solve(root, ray)
    nearest = -(inner @ way) / (way @ way)
    nodes = nearest[:, None] + LINE / np.linalg.norm(way)
    x = inner[:, None] + nodes[..., None] * way
    return basis.evaluate(coeff, x).sum(1) * (LINE[1] - LINE[0]) / np.linalg.norm(way)


BASES = [
    *(Hermite(order, 3) for order in (0, 1, 2, 4, 8)),
    *(Hermite(order, 2) for order in (1, 8)),
    Hermite(2, 3, "row"),
    Hermite(6, 3, form="std"),
    Laguerre(8),
    Laguerre(3, truncation="row", form="std"),
    *(SquaredHermite(order, 3) for order in (1, 2, 3)),
    SquaredHermite(3, 2),
]


@pytest.mark.parametrize("basis", BASES, ids=str)
def test_the_closed_form_is_the_line_integral(basis: Basis) -> None:
    rng = np.random.default_rng(7)
    for _ in range(5):
        root, P = splat(rng, basis.dim)
        mean, coeff = rng.normal(size=basis.dim), rng.normal(size=basis.n_coeff)
        L, A, scale = footprint(root, P)
        white = rng.normal(size=(25, basis.dim - 1)) * 1.5
        u = P @ mean + white @ L.T
        flat = basis.project(coeff, A)
        order = next(n for n in range(65) if n_coeff(n, basis.dim - 1) == flat.shape[-1])
        closed = scale * Hermite(order, basis.dim - 1).evaluate(flat, white)
        exact = along_rays(basis, coeff, root, mean, P, u)
        assert np.abs(closed - exact).max() <= 1e-12 * max(1, np.abs(exact).max())


@pytest.mark.parametrize("dilation", [0.05, 0.3, 4.0])
def test_a_blur_is_a_contraction_of_the_same_map(dilation: float) -> None:
    """Project, then convolve with a Gaussian by quadrature: Gamma of A = L^-1 V with the blur."""
    rng = np.random.default_rng(8)
    root, P = splat(rng, 3)
    coeff = rng.normal(size=n_coeff(4, 3))
    sharp, soft = footprint(root, P), footprint(root, P, dilation)
    assert np.linalg.norm(soft.A, 2) < np.linalg.norm(sharp.A, 2) == pytest.approx(1)
    line = np.linspace(-7, 7, 71) * math.sqrt(dilation)
    shifts = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2)
    weight = np.exp(-(shifts**2).sum(-1) / (2 * dilation)) / (2 * math.pi * dilation)
    weight *= (line[1] - line[0]) ** 2
    u = rng.normal(size=(20, 2)) @ soft.L.T
    basis = Hermite(4)

    def drawn(view, at: np.ndarray) -> np.ndarray:
        white = np.linalg.solve(view.L, at[..., None])[..., 0]
        return view.scale * basis.evaluate(project(coeff, view.A, 4), white)

    blurred = drawn(sharp, u[:, None] - shifts) @ weight
    np.testing.assert_allclose(drawn(soft, u), blurred, atol=1e-12 * np.abs(blurred).max())


def test_a_row_of_the_power_is_a_polynomial_of_the_matrix() -> None:
    """Order 1 is A itself; order 2 of a row (a, b) is a^2, sqrt2 a b, b^2."""
    A = np.array([[0.3, -0.5, 0.2], [0.1, 0.4, -0.7]])
    np.testing.assert_array_equal(gamma(A, 1)[1], A)
    (a, b, c), root = A[0], math.sqrt(2)
    row = [a * a, root * a * b, root * a * c, b * b, root * b * c, c * c]
    np.testing.assert_allclose(gamma(A, 2)[2][0], row, rtol=1e-15)


@pytest.mark.parametrize("shapes", [(2, 3, 3), (1, 2, 3), (2, 2, 2), (3, 2, 3), (1, 3, 1)])
def test_powers_of_a_product_are_products_of_powers(shapes: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(9)
    A, B = rng.normal(size=shapes[:2]), rng.normal(size=shapes[1:])
    A, B = A / np.linalg.norm(A, 2), B / np.linalg.norm(B, 2)
    for left, right, both in zip(gamma(A, 12), gamma(B, 12), gamma(A @ B, 12), strict=True):
        np.testing.assert_allclose(left @ right, both, atol=5e-15)
    for straight, across in zip(gamma(A, 12), gamma(A.T, 12), strict=True):
        np.testing.assert_allclose(straight, across.T, atol=1e-16)


@pytest.mark.parametrize(("shape", "order"), [((2, 3), 16), ((1, 3), 16), ((1, 2), 64)])
def test_projection_keeps_norm_one_at_every_order(shape: tuple[int, int], order: int) -> None:
    rng = np.random.default_rng(10)
    A = np.linalg.qr(rng.normal(size=shape[::-1]))[0].T
    for block in gamma(A, order):
        np.testing.assert_allclose(block @ block.T, np.eye(len(block)), atol=1e-14)
        assert np.linalg.norm(0.99 * block, 2) <= 1


def test_orthogonal_powers_stay_orthogonal_to_order_64() -> None:
    c, s = math.cos(0.7), math.sin(0.7)
    worst = [
        np.abs(block @ block.T - np.eye(len(block))).max()
        for block in gamma(np.array([[c, -s], [s, c]]), 64)
    ]
    assert max(worst[:13]) <= 1e-14 and max(worst) <= 1e-12


@pytest.mark.parametrize("shape", [(2, 3), (1, 2), (3, 3), (2, 2), (1, 3)])
def test_the_gradient_by_the_matrix_is_that_of_a_complex_step(shape: tuple[int, int]) -> None:
    """Differences without their error: the imaginary part of the map at A + i h E, over h."""
    rng = np.random.default_rng(11)
    order = 6
    A, coeff = rng.normal(size=shape), rng.normal(size=n_coeff(order, shape[1]))
    A = A / np.linalg.norm(A, 2)
    cotangent = rng.normal(size=n_coeff(order, shape[0]))
    by_coeff, by_matrix = project_vjp(coeff, A, order, cotangent)
    for place in np.ndindex(*shape):
        step = np.zeros(shape, complex)
        step[place] = 1e-30j
        moved = project(coeff, A + step, order).imag / 1e-30
        assert by_matrix[place] == pytest.approx(cotangent @ moved, rel=1e-13, abs=1e-12)
    np.testing.assert_allclose(by_coeff, cotangent @ gamma_matrix(A, order), atol=1e-13)


VJP_BASES = [
    Hermite(3, 3),
    Hermite(3, 3, form="std"),
    Hermite(2, 3, "row", "std"),
    Laguerre(4),
    Laguerre(2, "real", "row", "std"),
    SquaredHermite(2, 3),
    SquaredHermite(3, 2),
]


@pytest.mark.parametrize("basis", VJP_BASES, ids=str)
def test_gradients_of_every_basis_are_those_of_differences(basis: Basis) -> None:
    rng = np.random.default_rng(12)
    coeff, A = rng.normal(size=basis.n_coeff), rng.normal(size=(basis.dim - 1, basis.dim)) / 2
    cotangent = rng.normal(size=basis.project(coeff, A).shape)
    by_coeff, by_matrix = basis.project_vjp(coeff, A, cotangent)
    h = 1e-6
    for k, step in enumerate(h * np.eye(basis.n_coeff)):
        slope = (basis.project(coeff + step, A) - basis.project(coeff - step, A)) @ cotangent
        assert by_coeff[k] == pytest.approx(slope / (2 * h), rel=1e-6, abs=1e-7)
    for place in np.ndindex(*A.shape):
        step = np.zeros(A.shape)
        step[place] = h
        slope = (basis.project(coeff, A + step) - basis.project(coeff, A - step)) @ cotangent
        assert by_matrix[place] == pytest.approx(slope / (2 * h), rel=1e-6, abs=1e-7)


def test_many_splats_go_through_at_once() -> None:
    rng = np.random.default_rng(13)
    A, coeff = rng.normal(size=(7, 2, 3)), rng.normal(size=(7, n_coeff(3, 3)))
    cotangent = rng.normal(size=(7, n_coeff(3, 2)))
    together, (by_coeff, by_matrix) = project(coeff, A, 3), project_vjp(coeff, A, 3, cotangent)
    for k in range(7):
        np.testing.assert_allclose(together[k], project(coeff[k], A[k], 3), atol=1e-14)
        alone = project_vjp(coeff[k], A[k], 3, cotangent[k])
        np.testing.assert_allclose(by_coeff[k], alone[0], atol=1e-13)
        np.testing.assert_allclose(by_matrix[k], alone[1], atol=1e-13)


def test_squares_stay_nonnegative_under_projection() -> None:
    rng = np.random.default_rng(14)
    for _ in range(20):
        basis = SquaredHermite(2, 3)
        _, A, _ = footprint(*splat(rng, 3))
        flat = basis.project(rng.normal(size=basis.n_coeff), A)
        values = Hermite(4).evaluate(flat, rng.normal(size=(400, 2)) * 2)
        assert values.min() >= -1e-13 * np.abs(values).max()


@pytest.mark.parametrize(
    ("A", "kind"),
    [
        (np.ones(3), ShapeError),
        (np.ones((4, 3)), ShapeError),
        (np.ones((2, 0)), ShapeError),
        ([[math.nan, 0, 0]], InputError),
        ("wide", InputError),
        ([[1, 2], [3]], InputError),
    ],
)
def test_impossible_matrices_are_refused(A: object, kind: type[Exception]) -> None:
    with pytest.raises(kind, match="A "):
        gamma(A, 2)  # type: ignore[arg-type]


def test_shapes_that_do_not_fit_are_refused() -> None:
    A = np.ones((2, 3))
    for wrong in (np.ones(9), np.ones(0), 1.0, np.ones((10, 3))):
        with pytest.raises(ShapeError, match=r"coeff has shape .*, 10"):
            project(wrong, A, 2)
    with pytest.raises(ShapeError, match="leading axes"):
        project(np.ones((4, 10)), np.ones((3, 2, 3)), 2)
    with pytest.raises(ShapeError, match="cotangent has shape"):
        project_vjp(np.ones(10), A, 2, np.ones(5))
    with pytest.raises(ShapeError, match=r"wanted \(\.\.\., out, 3\)"):
        Hermite(2, 3).project(np.ones(10), np.ones((2, 2)))
    with pytest.raises(ShapeError, match="one matrix"):
        gamma_matrix(np.ones((5, 2, 3)), 2)
    with pytest.raises(InputError, match="wanted real numbers"):
        project_vjp(np.ones(10), A * 1j, 2, np.ones(6))
    with pytest.raises(InputError, match="kind='real'"):
        Laguerre(2, "complex").project_vjp(np.ones(6), np.ones((1, 2)), np.ones(3))


def test_a_high_order_of_graded_modes_is_what_a_projection_maps() -> None:
    """Along the third axis only the modes without it are left, each as it was."""
    A = np.eye(2, 3)
    modes, coeff = graded(3, 3), np.random.default_rng(16).normal(size=20)
    flat = {
        tuple(mode): value for mode, value in zip(graded(3, 2), project(coeff, A, 3), strict=True)
    }
    kept = {tuple(mode[:2]): c for mode, c in zip(modes, coeff, strict=True) if mode[2] == 0}
    assert flat == pytest.approx(kept, rel=1e-14)
