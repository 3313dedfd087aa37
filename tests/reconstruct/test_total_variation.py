"""Total variation: adjoint, twin, finite differences, and the minimum it denoises to."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.cl.array_home import ArrayHome
from rift_cl.errors import ShapeError
from rift_cl.reconstruct.solvers.tv_functional import TotalVariation
from rift_cl.reference import total_variation as twin

pytestmark = pytest.mark.dealt

SHAPES = {
    "image": ((17, 23), (1.0, 1.0)),
    "anisotropic image": ((12, 9), (0.3, 2.5)),
    "volume": ((5, 11, 9), (1.0, 1.0, 1.0)),
    "anisotropic volume": ((6, 7, 10), (4.0, 0.5, 1.5)),
    "single row": ((1, 40), (1.0, 2.0)),
    "single column": ((40, 1), (2.0, 1.0)),
    "single pixel": ((1, 1), (1.0, 1.0)),
    "one slice": ((1, 8, 13), (1.0, 1.0, 1.0)),
}
RANDOM = np.random.default_rng(71)
every_shape = pytest.mark.parametrize(("shape", "spacing"), SHAPES.values(), ids=SHAPES)
both_types = pytest.mark.parametrize("dtype", ["float32", "float64"])


def made(device, shape, spacing, dtype):
    if dtype == "float64" and not device.traits.fp64:
        pytest.skip("a device without float64")
    return TotalVariation(ArrayHome(device, dtype), shape, spacing)


def gradient(variation, image):
    """The gradient of a host array, by a dual step from nothing."""
    device, dtype = variation.device, variation.dtype
    zero = device.zeros(variation.field_shape, dtype)
    field = device.empty(variation.field_shape, dtype)
    variation.dual_step(zero, device.array(image, dtype), field, step=1.0, radius=np.inf)
    return device.get(field)


def adjoint(variation, field, image, a=0.0, **cut):
    device, dtype = variation.device, variation.dtype
    x, out = device.array(image, dtype), device.empty(image.shape, dtype)
    variation.add_adjoint(a, x, 1.0, device.array(field, dtype), out, **cut)
    return device.get(out)


@both_types
@every_shape
def test_differences_and_their_adjoint_are_a_pair_and_equal_their_twins(
    device, shape, spacing, dtype
):
    variation = made(device, shape, spacing, dtype)
    image = RANDOM.standard_normal(shape)
    field = RANDOM.standard_normal(variation.field_shape)
    ahead, back = gradient(variation, image), adjoint(variation, field, 0 * image)
    close = {"rtol": 1e-5, "atol": 1e-5} if dtype == "float32" else {"rtol": 1e-12, "atol": 1e-12}
    np.testing.assert_allclose(ahead, twin.gradient(image, spacing), **close)
    np.testing.assert_allclose(back, twin.gradient_adjoint(field, spacing), **close)
    left = np.vdot(ahead.astype(float), field)
    right = np.vdot(image, back.astype(float))
    scale = np.linalg.norm(ahead) * np.linalg.norm(field) + 1e-30
    assert abs(left - right) / scale < (1e-6 if dtype == "float32" else 1e-14)


@every_shape
def test_the_norm_of_the_differences_is_bounded_and_next_to_attained(device, shape, spacing):
    variation = made(device, shape, spacing, "float32")
    signs = (-1.0) ** np.sum(np.indices(shape), axis=0)
    seen = np.sum(gradient(variation, signs).astype(float) ** 2) / signs.size
    assert seen <= variation.norm_squared * (1 + 1e-6)
    long = all(n > 1 for n in shape)
    assert not long or seen > 0.7 * variation.norm_squared


@every_shape
def test_steps_stay_in_the_ball(device, shape, spacing):
    variation = made(device, shape, spacing, "float32")
    image = RANDOM.standard_normal(shape)
    field = RANDOM.standard_normal(variation.field_shape).astype(np.float32)
    moved = device.array(field)
    variation.dual_step(moved, device.array(image), moved, step=0.7, radius=0.4)
    expected = twin.into_ball(field + 0.7 * twin.gradient(image, spacing), 0.4)
    np.testing.assert_allclose(device.get(moved), expected, atol=1e-5)


@both_types
@every_shape
def test_the_value_is_the_twins(device, shape, spacing, dtype):
    variation = made(device, shape, spacing, dtype)
    image = RANDOM.standard_normal(shape)
    value = variation.value(device.array(image, dtype))
    close = 1e-6 if dtype == "float32" else 1e-13
    assert value == pytest.approx(twin.total_variation(image, spacing), rel=close)


def test_the_variation_of_a_box_is_jump_times_edge_at_any_spacing(device):
    for spacing in [(1.0, 1.0), (0.5, 2.0), (0.1, 0.1)]:
        size = tuple(int(20 / h) for h in spacing)
        image = np.zeros(size)
        image[: size[0] // 2] = 3
        variation = TotalVariation(ArrayHome(device, "float32"), size, spacing)
        assert variation.value(device.array(image)) == pytest.approx(3 * 20, rel=1e-6)


@pytest.mark.full
def test_the_adjoint_of_the_gradient_is_the_slope_of_the_value(device):
    """By finite differences, where no sample's gradient is zero."""
    if not device.traits.fp64:
        pytest.skip("a device without float64")
    shape, spacing = (7, 9), (0.7, 1.3)
    variation = TotalVariation(ArrayHome(device, "float64"), shape, spacing)
    image, way = RANDOM.standard_normal((2, *shape))
    field = gradient(variation, image)
    length = np.sqrt((field**2).sum(axis=0))
    direction = field / np.where(length > 0, length, 1)
    slope = variation.cell * np.vdot(adjoint(variation, direction, 0 * image), way)
    step = 1e-6
    ahead, behind = (
        variation.value(device.array(image + s * way, "float64")) for s in (step, -step)
    )
    assert (ahead - behind) / (2 * step) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("nonnegative", [False, True])
@every_shape
def test_denoising_equals_its_twin(device, shape, spacing, nonnegative):
    variation = made(device, shape, spacing, "float32")
    image = RANDOM.standard_normal(shape)
    dual, out = device.zeros(variation.field_shape), device.empty(shape)
    variation.denoise(device.array(image), dual, out, weight=0.2, steps=30, nonnegative=nonnegative)
    weight = 0.2 * np.prod(spacing)
    if min(n for n in shape) > 1:
        expected, _ = twin.denoise(image, weight, spacing, 30, nonnegative=nonnegative)
        np.testing.assert_allclose(device.get(out), expected, atol=2e-5)
    assert np.isfinite(device.get(out)).all()
    assert not nonnegative or device.get(out).min() >= 0


@pytest.mark.parametrize("nonnegative", [False, True])
def test_denoising_closes_the_gap_to_its_dual(device, nonnegative):
    """The value at the image less that of the dual field bounds what is left to gain."""
    shape, spacing, weight = (24, 31), (1.0, 0.8), 0.3
    variation = TotalVariation(ArrayHome(device, "float32"), shape, spacing)
    image = RANDOM.standard_normal(shape)
    dual, out = device.zeros(variation.field_shape), device.empty(shape)
    gaps = []
    for _ in range(2):
        variation.denoise(
            device.array(image), dual, out, weight=weight, steps=200, nonnegative=nonnegative
        )
        x, u = device.get(out).astype(float), device.get(dual).astype(float)
        assert np.sqrt((u**2).sum(axis=0)).max() <= weight * variation.cell * (1 + 1e-5)
        primal = np.sum((x - image) ** 2) / 2 + weight * twin.total_variation(x, spacing)
        back = twin.gradient_adjoint(u, spacing)
        best = np.maximum(image - back, 0) if nonnegative else image - back
        gaps.append((primal - np.sum((best - image) ** 2) / 2 - np.vdot(best, back)) / primal)
    assert 0 <= gaps[1] < 1e-4
    # The second run began where the first one ended.
    assert gaps[1] < gaps[0] < 1e-3


def test_denoising_agrees_with_scikit_image(device):
    chambolle = pytest.importorskip("skimage.restoration").denoise_tv_chambolle
    image = RANDOM.standard_normal((32, 40))
    variation = TotalVariation(ArrayHome(device, "float32"), image.shape, (1.0, 1.0))
    dual, out = device.zeros(variation.field_shape), device.empty(image.shape)
    variation.denoise(device.array(image), dual, out, weight=0.4, steps=400, nonnegative=False)
    other = chambolle(image, weight=0.4, eps=1e-9, max_num_iter=4000)

    def objective(x):
        return np.sum((x - image) ** 2) / 2 + 0.4 * twin.total_variation(x, (1.0, 1.0))

    assert objective(device.get(out)) == pytest.approx(objective(other), rel=1e-3)
    np.testing.assert_allclose(device.get(out), other, atol=0.02)


def test_shapes_that_are_no_image_are_refused(device):
    with pytest.raises(ShapeError, match=r"\(7,\)"):
        TotalVariation(ArrayHome(device, "float32"), (7,), (1.0,))
