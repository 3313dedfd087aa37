"""Operators and splats in JAX: the values are our own, and so are gradients, jit and vmap."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ShapeError

jax = pytest.importorskip("jax", reason="JAX is not installed")
jnp = jax.numpy
from rift_cl.interop.jax import apply, render  # noqa: E402 - needs JAX

pytestmark = pytest.mark.once


def projector(device, dtype="float32"):
    grid, scan = rift.Grid((6, 7)), rift.Parallel(np.linspace(0, 3, 5), 9)
    return rift.Projector(grid, scan, device=device, dtype=dtype)


def white(*shape, seed=3):
    return jnp.asarray(np.random.default_rng(seed).standard_normal(shape), jnp.float32)


def test_the_values_are_the_operators_own_compiled_or_not(device):
    A, x = projector(device), white(6, 7)
    assert np.array_equal(apply(A, x), A(np.asarray(x)))
    assert np.array_equal(jax.jit(lambda x: apply(A, x))(x), A(np.asarray(x)))


def test_an_operator_takes_a_jax_array_as_it_takes_any_other(device):
    A, x, y = projector(device), white(6, 7), white(5, 9)
    assert isinstance(A(x), jax.Array)
    assert np.array_equal(A(x), apply(A, x))
    assert np.array_equal(jax.jit(A)(x), A(x))
    assert np.array_equal(jax.jit(lambda y: rift.fbp(A, y))(y), rift.fbp(A, np.asarray(y)))
    with pytest.raises(InputError, match="out is given"):
        A(x, out=np.empty((5, 9), np.float32))


def test_a_solver_gives_a_jax_array_for_one(device):
    A, y = projector(device), white(5, 9)
    found = rift.cgls(A, y, steps=2)
    assert isinstance(found, jax.Array)
    assert np.array_equal(found, rift.cgls(A, np.asarray(y), steps=2))


def test_leading_dimensions_and_vmap_are_batches(device):
    A, x = projector(device), white(2, 3, 6, 7)
    y = apply(A, x)
    assert y.shape == (2, 3, 5, 9)
    assert np.array_equal(jax.vmap(jax.vmap(lambda x: apply(A, x)))(x), y)
    assert np.array_equal(jax.vmap(lambda x: apply(A, x), in_axes=1)(x), y.swapaxes(0, 1))
    assert apply(A, x[:0]).shape == (0, 3, 5, 9)


def test_the_gradient_of_a_least_squares_loss_is_the_adjoint_of_the_residual(device):
    A, x, y = projector(device), white(6, 7), white(5, 9)
    found = jax.jit(jax.grad(lambda x: 0.5 * ((apply(A, x) - y) ** 2).sum()))(x)
    expected = A.T(A(np.asarray(x)) - np.asarray(y))
    assert np.allclose(found, expected, atol=1e-4)


def test_a_gradient_of_a_gradient_is_the_normal_operator(device):
    A, x, v = projector(device), white(6, 7), white(6, 7, seed=4)
    first = jax.grad(lambda x: (apply(A, x) ** 2).sum())
    second = jax.grad(lambda x: (first(x) * v).sum())(x)
    assert np.allclose(second, 2 * A.T(A(np.asarray(v))), atol=1e-3)
    matrix = jax.jacrev(lambda x: apply(A, x))(x).reshape(45, 42)
    assert np.allclose(matrix @ x.ravel(), apply(A, x).ravel(), atol=1e-4)


def test_gradients_in_float64_agree_with_finite_differences(device):
    if not device.traits.fp64:
        pytest.skip("the device has no float64")
    from jax.test_util import check_grads

    A = projector(device, "float64")
    with pytest.raises(DTypeError, match="x is an array of float32, wanted float64"):
        apply(A, white(6, 7))
    with jax.enable_x64(True):
        x = jnp.asarray(np.random.default_rng(1).standard_normal((6, 7)))
        check_grads(lambda x: apply(A, x) ** 2, (x,), order=2, modes=["rev"], rtol=1e-6)


def test_what_is_not_finite_is_nan_throughout(device):
    A, x = projector(device), white(6, 7).at[2, 3].set(jnp.inf)
    assert np.isnan(apply(A, x)).all()


BAD = {
    "double": (lambda x: np.asarray(x, np.float64), DTypeError, r"x is .*float64.*float32"),
    "whole numbers": (lambda x: x.astype(int), DTypeError, "int32"),
    "transposed": (lambda x: x.T, ShapeError, r"shape \(7, 6\), wanted \(..., 6, 7\)"),
    "too flat": (lambda x: x[0], ShapeError, r"shape \(7,\)"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_argument_is_named_before_anything_is_compiled(device, case):
    change, error, words = BAD[case]
    with pytest.raises(error, match=words):
        apply(projector(device), change(white(6, 7)))


def test_what_is_no_operator_is_named():
    with pytest.raises(DTypeError, match="A is a ndarray"):
        apply(np.eye(3), np.eye(3))


def splats(colors=False):
    random = np.random.default_rng(2)
    given = {
        "means": random.uniform(-0.5, 0.5, (8, 3)),
        "quats": random.standard_normal((8, 4)),
        "scales": random.uniform(0.1, 0.3, (8, 3)),
        "opacities": random.uniform(0.3, 0.8, 8),
        "sh": random.uniform(0, 1, (8, 4, 3)),
    }
    if colors:
        given["colors"] = random.uniform(0, 1, (8, 2))
    return {name: jnp.asarray(values, jnp.float32) for name, values in given.items()}


def camera():
    view = np.eye(4)
    view[2, 3] = 3
    return rift.Camera((12, 16), [[16, 0, 8], [0, 16, 6], [0, 0, 1]], view)


SMOOTH = rift.SplatSettings(smooth_cutoff=True)


def test_an_image_is_the_renderers_own(device):
    given, behind = splats(colors=True), np.array([0.1, 0.2, 0.3, 0.4, 0.5], np.float32)
    image, alpha = render(given, camera(), background=behind, device=device)
    hosts = {name: np.asarray(values) for name, values in given.items()}
    ours = rift.Renderer(device=device).picture(
        rift.Splats.upload(device, **hosts), camera(), background=device.array(behind)
    )
    assert np.array_equal(image, ours.image)
    assert np.array_equal(alpha[..., 0], 1 - ours.transmittance)


def test_gradients_of_an_image_agree_with_finite_differences(device):
    given, weight = splats(), white(12, 16, 3, seed=9)

    def loss(given):
        image, alpha = render(given, camera(), settings=SMOOTH, device=device)
        return (weight * image).sum() + (alpha**2).sum()

    found = jax.jit(jax.grad(loss))(given)
    for name, values in given.items():
        step = jnp.asarray(np.random.default_rng(5).standard_normal(values.shape), jnp.float32)
        ends = [loss({**given, name: values + h * step}) for h in (2e-3, -2e-3)]
        slope, expected = float((found[name] * step).sum()), float(ends[0] - ends[1]) / 4e-3
        assert abs(slope - expected) < 5e-2 * max(1.0, abs(expected)), name


def test_gradients_go_to_covariances_and_colours_too(device):
    given = splats(colors=True)
    covars = jnp.tile(jnp.asarray([0.04, 0, 0, 0.04, 0, 0.04]), (8, 1))
    given = {n: given[n] for n in ("means", "opacities", "colors")} | {"covars": covars}
    found = jax.grad(lambda g: render(g, camera(), device=device)[0].sum())(given)
    assert all(np.asarray(found[name]).any() for name in given)


def test_splats_that_cannot_be_drawn_are_named(device):
    given = splats()
    with pytest.raises(InputError, match="splats: colour is none of"):
        render({**given, "colour": given["means"]}, camera(), device=device)
    with pytest.raises(ShapeError, match="Splats: opacities"):
        render({**given, "opacities": given["means"]}, camera(), device=device)
    with pytest.raises(InputError, match="wanted means and opacities"):
        render({"means": given["means"]}, camera(), device=device)
    with pytest.raises(InputError, match="nothing is drawn"):
        render({n: v for n, v in given.items() if n != "sh"}, camera(), device=device)
    with pytest.raises(InputError, match="quats and scales"):
        render({n: v for n, v in given.items() if n != "quats"}, camera(), device=device)


RANGES = {
    "logits": ({"opacities": lambda v: 5 * v}, {}, r"opacities go from.*sigmoid"),
    "logarithms": ({"scales": jnp.log}, {}, r"scales go down to.*exp"),
    "densities": ({"opacities": lambda v: -v}, {"mode": "xray"}, "densities in xray mode"),
}


@pytest.mark.parametrize("case", RANGES)
def test_values_out_of_their_range_are_named_compiled_or_not(device, case):
    changes, mode, words = RANGES[case]
    given = splats() | {name: change(splats()[name]) for name, change in changes.items()}
    settings = rift.SplatSettings(**mode)

    def draw(given):
        return render(given, camera(), settings=settings, device=device)[0]

    with pytest.raises(InputError, match=words):
        draw(given)
    with pytest.raises(jax.errors.JaxRuntimeError, match=words):
        jax.block_until_ready(jax.jit(draw)(given))


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "sh"])
def test_splats_that_are_not_finite_make_all_nan(device, name):
    given = splats()
    given[name] = given[name].at[0].set(jnp.nan)

    def draw(given):
        return render(given, camera(), device=device)

    for image, alpha in (draw(given), jax.jit(draw)(given)):
        assert np.isnan(image).all() and np.isnan(alpha).all()
    gradients = jax.grad(lambda given: draw(given)[0].sum())(given)
    assert all(np.isnan(gradient).all() for gradient in gradients.values())
    gradients = jax.grad(lambda given: jnp.inf * draw(given)[0].sum())(splats())
    assert all(np.isnan(gradient).all() for gradient in gradients.values())


def test_a_background_that_does_not_fit_is_named(device):
    with pytest.raises(ShapeError, match=r"background has shape \(2,\).*\(3,\)"):
        render(splats(), camera(), background=[1, 2], device=device)
    xray = rift.SplatSettings(mode="xray")
    with pytest.raises(InputError, match=r"background.*xray"):
        render(splats(), camera(), background=[1, 2, 3], settings=xray, device=device)
    with pytest.raises(DTypeError, match="background"):
        jax.grad(lambda b: render(splats(), camera(), background=b, device=device)[0].sum())(
            jnp.ones(3)
        )
