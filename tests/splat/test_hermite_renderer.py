"""Splats with Hermite modes, drawn: laws that hold whatever the code."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hermite_frames import SIZE, camera, drawn, few, image
from projection_scenes import random_splats, turned

from rift_cl.basis.projection import gamma_matrix
from rift_cl.reference.hermite_projection import splat_roots
from rift_cl.splat.orders import order_of
from rift_cl.splat.raster_pass import draw

pytestmark = pytest.mark.dealt


def same_but_for_thresholds(found, right):
    """A pixel here and there has a splat more or less of 1/255, as rounding has it."""
    away = np.abs(found - right).max(axis=-1)
    assert (away < 2e-5).mean() > 0.99
    assert away.max() < 2 / 255


@pytest.mark.parametrize("mode", ["light", "xray"])
def test_modes_that_are_zero_change_nothing(device, mode):
    values = random_splats(40, coefficients=4, wide=1.0)
    zero = values | {"shape_modes": np.zeros((40, 9)), "color_modes": np.zeros((40, 3, 3))}
    right, found = (image(device, v, mode=mode) for v in (values, zero))
    if mode == "light":
        same_but_for_thresholds(found, right)
    else:
        # Modes make line integrals reach farther; what lies there is less than this of a peak.
        assert np.abs(found - right).max() < 5e-4 * np.abs(right).max()


@pytest.mark.full
@pytest.mark.parametrize("mode", ["light", "xray"])
def test_gradients_of_modes_that_are_zero_are_those_of_gaussians(device, mode):
    values = random_splats(40, coefficients=4, wide=1.0)
    zero = values | {"shape_modes": np.zeros((40, 3))}
    coming = np.random.default_rng(0).normal(size=(*SIZE, 3)).astype(np.float32)
    both = []
    for given in (values, zero):
        renderer, frame = drawn(device, given, mode=mode)
        found = renderer.backward(frame, device.array(coming), with_camera=True)
        arrays = [found.splats.means, found.splats.scales, found.splats.quats, found.sh]
        both.append([device.get(a) for a in (*arrays, found.splats.opacities, found.camera)])
    for plain, modal in zip(*both, strict=True):
        assert np.linalg.norm(plain - modal) < 5e-3 * np.linalg.norm(plain)


@pytest.mark.parametrize("activation", ["clamp", "exp", "square"])
def test_turning_splats_and_camera_together_changes_nothing(device, activation):
    values, turn = few(), turned(11)
    view = camera().view.copy()
    view[:3, :3] = view[:3, :3] @ turn.T
    # Colours turn with the camera only where they do not depend on the direction.
    values["sh"] = values["sh"][:, :1]
    moved = values | {
        "means": values["means"] @ turn.T,
        "quats": quaternions(turn @ rotations(values["quats"])),
    }
    right = image(device, values, activation=activation)
    same_but_for_thresholds(image(device, moved, activation=activation, view=view), right)


def rotations(quats):
    return splat_roots(quats.astype(float), np.ones((len(quats), 3)))


def quaternions(matrices):
    """Quaternions (w, x, y, z) of rotations, as eigenvectors (Bar-Itzhack 2000)."""
    m = matrices
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    K = np.zeros((len(m), 4, 4))
    K[:, 0, 0] = trace
    axis = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], 1)
    K[:, 0, 1:] = K[:, 1:, 0] = axis
    K[:, 1:, 1:] = m + m.transpose(0, 2, 1) - trace[:, None, None] * np.eye(3)
    return np.linalg.eigh(K)[1][:, :, -1]


@pytest.mark.full
def test_modes_of_a_ball_may_be_written_in_any_frame(device):
    """Turning a ball's frame and its coefficients the other way leaves the density as it was."""
    values, turn = few(20, shape=3, color=0), turned(7)
    values["scales"][:] = values["scales"][:, :1]
    frames = rotations(values["quats"])
    power = gamma_matrix(turn.T, 3)[1:, 1:]
    moved = values | {
        "quats": quaternions(frames @ turn),
        "shape_modes": values["shape_modes"] @ power.T,
    }
    same_but_for_thresholds(image(device, moved), image(device, values))


@pytest.mark.full
@pytest.mark.parametrize("eps2d", [0.0, 1.5])
def test_line_integrals_are_those_of_quadrature(device, eps2d):
    """Through the density in space; dilation is a convolution of the picture with a Gaussian."""
    values = few(6, shape=3, color=0)
    values["scales"] = np.maximum(values["scales"], 0.1)
    settings = {"mode": "xray", "eps2d": eps2d, "smooth_cutoff": True}
    values = {n: v for n, v in values.items() if n != "sh"} | {"colors": np.ones((6, 1))}
    found = image(device, values, model="ortho", **settings)[..., 0]
    view = camera("ortho")
    random = np.random.default_rng(4)
    bright = np.argwhere(np.abs(found) > 0.1 * np.abs(found).max())
    pixels = np.concatenate([random.choice(bright, 15), random.integers(6, 42, (5, 2))])[:, ::-1]
    at, share = np.polynomial.hermite_e.hermegauss(10 if eps2d else 1)
    offsets = np.sqrt(eps2d) * np.stack(np.meshgrid(at, at), -1).reshape(-1, 2)
    shares = np.outer(share, share).ravel() / share.sum() ** 2
    right = [shares @ integrals(values, view, pixel + 0.5 + offsets) for pixel in pixels]
    mine = found[pixels[:, 1], pixels[:, 0]]
    assert np.abs(mine - right).max() < 1e-4 * np.abs(found).max()


def integrals(values, view, places):
    """Line integrals along the camera's axis through (P, 2) places on the screen."""
    fx, fy, cx, cy = view.intrinsics
    depths = np.linspace(2, 6, 301)
    across = (places - (cx, cy)) / (fx, fy)
    points = np.empty((len(places), depths.size, 3))
    points[..., :2], points[..., 2] = across[:, None], depths
    world = (points - view.view[:3, 3]) @ view.view[:3, :3]
    density = np.zeros(points.shape[:2])
    roots = splat_roots(values["quats"].astype(float), values["scales"].astype(float))
    given = zip(roots, values["means"], values["opacities"], values["shape_modes"], strict=True)
    for root, mean, opacity, modes in given:
        own = (world - mean) @ np.linalg.inv(root).T
        density += opacity * polynomial(own, modes) * np.exp(-(own**2).sum(-1) / 2)
    return density.sum(axis=1) * (depths[1] - depths[0])


def polynomial(x, modes):
    """1 + the sum of modes, written out from the definition."""
    he = [np.ones_like(x), x, (x**2 - 1) / np.sqrt(2), (x**3 - 3 * x) / np.sqrt(6)]
    order = order_of(len(modes) + 1)
    triples = [
        (i, n - i - k, k)
        for n in range(1, order + 1)
        for i in range(n, -1, -1)
        for k in range(n - i + 1)
    ]
    value = np.ones(x.shape[:-1])
    for (i, j, k), c in zip(triples, modes, strict=True):
        value += c * he[i][..., 0] * he[j][..., 1] * he[k][..., 2]
    return value


@pytest.mark.full
def test_modes_add_no_mass_to_a_picture_of_line_integrals(device):
    values = few(6, shape=4, color=0)
    values["means"] *= 0.3
    values["scales"] = np.clip(values["scales"], 0.08, 0.2)
    plain = {name: value for name, value in values.items() if name != "shape_modes"}
    plain["shape_modes"] = np.zeros((6, 3), np.float32)
    options = {"mode": "xray", "model": "ortho", "smooth_cutoff": True}
    right, found = (image(device, v, **options) for v in (plain, values))
    assert np.abs(found - right).max() > 0.1 * np.abs(right).max()
    np.testing.assert_allclose(found.sum((0, 1)), right.sum((0, 1)), rtol=1e-4)


@pytest.mark.full
def test_what_lies_beyond_a_splats_rectangle_is_not_seen(device):
    """With extents at six standard deviations the picture is the same: the bound is one."""
    values = few(60, shape=4, color=0, strength=1.0)
    renderer, frame = drawn(device, values)
    wide = device.get(frame.projection.screen)
    g = gaussian_reach(wide)
    edge = np.floor((wide[:, :2] + 6 * g) / 16 + 1), np.floor((wide[:, :2] - 6 * g) / 16)
    boxes = np.concatenate([edge[1], edge[0]], axis=1)
    boxes = np.clip(boxes, 0, [4, 3, 4, 3]).astype(np.int32)
    boxes[device.get(frame.projection.culled) > 0] = 0
    wide[:, 6:] = 6 * g
    again = draw(
        device,
        dataclasses.replace(frame.raster_pass.screen, screen=device.array(wide)),
        *(device.array(boxes, np.int32), frame.projection.depths, SIZE),
        settings=renderer.settings,
        memory=frame.raster_pass.memory,
    )
    assert (wide[:, 6:] >= device.get(frame.projection.screen)[:, 6:]).all()
    away = np.abs(device.get(again.raster.image) - device.get(frame.image))
    assert away.max() < 1e-6


def gaussian_reach(screen):
    """Standard deviations along x and y."""
    a, b, c = screen[:, 2:5].astype(float).T
    with np.errstate(all="ignore"):
        return np.nan_to_num(np.sqrt(np.stack([c, a], 1) / (a * c - b * b)[:, None]))
