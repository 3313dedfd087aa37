"""Compositing and its gradient: against the twin, finite differences, and laws."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import numbers_of, random_scene

from rift_cl.errors import InputError, ShapeError
from rift_cl.reference.splat_raster import Rules, raster
from rift_cl.splat.raster import raster_grad, rasterize
from rift_cl.splat.settings import SplatSettings

SIZE = (50, 70)
KINDS = {
    "light": SplatSettings(),
    "smooth": SplatSettings(smooth_cutoff=True),
    "xray": SplatSettings(mode="xray"),
    "small tiles": SplatSettings(tile=8),
    "large tiles": SplatSettings(tile=32),
    "low cap": SplatSettings(alpha_cap=0.5),
}


def rules_of(settings):
    return Rules(
        settings.tile or 16, settings.alpha_cap, settings.mode == "xray", settings.smooth_cutoff
    )


def twin(scene, settings, background=None, screen=None, features=None):
    screen = scene.screen.astype(float) if screen is None else screen
    features = scene.features.astype(float) if features is None else features
    rules = rules_of(settings)
    return raster(screen, features, scene.entries, scene.starts, scene.size, rules, background)


def draw(device, scene, settings, background=None):
    splats, lists = scene.upload(device)
    if background is not None:
        background = device.array(background)
    result = rasterize(device, splats, lists, scene.size, settings=settings, background=background)
    return splats, lists, result


@pytest.mark.full
@pytest.mark.parametrize("kind", ["light", "smooth", "low cap"])
@pytest.mark.parametrize("channels", [1, 4, 9])
def test_the_median_is_the_feature_of_the_splat_that_leaves_half(device, kind, channels):
    settings, scene = KINDS[kind], random_scene(300, SIZE, channels=channels)
    splats, lists = scene.upload(device)
    drawn = {"settings": settings, "background": device.array(np.zeros(channels, np.float32))}
    found = rasterize(device, replace(splats, median=True), lists, SIZE, **drawn)
    usual = rasterize(device, splats, lists, SIZE, **drawn)
    for name in ("transmittance", "last"):
        given, wanted = (device.get(getattr(each, name)) for each in (found, usual))
        np.testing.assert_array_equal(given, wanted)
    image, sums = device.get(found.image), device.get(usual.image)
    np.testing.assert_array_equal(image[..., :-1], sums[..., :-1])
    rules = replace(rules_of(settings), median=True)
    screen, features = (array.astype(float) for array in (scene.screen, scene.features))
    wanted, left = raster(screen, features, scene.entries, scene.starts, SIZE, rules)
    # Rounding may put a splat on the other side of a half.
    same = np.isclose(image[..., -1], wanted[..., -1], atol=1e-6)
    assert same.mean() > 0.995
    assert (left < 0.5).mean() > 0.5


def gradient(device, scene, settings, grad_image, grad_transmittance, background=None):
    """The slots, summed for each splat in float64: (N, 6 + D [+ 2])."""
    splats, lists, result = draw(device, scene, settings, background)
    slots = raster_grad(
        device,
        *(splats, lists, result, device.array(grad_image), device.array(grad_transmittance)),
        settings=settings,
        background=None if background is None else device.array(background),
    )
    owner = np.repeat(np.arange(len(scene.screen)), np.diff(scene.slots))
    sums = np.zeros((len(scene.screen), slots.numbers.shape[1]))
    np.add.at(sums, owner, numbers_of(device, slots))
    return sums


def chain(sums, screen):
    """From moments to dL/d(mean x, mean y, a, b, c, weight)."""
    zeroth, x, y, xx, xy, yy = sums[:, :6].T
    a, b, c, weight = screen[:, 2:6].T.astype(float)
    return np.stack([a * x + b * y, b * x + c * y, xx / 2, xy, yy / 2, -zeroth / weight], axis=1)


@pytest.mark.parametrize("channels", [1, 3, 35])
@pytest.mark.parametrize("kind", KINDS)
def test_image_equals_its_twin(device, kind, channels):
    settings = KINDS[kind]
    scene = random_scene(250, SIZE, channels=channels, tile=settings.tile or 16)
    background = np.linspace(0.1, 0.9, channels).astype(np.float32)
    _, _, result = draw(device, scene, settings, background)
    image, transmittance = twin(scene, settings, background)
    np.testing.assert_allclose(device.get(result.image), image, atol=5e-6)
    np.testing.assert_allclose(device.get(result.transmittance), transmittance, atol=2e-6)


@pytest.mark.parametrize("tile", [8, 16, 32])
def test_tile_size_changes_nothing(device, tile):
    scene = random_scene(100, SIZE, tile=tile)
    _, _, result = draw(device, scene, SplatSettings(tile=tile))
    reference = random_scene(100, SIZE, tile=16)
    np.testing.assert_allclose(
        device.get(result.image), twin(reference, SplatSettings())[0], atol=5e-6
    )


def test_nothing_to_draw_shows_the_background(device):
    scene = random_scene(0, SIZE)
    _, _, result = draw(device, scene, SplatSettings(), np.array([0.2, 0.4, 0.6], np.float32))
    image = device.get(result.image)
    np.testing.assert_array_equal(image, np.broadcast_to(np.float32([0.2, 0.4, 0.6]), image.shape))
    assert (device.get(result.transmittance) == 1).all()


@pytest.mark.parametrize("mode", ["light", "xray"])
def test_gradient_equals_finite_differences(device, mode):
    settings = SplatSettings(mode=mode, smooth_cutoff=True)
    scene = random_scene(12, (24, 32), scale=3.0, weights=(0.2, 0.9))
    random = np.random.default_rng(5)
    grad_image = random.normal(size=(24, 32, 3)).astype(np.float32)
    grad_left = random.normal(size=(24, 32)).astype(np.float32) * (mode == "light")
    background = np.float32([0.3, 0.1, 0.7])
    sums = gradient(device, scene, settings, grad_image, grad_left, background)

    def loss(screen, features):
        image, left = twin(scene, settings, background, screen, features)
        return (image * grad_image).sum() + (left * grad_left).sum()

    screen, features = scene.screen.astype(float), scene.features.astype(float)
    expected = np.zeros((12, 6)), np.zeros((12, 3))
    for array, result in zip((screen, features), expected, strict=True):
        for index in np.ndindex(result.shape):
            step = 1e-5 * max(abs(array[index]), 0.1)
            sides = []
            for sign in (1, -1):
                moved = array.copy()
                moved[index] += sign * step
                sides.append(loss(moved, features) if array is screen else loss(screen, moved))
            result[index] = (sides[0] - sides[1]) / (2 * step)
    found = chain(sums, scene.screen)
    for column in range(6):
        scale = np.linalg.norm(expected[0][:, column])
        assert np.linalg.norm(found[:, column] - expected[0][:, column]) < 2e-4 * scale
    np.testing.assert_allclose(sums[:, 6:9], expected[1], rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_gradient_equals_autograd(device, kind):
    torch = pytest.importorskip("torch")
    from twin_raster import raster_torch

    settings = KINDS[kind]
    scene = random_scene(200, SIZE, channels=4, tile=settings.tile or 16)
    random = np.random.default_rng(5)
    grad_image = random.normal(size=(*SIZE, 4)).astype(np.float32)
    grad_left = random.normal(size=SIZE).astype(np.float32) * (settings.mode == "light")
    background = random.uniform(size=4).astype(np.float32)
    sums = gradient(device, scene, settings, grad_image, grad_left, background)
    screen, features = (
        torch.tensor(array, dtype=torch.float64, requires_grad=True)
        for array in (scene.screen, scene.features)
    )
    image, left = raster_torch(scene, screen, features, rules_of(settings), background)
    loss = (image * torch.tensor(grad_image)).sum() + (left * torch.tensor(grad_left)).sum()
    loss.backward()
    expected = screen.grad.numpy()[:, :6]
    found = chain(sums, scene.screen)
    assert np.linalg.norm(found - expected) < 1e-5 * np.linalg.norm(expected)
    assert_each_splat(found, expected)
    assert_each_splat(sums[:, 6:10], features.grad.numpy())


def assert_each_splat(found, expected):
    """The deepest splats keep their digits too, which a global norm would not show."""
    size = np.linalg.norm(expected, axis=1)
    error = np.linalg.norm(found - expected, axis=1)
    told = size > 1e-6 * size.max()
    assert (error[told] < 1e-3 * size[told]).all()


def test_the_deepest_splats_keep_their_digits(device):
    """Forty layers: the last ones are seen through a transmittance of some 1e-3."""
    torch = pytest.importorskip("torch")
    from twin_raster import raster_torch

    settings = SplatSettings()
    scene = random_scene(40, (16, 16), scale=40.0, weights=(0.12, 0.2))
    grad_image = np.random.default_rng(1).normal(size=(16, 16, 3)).astype(np.float32)
    sums = gradient(device, scene, settings, grad_image, np.zeros((16, 16), np.float32))
    screen = torch.tensor(scene.screen, dtype=torch.float64, requires_grad=True)
    features = torch.tensor(scene.features, dtype=torch.float64)
    image, _ = raster_torch(scene, screen, features, rules_of(settings), np.zeros(3))
    (image * torch.tensor(grad_image)).sum().backward()
    found, expected = chain(sums, scene.screen), screen.grad.numpy()[:, :6]
    deepest = np.argsort(scene.depths)[-8:]
    for splat in deepest:
        error = np.linalg.norm(found[splat] - expected[splat])
        assert error < 1e-4 * np.linalg.norm(expected[splat])


def test_absgrad_sums_magnitudes(device):
    scene = random_scene(60, SIZE)
    grad_image = np.random.default_rng(2).normal(size=(*SIZE, 3)).astype(np.float32)
    nothing = np.zeros(SIZE, np.float32)
    plain = gradient(device, scene, SplatSettings(), grad_image, nothing)
    more = gradient(device, scene, SplatSettings(absgrad=True), grad_image, nothing)
    np.testing.assert_allclose(more[:, :9], plain, rtol=1e-5, atol=1e-6)
    means = np.abs(chain(plain, scene.screen)[:, :2])
    assert (more[:, 9:] >= means * (1 - 1e-5) - 1e-6).all()
    assert (more[:, 9:] > 1.5 * means).mean() > 0.5


@pytest.mark.full
@pytest.mark.parametrize("kind", ["light", "xray"])
def test_two_runs_give_the_same_bits(device, kind):
    scene = random_scene(400, SIZE, channels=35)
    grad_image = np.random.default_rng(2).normal(size=(*SIZE, 35)).astype(np.float32)
    runs = [
        gradient(device, scene, KINDS[kind], grad_image, np.ones(SIZE, np.float32))
        for _ in range(3)
    ]
    assert all(np.array_equal(runs[0], run) for run in runs)


def test_capped_alpha_has_no_gradient(device):
    scene = random_scene(1, (16, 16), scale=200.0, weights=(0.9, 0.95))
    settings = SplatSettings(alpha_cap=0.3)
    grad_image = np.ones((16, 16, 3), np.float32)
    sums = gradient(device, scene, settings, grad_image, np.zeros((16, 16), np.float32))
    assert not sums[:, :6].any()
    assert (sums[:, 6:] > 0).all()


def test_alpha_that_just_reaches_its_cap_has_a_gradient(device):
    scene = random_scene(1, (16, 16), scale=200.0, weights=(0.5, 0.5))
    scene.screen[:, :2] = 8.5
    grad_image = np.zeros((16, 16, 3), np.float32)
    grad_image[8, 8] = 1
    # About a half, so that the difference is exact.
    drawn = draw(device, scene, SplatSettings())[2]
    cap = 1 - float(device.get(drawn.transmittance)[8, 8])
    given = SplatSettings(alpha_cap=cap), grad_image, np.zeros((16, 16), np.float32)
    assert gradient(device, scene, *given)[0, 0]


def test_what_does_not_fit_is_told(device):
    scene = random_scene(5, SIZE)
    splats, lists = scene.upload(device)
    with pytest.raises(InputError, match="tile is 12"):
        rasterize(device, splats, lists, SIZE, settings=SplatSettings(tile=12))
    with pytest.raises(ShapeError, match="tiles"):
        rasterize(device, splats, lists, (200, 200), settings=SplatSettings())
    with pytest.raises(ShapeError, match="background"):
        rasterize(device, splats, lists, SIZE, settings=SplatSettings(), background=device.zeros(4))
