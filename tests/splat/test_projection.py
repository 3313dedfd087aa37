"""Projection: against its twin, against quadrature, and where rounding would spoil it."""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import (
    KINDS,
    Kind,
    all_round,
    changed,
    plain,
    projected_on,
    random_splats,
    twin_of,
)

from rift_cl.reference.splat_projection import covariances
from rift_cl.splat.settings import SplatSettings

pytestmark = pytest.mark.dealt


def close_calls(twin, kind):
    """Splats for which rounding decides a radius, a tile or a cull."""

    def whole(x):
        return np.abs(x - np.round(x)).min(axis=1) < 1e-4

    size = np.array([kind.camera.width, kind.camera.height])
    edges = np.concatenate([twin.means - twin.radii, twin.means + twin.radii], axis=1)
    on_border = np.abs(edges - np.concatenate([size, 0 * size])).min(axis=1) < 1e-3
    faint = np.abs(twin.weights * 255 - 1) < 1e-4
    return whole(twin.extents) | whole(edges / (kind.settings.tile or 16)) | on_border | faint


def test_a_fisheye_sees_beyond_a_quarter_turn_from_its_axis(device):
    kind = Kind("fisheye", focal=22.0)
    values = all_round(kind.camera)
    twin, found = twin_of(values, kind), projected_on(device, values, kind)
    sure = ~close_calls(twin, kind)
    np.testing.assert_array_equal(found["culled"][sure], twin.culled[sure])
    drawn = (found["culled"] == 0) & (twin.culled == 0)
    assert drawn[:60].sum() > 40 and drawn[-60:].sum() > 40
    away = np.linalg.norm(values["means"] - kind.camera.center, axis=1)
    np.testing.assert_allclose(found["depths"][drawn], away[drawn], rtol=1e-5)
    np.testing.assert_allclose(found["screen"][drawn, :2], twin.means[drawn], rtol=0, atol=2e-3)
    conics = twin.conics[drawn]
    error = np.linalg.norm(found["screen"][drawn, 2:5] - conics, axis=1)
    assert (error < 1e-4 * np.linalg.norm(conics, axis=1)).all()


@pytest.mark.parametrize("name", KINDS)
def test_screen_is_the_twins(device, name):
    kind = KINDS[name]
    values = random_splats()
    twin, found = twin_of(values, kind), projected_on(device, values, kind)
    drawn = (found["culled"] == 0) & (twin.culled == 0)
    assert 300 < drawn.sum() < 400, "some are seen, some are not"
    screen = found["screen"][drawn].astype(float)
    # A float32 determinant of a covariance that was given has lost digits already.
    loose = 20 if kind.covars else 1
    np.testing.assert_allclose(screen[:, :2], twin.means[drawn], rtol=0, atol=1e-5 * 143)
    conics = twin.conics[drawn]
    error = np.linalg.norm(screen[:, 2:5] - conics, axis=1) / np.linalg.norm(conics, axis=1)
    assert error.max() < 1e-5 * loose
    np.testing.assert_allclose(screen[:, 5], twin.weights[drawn], rtol=1e-5 * loose)
    np.testing.assert_allclose(screen[:, 6:], twin.extents[drawn], rtol=1e-5 * loose)
    np.testing.assert_allclose(found["depths"][drawn], twin.depths[drawn], rtol=1e-6)


@pytest.mark.parametrize("name", KINDS)
def test_rectangles_and_culls_are_the_twins(device, name):
    kind = KINDS[name]
    values = random_splats(800, seed=3)
    twin, found = twin_of(values, kind), projected_on(device, values, kind)
    clear = ~close_calls(twin, kind)
    assert clear.mean() > 0.97
    np.testing.assert_array_equal(found["culled"][clear], twin.culled[clear])
    np.testing.assert_array_equal(found["boxes"][clear], twin.boxes[clear])
    drawn = clear & (twin.culled == 0)
    np.testing.assert_array_equal(found["radii"][drawn], twin.radii[drawn])
    for array in ("screen", "depths", "boxes"):
        assert not found[array][found["culled"] > 0].any(), array


@pytest.mark.parametrize(
    "kind",
    [changed(tile=8), changed(tile=7, radius_clip=6), changed(near=4.2, far=5.1), changed(eps2d=0)],
    ids=str,
)
def test_other_settings_are_the_twins(device, kind):
    values = random_splats(seed=4)
    values["scales"] = np.maximum(values["scales"], 0.02)
    twin, found = twin_of(values, kind), projected_on(device, values, kind)
    clear = ~close_calls(twin, kind)
    np.testing.assert_array_equal(found["culled"][clear], twin.culled[clear])
    np.testing.assert_array_equal(found["boxes"][clear], twin.boxes[clear])


def test_smooth_cut_off_reaches_as_far_for_faint_splats(device):
    values = plain(opacities=[0.01])
    twin = twin_of(values, Kind())
    wanted = np.ceil(3.33 * np.sqrt(twin.covars[0, [0, 1], [0, 1]]))
    assert projected_on(device, values, changed(smooth_cutoff=True))["radii"].tolist() == [
        wanted.tolist()
    ]
    assert (projected_on(device, values, Kind())["radii"][0] < wanted).all()


@pytest.mark.parametrize("model", ["pinhole", "ortho"])
def test_line_integral_is_that_of_quadrature(device, model):
    kind = Kind(model, settings=SplatSettings(mode="xray", eps2d=1e-6))
    values = random_splats(40, seed=8, wide=1.0)
    values["scales"] = np.maximum(values["scales"], 0.03)
    found = projected_on(device, values, kind)
    drawn = np.flatnonzero(found["culled"] == 0)
    assert len(drawn) > 30
    twin = twin_of(values, kind)
    rotation = kind.camera.view[:3, :3]
    points = values["means"] @ rotation.T + kind.camera.view[:3, 3]
    steps = np.linspace(-3, 3, 4001)
    for i in drawn:
        ray = np.array([0, 0, 1]) if model == "ortho" else points[i] / np.linalg.norm(points[i])
        away = steps[:, None] * (rotation.T @ ray)
        covar = covariance_of(values, i)
        density = np.exp(-0.5 * np.einsum("si,ij,sj->s", away, np.linalg.inv(covar), away))
        integral = values["opacities"][i] * density.sum() * (steps[1] - steps[0])
        assert found["screen"][i, 5] == pytest.approx(integral, rel=2e-4)
    assert np.abs(twin.means[drawn] - (71.5, 48.5)).max() > 20, "some are far off the axis"


def covariance_of(values, i):
    one = slice(i, i + 1)
    return covariances(values["quats"][one].astype(float), values["scales"][one].astype(float))[0]


def mass(found):
    """Integral over the screen of what a splat adds."""
    a, b, c, weight = found["screen"].astype(float)[:, 2:6].T
    return 2 * np.pi * weight / np.sqrt(a * c - b * b)


def test_mass_on_the_screen_is_that_of_quadrature_whatever_the_dilation(device):
    values = plain(means=[[0.9, -0.4, 0.3]], scales=[[0.02, 0.05, 0.03]], quats=[[1, 0.4, 0.3, 2]])
    masses = [
        mass(projected_on(device, values, changed(mode="xray", eps2d=eps)))[0]
        for eps in (0.01, 0.3, 5)
    ]
    np.testing.assert_allclose(masses, masses[0], rtol=1e-5)
    camera = Kind().camera
    fx, fy, cx, cy = camera.intrinsics
    point = camera.view[:3, :3] @ values["means"][0] + camera.view[:3, 3]
    center = np.array([fx * point[0] / point[2] + cx, fy * point[1] / point[2] + cy])
    offsets, depths = np.linspace(-12, 12, 97), np.linspace(-0.4, 0.4, 201)
    u, v = np.meshgrid(center[0] + offsets, center[1] + offsets)
    rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], -1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    middle = rays @ point
    away = (middle[..., None] + depths)[..., None] * rays[:, :, None] - point
    inverse = np.linalg.inv(camera.view[:3, :3] @ covariance_of(values, 0) @ camera.view[:3, :3].T)
    density = np.exp(-0.5 * np.einsum("uvsi,ij,uvsj->uvs", away, inverse, away, optimize=True))
    cell = (offsets[1] - offsets[0]) ** 2 * (depths[1] - depths[0])
    # What is left is the bend of perspective across the splat.
    assert masses[0] == pytest.approx(0.5 * density.sum() * cell, rel=2e-3)


def test_needle_keeps_its_digits(device):
    """A covariance's determinant would be rounding alone where a needle lies slantwise."""
    values = random_splats(200, seed=6, wide=0.5)
    values["scales"] = np.tile(np.float32([1.0, 1e-3, 1e-3]), (200, 1))
    kind = changed(antialiased=True)
    twin, found = twin_of(values, kind), projected_on(device, values, kind)
    drawn = (found["culled"] == 0) & (twin.factors > 0.006)
    assert drawn.sum() > 100
    np.testing.assert_allclose(found["screen"][drawn, 5], twin.weights[drawn], rtol=2e-4)


def test_only_the_direction_of_a_quaternion_counts(device):
    values = random_splats(50)
    screen = projected_on(device, values, Kind())["screen"]
    for factor in (-1, 1e-20, 1e20):
        other = projected_on(
            device, values | {"quats": np.float32(factor) * values["quats"]}, Kind()
        )
        np.testing.assert_allclose(other["screen"], screen, rtol=1e-4, atol=1e-4)


def test_two_runs_give_the_same_bits(device):
    values = random_splats()
    first, second = (projected_on(device, values, Kind()) for _ in range(2))
    for name, array in first.items():
        assert array.tobytes() == second[name].tobytes(), name


def test_no_splats_at_all(device):
    found = projected_on(
        device, {name: value[:0] for name, value in random_splats(1).items()}, Kind()
    )
    assert [found[name].shape for name in ("screen", "boxes", "depths", "culled")] == [
        (0, 8), (0, 4), (0,), (0,)
    ]  # fmt: skip
