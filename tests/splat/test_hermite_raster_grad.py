"""Moments of splats with Hermite modes: against the twin, finite differences, the Gaussian's."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from hermite_gradients import gradients
from hermite_scenes import draw_twin, hermite_scene, moments, moments_twin, whitening
from scenes import random_scene

from rift_cl.errors import InputError
from rift_cl.splat.raster import ScreenModes, raster_grad, rasterize, sum_slots
from rift_cl.splat.settings import SplatSettings

SIZE = (50, 70)
KINDS = {
    "clamp": SplatSettings(alpha_cap=0.98),
    "exp": SplatSettings(alpha_cap=0.98, activation="exp"),
    "square": SplatSettings(alpha_cap=0.98, activation="square"),
    "xray": SplatSettings(mode="xray"),
    "smooth": SplatSettings(smooth_cutoff=True, activation="exp"),
    "small tiles": SplatSettings(alpha_cap=0.98, tile=8),
    "large tiles": SplatSettings(alpha_cap=0.98, tile=32),
    "low cap": SplatSettings(alpha_cap=0.5, activation="square"),
}
ORDERS = [("clamp", (1, 0)), ("clamp", (0, 1)), ("clamp", (4, 4)), ("xray", (4, 4))]
# What most tests draw, so that few kernels are built.
USUAL = (2, 1)


def coming_gradient(size, channels, settings, seed=5):
    """dL/d image and dL/d transmittance; line integrals have no background."""
    random = np.random.default_rng(seed)
    grad_image = random.normal(size=(*size, channels)).astype(np.float32)
    left = random.normal(size=size) * (settings.mode == "light")
    return grad_image, left.astype(np.float32)


def assert_like_the_twin(device, given, settings, channels):
    background = np.linspace(0.1, 0.9, channels).astype(np.float32)
    coming = coming_gradient(given.scene.size, channels, settings)
    found = moments(device, given, settings, *coming, background)
    expected = moments_twin(given, settings, *coming, background)
    size = np.linalg.norm(expected, axis=1)
    error = np.linalg.norm(found - expected, axis=1)
    assert np.linalg.norm(error) < 1e-5 * np.linalg.norm(size)
    told = size > 1e-6 * size.max()
    assert told.any() and (error[told] < 1e-4 * size[told]).all()


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_every_way_to_draw_has_the_moments_of_its_twin(device, kind):
    settings = KINDS[kind]
    given = hermite_scene(100, SIZE, USUAL, channels=4, tile=settings.tile or 16)
    assert_like_the_twin(device, given, settings, 4)


@pytest.mark.parametrize(("kind", "orders"), ORDERS)
def test_every_order_has_the_moments_of_its_twin(device, kind, orders):
    assert_like_the_twin(device, hermite_scene(50, SIZE, orders), KINDS[kind], 3)


@pytest.mark.full
def test_the_highest_order_has_the_moments_of_its_twin(device):
    given = hermite_scene(15, SIZE, (8, 8), colored=1, strength=0.1, farthest=9)
    assert_like_the_twin(device, given, KINDS["exp"], 3)


@pytest.mark.full
@pytest.mark.parametrize("channels", [1, 32])
def test_any_number_of_channels_has_the_moments_of_its_twin(device, channels):
    given = hermite_scene(40, SIZE, (1, 1), channels=channels, colored=channels)
    assert_like_the_twin(device, given, KINDS["clamp"], channels)


@pytest.mark.full
@pytest.mark.parametrize("kind", ["clamp", "exp", "square", "xray"])
def test_all_gradients_follow_from_the_moments(device, kind):
    """Finite differences of the twin's loss, against algebra on the twin's moments and on ours."""
    settings, given, coming, background = small_scene(kind)
    splats, squared = given.twin(), settings.activation == "square"
    ours = gradients(splats, moments(device, given, settings, *coming, background), squared)
    twins = gradients(splats, moments_twin(given, settings, *coming, background), squared)
    for name, expected in small_differences(kind).items():
        scale = np.linalg.norm(expected)
        assert scale > 0
        assert np.linalg.norm(twins[name] - expected) < 1e-6 * scale, name
        assert np.linalg.norm(ours[name] - expected) < 2e-5 * scale, name


def small_scene(kind):
    settings = dataclasses.replace(KINDS[kind], smooth_cutoff=True)
    given = hermite_scene(4, (20, 24), (2, 2), scale=3.0, weights=(0.2, 0.9), strength=0.15)
    coming = coming_gradient((20, 24), 3, settings)
    return settings, given, coming, np.float32([0.3, 0.1, 0.7])


@cache
def small_differences(kind):
    settings, given, (grad_image, grad_left), background = small_scene(kind)

    def loss(moved):
        image, left = draw_twin(given, settings, background, moved)
        return (image * grad_image).sum() + (left * grad_left).sum()

    names = ("shape", "tint", "features", "weight", "mean", "whitening")
    return {name: differences(loss, given.twin(), name) for name in names}


def differences(loss, splats, name):
    """Central differences of a loss by one of the splats' arrays."""
    field, columns = {"weight": ("screen", 5), "mean": ("screen", slice(0, 2))}.get(
        name, (name, slice(None))
    )
    array = getattr(splats, field)
    result = np.zeros(array[:, columns].shape)
    for index in np.ndindex(result.shape):
        sides = []
        for sign in (1, -1):
            moved = array.copy()
            moved[:, columns][index] += sign * 1e-5
            sides.append(loss(dataclasses.replace(splats, **{field: moved})))
        result[index] = (sides[0] - sides[1]) / 2e-5
    return result


@pytest.mark.full
@pytest.mark.parametrize("kind", ["clamp", "xray"])
def test_order_zero_has_the_moments_of_the_gaussian(device, kind):
    scene, settings = random_scene(150, SIZE), KINDS[kind]
    splats, lists = scene.upload(device)
    grad_image, grad_left = map(device.array, coming_gradient(SIZE, 3, settings))
    table = whitening(scene.screen).astype(np.float32)
    sums = []
    for modes in (None, ScreenModes(device.array(table), 0)):
        given = dataclasses.replace(splats, modes=modes)
        raster = rasterize(device, given, lists, SIZE, settings=settings)
        drawn = (given, lists, raster, grad_image, grad_left)
        slots = raster_grad(device, *drawn, settings=settings)
        sums.append(device.get(sum_slots(device, lists.slots, slots)).astype(float))
    plain, modal = sums
    i00, i10, i11 = table.T.astype(float)
    zeroth, u1, u2, u11, u12, _ = modal[:, :6].T
    across = u1 / i00
    expected = np.stack(
        [-zeroth, across, (u2 - i10 * across) / i11, -(np.sqrt(2) * u11 + zeroth) / i00**2],
        axis=1,
    )
    assert np.linalg.norm(plain[:, :4] - expected) < 2e-5 * np.linalg.norm(expected)
    cross = -(u12 - i10 / i00 * (np.sqrt(2) * u11 + zeroth)) / (i00 * i11)
    assert np.linalg.norm(plain[:, 4] - cross) < 2e-5 * np.linalg.norm(cross)
    np.testing.assert_allclose(modal[:, 6:], plain[:, 6:], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("kind", ["clamp", "square", "xray"])
def test_two_runs_give_the_same_bits(device, kind):
    given = hermite_scene(150, SIZE, USUAL, channels=4)
    coming = coming_gradient(SIZE, 4, KINDS[kind])
    runs = [moments(device, given, KINDS[kind], *coming) for _ in range(3)]
    assert all(np.array_equal(runs[0], run) for run in runs)


def test_capped_alpha_has_no_gradient_by_shape(device):
    given = hermite_scene(1, (16, 16), (1, 0), scale=200.0, weights=(0.9, 0.95), strength=0)
    settings, coming = SplatSettings(alpha_cap=0.3), np.ones((16, 16, 3), np.float32)
    sums = moments(device, given, settings, coming, np.zeros((16, 16), np.float32))
    assert not sums[:, :10].any()
    assert (sums[:, 10:] > 0).all()


def test_the_deepest_splats_keep_their_digits(device):
    """Forty layers: the last ones are seen through a transmittance of some 1e-3."""
    options = {"scale": 40.0, "weights": (0.12, 0.2), "strength": 0.1, "channels": 4}
    given, settings = hermite_scene(40, (16, 16), USUAL, **options), KINDS["clamp"]
    coming = coming_gradient((16, 16), 4, settings)
    found = moments(device, given, settings, *coming)
    expected = moments_twin(given, settings, *coming)
    for splat in np.argsort(given.scene.depths)[-8:]:
        error = np.linalg.norm(found[splat] - expected[splat])
        assert error < 1e-4 * np.linalg.norm(expected[splat])


@pytest.mark.parametrize("kind", ["clamp", "square", "xray"])
def test_a_needle_without_width_leaves_the_moments_finite(device, kind):
    given = hermite_scene(40, SIZE, USUAL, strength=0.01, channels=4)
    given.table[5, :3] = [1e18, -1e18, 1e18]
    given.table[6, :3] = [1e-18, 0, 1e18]
    found = moments(device, given, KINDS[kind], *coming_gradient(SIZE, 4, KINDS[kind]))
    assert np.isfinite(found).all()


def test_magnitudes_of_gradients_are_refused(device):
    given, settings = hermite_scene(5, SIZE, (1, 0)), SplatSettings(absgrad=True)
    with pytest.raises(InputError, match="absgrad"):
        moments(device, given, settings, *coming_gradient(SIZE, 3, settings))
