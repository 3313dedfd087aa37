"""From parameters to pixels and back, the whole way at once: against float64 autograd."""

from dataclasses import dataclass

import numpy as np
import pytest
from projection_scenes import camera_of, random_splats

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.reference.splat_raster import Rules
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats
from rift_cl.splat.tile_lists import Tiles

pytestmark = pytest.mark.dealt

SIZE = (45, 61)
BACKGROUND = np.float32([0.2, 0.5, 0.9])
WAYS = {
    "light": ("pinhole", SplatSettings(smooth_cutoff=True)),
    "antialiased": ("pinhole", SplatSettings(smooth_cutoff=True, antialiased=True)),
    "fisheye": ("fisheye", SplatSettings(smooth_cutoff=True)),
    "ortho": ("ortho", SplatSettings(smooth_cutoff=True)),
    "xray, cone": ("pinhole", SplatSettings(smooth_cutoff=True, mode="xray")),
    "xray, parallel": ("ortho", SplatSettings(smooth_cutoff=True, mode="xray")),
}


@dataclass(frozen=True)
class Lists:
    """A frame's tile lists as the torch twin of the raster takes them."""

    entries: np.ndarray
    starts: np.ndarray
    tiles: Tiles
    size: tuple[int, int]


def small_camera(model):
    focal = {"pinhole": 60.0, "ortho": 16.0, "fisheye": 50.0}[model]
    full = camera_of(model, focal=focal)
    K = full.K.copy()
    K[:2, 2] = 30.3, 22.7
    return rift.Camera(SIZE, K, full.view, model)


def draw(device, way, values):
    model, settings = WAYS[way]
    renderer = Renderer(settings, device=device)
    splats = Splats.upload(device, **values)
    frame = renderer.forward(splats, small_camera(model), background=device.array(BACKGROUND))
    return renderer, frame


def oracle(way, values, frame, device, grad_image):
    """Image and gradients in torch, with the device's own tile lists."""
    import torch
    import twin_projection as twin
    from twin_raster import raster_torch

    _, settings = WAYS[way]
    leaves = {n: torch.tensor(v.astype(float), requires_grad=True) for n, v in values.items()}
    view = torch.tensor(frame.camera.view[:3], requires_grad=True)
    lens = torch.tensor(frame.camera.intrinsics, dtype=torch.float64, requires_grad=True)
    covars = twin.covariance(leaves["quats"], leaves["scales"])
    pixels, conics, weights, _ = twin.screen(
        *(leaves["means"], covars, leaves["opacities"], view, lens),
        camera=frame.camera,
        settings=settings,
    )
    parts = (pixels, conics[:, 0, :], conics[:, 1, 1:], weights[:, None])
    screen = torch.cat(parts, 1)
    colors = twin.shade(leaves["means"], leaves["sh"], view, frame.camera.model)
    lists = Lists(
        device.get(frame.lists.entries),
        device.get(frame.lists.starts),
        frame.lists.tiles,
        SIZE,
    )
    rules = Rules(settings.tile or 16, settings.alpha_cap, settings.mode == "xray", smooth=True)
    image, _ = raster_torch(lists, screen, colors, rules, BACKGROUND)
    (image * torch.tensor(grad_image)).sum().backward()
    gradients = {name: leaf.grad.numpy() for name, leaf in leaves.items()}
    gradients["camera"] = np.concatenate([view.grad.numpy().ravel(), lens.grad.numpy()])
    return image.detach().numpy(), gradients


@pytest.mark.parametrize("way", WAYS)
def test_image_and_every_gradient_equal_autograd(device, way):
    pytest.importorskip("torch")
    values = random_splats(60, coefficients=9, wide=1.2)
    values["opacities"] = np.clip(values["opacities"], 0.05, 0.9)
    renderer, frame = draw(device, way, values)
    assert renderer.culled(frame) == {"visible": 60}
    grad_image = np.random.default_rng(3).normal(size=(*SIZE, 3)).astype(np.float32)
    image, expected = oracle(way, values, frame, device, grad_image)
    found = renderer.backward(frame, device.array(grad_image), with_camera=True)
    assert relative(device.get(frame.image), image) < 1e-5
    for name in ("means", "quats", "scales", "opacities"):
        assert relative(device.get(getattr(found.splats, name)), expected[name]) < 1e-4, name
    assert relative(device.get(found.sh), expected["sh"]) < 1e-4
    assert relative(device.get(found.camera), expected["camera"]) < 1e-4


def relative(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


@pytest.mark.full
def test_background_gradient_is_what_is_seen_of_it(device):
    renderer, frame = draw(device, "light", random_splats(60, coefficients=4))
    grad_image = np.random.default_rng(3).normal(size=(*SIZE, 3)).astype(np.float32)
    found = renderer.backward(frame, device.array(grad_image))
    expected = (device.get(frame.transmittance)[..., None].astype(float) * grad_image).sum((0, 1))
    np.testing.assert_allclose(device.get(found.background), expected, rtol=1e-4, atol=1e-4)
    assert found.camera is None


def test_two_runs_give_the_same_bits(device):
    values = random_splats(300)
    grad_image = device.array(np.random.default_rng(3).normal(size=(*SIZE, 3)))
    runs = []
    for _ in range(2):
        renderer, frame = draw(device, "light", values)
        found = renderer.backward(frame, grad_image, with_camera=True)
        arrays = (frame.image, found.sh, found.camera, found.splats.means, found.splats.quats)
        runs.append([device.get(array) for array in arrays])
    assert all(np.array_equal(a, b) for a, b in zip(*runs, strict=True))


def test_xray_of_a_splat_is_its_mass(device):
    """A parallel beam through one Gaussian: the image adds up to the integral of its density."""
    splats = Splats.upload(
        device,
        means=[[0.1, -0.2, 0.3]],
        quats=[[0.9, 0.1, -0.3, 0.2]],
        scales=[[0.3, 0.2, 0.4]],
        opacities=[0.7],
        colors=[[1.0]],
    )
    renderer = Renderer(SplatSettings(mode="xray"), device=device)
    frame = renderer.forward(splats, camera_of("ortho"))
    fx, fy, *_ = frame.camera.intrinsics
    mass = 0.7 * (2 * np.pi) ** 1.5 * 0.3 * 0.2 * 0.4
    # Four standard deviations leave out 0.034 %.
    assert device.get(frame.image).sum() / (fx * fy) == pytest.approx(
        mass * (1 - np.exp(-8)), rel=4e-4
    )


def test_splats_that_cannot_be_drawn_are_counted(device):
    values = random_splats(6)
    values["means"][0] = np.nan
    values["opacities"][1] = 1e-3
    values["scales"][2] = 0
    renderer, frame = draw(device, "light", values)
    culled = renderer.culled(frame)
    assert culled["not finite or degenerate"] == 2
    assert culled["too faint"] == 1
    assert np.isfinite(device.get(frame.image)).all()


def test_no_splats_show_the_background(device):
    renderer, frame = draw(device, "light", {n: v[:0] for n, v in random_splats(3).items()})
    image = device.get(frame.image)
    np.testing.assert_array_equal(image, np.broadcast_to(BACKGROUND, image.shape))
    found = renderer.backward(frame, device.array(image), with_camera=True)
    assert not device.get(found.camera).any()


def test_splats_without_colour_are_refused(device):
    values = random_splats(3)
    del values["sh"]
    with pytest.raises(InputError, match=r"neither|no spherical"):
        draw(device, "light", values)


@pytest.mark.full
@pytest.mark.parametrize("channels", [1, 4, 7])
def test_background_gradient_takes_any_channels_and_odd_sizes(device, channels):
    values = random_splats(40) | {"sh": None}
    values["colors"] = np.random.default_rng(1).random((40, channels)).astype(np.float32)
    random = np.random.default_rng(2)
    background = device.array(random.random(channels))
    renderer = Renderer(device=device)
    for size in ((1, 1), (3, 7), (37, 61)):
        camera, splats = camera_of("pinhole", size=size), Splats.upload(device, **values)
        frame = renderer.forward(splats, camera, background=background)
        grad_image = random.normal(size=(*size, channels)).astype(np.float32)
        found = renderer.backward(frame, device.array(grad_image))
        left = device.get(frame.transmittance)[..., None].astype(float)
        expected = (left * grad_image).sum((0, 1))
        np.testing.assert_allclose(device.get(found.background), expected, rtol=1e-4, atol=1e-4)
