"""Everything that a frame can show: features beside colours, depth, several cameras at once."""

import numpy as np
import pytest
from projection_scenes import camera_of, random_splats

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

pytestmark = pytest.mark.dealt

SIZE = (97, 143)


def splats_of(device, count=80, *, sh=True, channels=0):
    values = random_splats(count, coefficients=4, wide=1.5)
    if not sh:
        del values["sh"]
    if channels:
        colors = np.random.default_rng(5).uniform(0, 1, (count, channels))
        values["colors"] = colors.astype(np.float32)
    return Splats.upload(device, **values)


def noise(shape, seed=3):
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def gradients_of(device, found):
    """All gradients that there are, on the host, by name."""
    arrays = {f"splats.{name}": array for name, array in vars(found.splats).items()}
    arrays |= {name: getattr(found, name) for name in ("colors", "sh", "camera", "background")}
    return {name: device.get(array) for name, array in arrays.items() if array is not None}


@pytest.mark.full
def test_features_stand_behind_the_colours_of_harmonics(device):
    renderer, camera = Renderer(device=device), camera_of("pinhole")
    behind = np.linspace(0.1, 0.9, 8).astype(np.float32)
    both = splats_of(device, channels=5)
    together = renderer.forward(both, camera, background=device.array(behind))
    assert together.image.shape == (*SIZE, 8)
    image = device.get(together.image)
    parts = [(splats_of(device), slice(3)), (splats_of(device, sh=False, channels=5), slice(3, 8))]
    for splats, place in parts:
        alone = renderer.forward(splats, camera, background=device.array(behind[place]))
        assert np.array_equal(device.get(alone.image), image[..., place])
    grad = noise(image.shape)
    found = gradients_of(device, renderer.backward(together, device.array(grad)))
    colors = splats_of(device, sh=False, channels=5)
    alone = renderer.forward(colors, camera, background=device.array(behind[3:]))
    own = gradients_of(device, renderer.backward(alone, device.array(grad[..., 3:].copy())))
    assert found["sh"].shape == (80, 4, 3) and np.array_equal(found["colors"], own["colors"])
    np.testing.assert_allclose(found["background"][3:], own["background"], rtol=1e-6)


@pytest.mark.parametrize("channels", [0, 2, 40])
def test_depth_is_the_last_channel(device, channels):
    renderer, camera = Renderer(device=device), camera_of("pinhole")
    splats = splats_of(device, sh=False, channels=channels)
    behind = device.array(np.full(channels, 0.5)) if channels else None
    deep = renderer.forward(splats, camera, depth="accumulated", background=behind)
    expected = renderer.forward(splats, camera, depth="expected", background=behind)
    image, quotient = device.get(deep.image), device.get(expected.image)
    assert image.shape == (*SIZE, channels + 1)
    assert np.array_equal(image[..., :-1], quotient[..., :-1])
    alpha = 1 - device.get(deep.transmittance)
    held = np.maximum(alpha, np.float32(1e-10))
    np.testing.assert_allclose(quotient[..., -1], image[..., -1] / held, rtol=1e-6)
    depths = device.get(deep.projection.depths)
    seen = alpha > 0.5
    assert seen.sum() > 100
    nearest, farthest = depths[depths > 0].min(), depths.max()
    inside = (quotient[..., -1] > nearest * 0.999) & (quotient[..., -1] < farthest * 1.001)
    assert inside[seen].all()


def test_behind_a_fisheye_the_nearer_splat_hides_the_other(device):
    """At 120 degrees from its axis, where z falls with the distance."""
    camera = Camera((40, 80), [[18, 0, 40], [0, 18, 20], [0, 0, 1]], np.eye(4), "fisheye")
    way = np.array([np.sin(2 * np.pi / 3), 0, np.cos(2 * np.pi / 3)])
    splats = Splats.upload(
        device,
        means=[3 * way, 2 * way],
        quats=np.tile([1.0, 0, 0, 0], (2, 1)),
        scales=np.full((2, 3), 0.3),
        opacities=[0.9, 0.9],
        colors=np.eye(2),
    )
    frame = Renderer(device=device).forward(splats, camera, depth="median")
    at = device.get(frame.image)[20, round(40 + 18 * 2 * np.pi / 3)]
    assert at[1] > 0.8 and at[0] < 0.15
    assert at[2] == pytest.approx(2.0, rel=1e-5)


def test_depth_of_one_splat_is_its_own(device):
    splats = Splats.upload(
        device, means=[[0, 0, 0.5]], quats=[[1, 0, 0, 0]], scales=[[1, 1, 1]], opacities=[0.9]
    )
    frame = Renderer(device=device).forward(splats, camera_of("pinhole"), depth="expected")
    depth, alpha = device.get(frame.image)[..., 0], 1 - device.get(frame.transmittance)
    wanted = device.get(frame.projection.depths)[0]
    np.testing.assert_allclose(depth[alpha > 0.01], wanted, rtol=1e-4)
    assert not depth[alpha == 0].any()


@pytest.mark.parametrize("modes", [0, 9])
@pytest.mark.parametrize(("opacity", "wanted"), [(0.3, 4.0), (0.7, 2.0)])
def test_median_depth_is_that_of_what_hides_half(device, modes, opacity, wanted):
    """Two walls, at 2 and at 4 from the camera, of which the farther one is opaque."""
    given = {"means": [[0, 0, 2], [0, 0, 4]], "quats": [[1, 0, 0, 0]] * 2}
    given |= {"scales": [[9, 9, 0.01], [18, 18, 0.01]], "opacities": [opacity, 0.99]}
    if modes:
        given["shape_modes"] = np.zeros((2, modes))
    camera = Camera((24, 32), [[30, 0, 16], [0, 30, 12], [0, 0, 1]], np.eye(4))
    renderer, splats = Renderer(device=device), Splats.upload(device, **given, colors=np.eye(2))
    frame = renderer.forward(splats, camera, depth="median")
    image = device.get(frame.image)
    assert image.shape == (24, 32, 3)
    np.testing.assert_allclose(image[..., 2], wanted, rtol=1e-6)
    usual = device.get(renderer.forward(splats, camera, depth="expected").image)
    assert np.array_equal(image[..., :2], usual[..., :2])
    assert ((usual[..., 2] > 2.5) & (usual[..., 2] < 3.5)).all()
    with pytest.raises(InputError, match="no gradient"):
        renderer.backward(frame, frame.image)


@pytest.mark.full
def test_gradient_of_expected_depth_is_the_quotients(device):
    """dL/dD = g / alpha and dL/dT = g E / alpha: with them the accumulated depth's gradient."""
    renderer, camera = Renderer(device=device), camera_of("pinhole")
    splats = splats_of(device, channels=0)
    grad, by_thin = noise((*SIZE, 4)), noise(SIZE, 4)
    expected = renderer.forward(splats, camera, depth="expected")
    arrays = device.array(grad), device.array(by_thin)
    found = gradients_of(device, renderer.backward(expected, *arrays, with_camera=True))
    deep = renderer.forward(splats, camera, depth="accumulated")
    alpha = 1 - device.get(deep.transmittance)
    seen = alpha > 1e-10
    share = grad[..., 3] / np.maximum(alpha, np.float32(1e-10))
    by_thin = by_thin + np.where(seen, share * device.get(expected.image)[..., 3], 0)
    grad[..., 3] = share
    arrays = device.array(grad), device.array(by_thin)
    wanted = gradients_of(device, renderer.backward(deep, *arrays, with_camera=True))
    for name, gradient in found.items():
        error = np.linalg.norm(gradient - wanted[name]) / np.linalg.norm(wanted[name])
        assert error < 1e-5, name


@pytest.mark.full
def test_depth_gradient_is_that_of_differences(device):
    """Through the smooth cut-off, along the camera's axis, in float32 and so to some digits."""
    renderer = Renderer(SplatSettings(smooth_cutoff=True), device=device)
    camera, values = camera_of("pinhole"), random_splats(40, wide=1.0)
    del values["sh"]
    # Splats many pixels wide, over which float32 differences are smooth.
    values["scales"] = np.maximum(values["scales"], 0.1)
    weights = noise((*SIZE, 1))

    def loss(shift):
        moved = values | {"means": values["means"] + np.float32(shift) * way}
        frame = renderer.forward(Splats.upload(device, **moved), camera, depth="accumulated")
        return frame, float((device.get(frame.image).astype(float) * weights).sum())

    way = noise((40, 3), 7)
    frame, _ = loss(0)
    found = renderer.backward(frame, device.array(weights))
    slope = float((device.get(found.splats.means) * way).sum())
    step = 2e-4
    difference = (loss(step)[1] - loss(-step)[1]) / (2 * step)
    assert difference == pytest.approx(slope, rel=2e-2, abs=1.0)


def test_what_cannot_be_drawn_is_named(device):
    renderer, camera = Renderer(device=device), camera_of("pinhole")
    splats = splats_of(device)
    with pytest.raises(InputError, match="depth is 'far'"):
        renderer.forward(splats, camera, depth="far")
    xray = Renderer(SplatSettings(mode="xray"), device=device)
    with pytest.raises(InputError, match="xray"):
        xray.forward(splats, camera, depth="expected")
    with pytest.raises(ShapeError, match="background has shape"):
        renderer.forward(splats, camera, depth="expected", background=device.zeros(4))
    frame = renderer.forward(splats, camera)
    with pytest.raises(ShapeError, match="grad_image has shape"):
        renderer.backward(frame, device.zeros((3, 3, 3)))
