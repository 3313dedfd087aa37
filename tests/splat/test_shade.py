"""Colours by spherical harmonics: against the twin, and what becomes of odd ones."""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import Kind, camera_of, random_splats, upload

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.reference.splat_projection import shade_splats, spherical_harmonics
from rift_cl.splat.features import shade, shade_grad
from rift_cl.splat.projection import project, project_grad
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

COEFFICIENTS = (1, 4, 9, 16, 25)


def colors_of(device, values, kind=None):
    """Colours on the device, and which splats are drawn."""
    kind = kind or Kind()
    splats = upload(device, values, kind)
    projected = project(device, splats, kind.camera, kind.settings)
    colors = shade(device, splats.means, splats.sh, kind.camera, projected.culled)
    return device.get(colors), device.get(projected.culled) == 0


@pytest.mark.parametrize(
    ("coefficients", "model"), [*((count, "pinhole") for count in COEFFICIENTS), (16, "ortho")]
)
def test_colors_are_the_twins(device, coefficients, model):
    values, kind = random_splats(coefficients=coefficients), Kind(model)
    colors, drawn = colors_of(device, values, kind)
    twin = shade_splats(values["means"].astype(float), values["sh"].astype(float), kind.camera)
    held = (twin[drawn] == 0).mean()
    assert held < 0.3 and (held > 0.01 or coefficients == 1), "some are held at zero, not most"
    np.testing.assert_allclose(colors[drawn], twin[drawn], rtol=1e-5, atol=3e-6)
    assert not colors[~drawn].any()


def test_parallel_rays_see_the_same_colors_from_any_distance(device):
    """Those of the camera's axis, to the bit, wherever along it or beside it the camera stands."""
    values = random_splats(30, coefficients=16)
    splats, drawn = upload(device, values, Kind("ortho")), device.array(np.zeros(30, np.uint8))
    near = camera_of("ortho")
    view = near.view.copy()
    view[:3, 3] += 0.5, -2, 1000
    far = Camera(near.size, near.K, view, "ortho")
    colors = [shade(device, splats.means, splats.sh, camera, drawn) for camera in (near, far)]
    np.testing.assert_array_equal(*map(device.get, colors))
    basis = spherical_harmonics(near.view[2:3, :3], 3)
    wanted = np.maximum(np.einsum("k,nkc->nc", basis[0], values["sh"]) + 0.5, 0)
    np.testing.assert_allclose(device.get(colors[0]), wanted, rtol=1e-5, atol=3e-6)


def test_functions_of_the_twin_are_orthonormal():
    """The oracle itself: products of two functions integrate to one or zero over the sphere."""
    z, weights = np.polynomial.legendre.leggauss(12)
    azimuth = np.linspace(0, 2 * np.pi, 24, endpoint=False) + 0.1
    z, azimuth = (a.ravel() for a in np.meshgrid(z, azimuth, indexing="ij"))
    ring = np.sqrt(1 - z**2)
    points = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], 1)
    values = spherical_harmonics(points, 4)
    gram = (values * np.repeat(weights, 24)[:, None] * 2 * np.pi / 24).T @ values
    np.testing.assert_allclose(gram, np.eye(25), atol=1e-12)


def test_signs_are_those_of_the_first_paper():
    first = spherical_harmonics(np.array([[0.36, 0.48, 0.8]]), 2)[0]
    x, y, z = 0.36, 0.48, 0.8
    one, two = 0.4886025119029199, 1.0925484305920792
    wanted = [0.28209479177387814, -one * y, one * z, -one * x, two * x * y, -two * y * z]
    wanted += [0.31539156525252005 * (3 * z * z - 1), -two * x * z, two / 2 * (x * x - y * y)]
    np.testing.assert_allclose(first, wanted, rtol=1e-12)


def test_light_that_is_the_same_all_round_has_no_direction(device):
    values = random_splats(coefficients=16)
    values["sh"][:, 1:] = 0
    colors, drawn = colors_of(device, values)
    wanted = np.maximum(0.28209479177387814 * values["sh"][:, 0] + 0.5, 0)
    np.testing.assert_allclose(colors[drawn], wanted[drawn], rtol=1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_color_that_is_no_number_is_black_and_spoils_nothing(device, bad):
    values = random_splats(60, wide=0.5)
    values["sh"][7, 3, 1] = bad
    splats = upload(device, values, Kind())
    projected = project(device, splats, Kind().camera, SplatSettings())
    assert device.get(projected.culled)[7] == 0
    colors = shade(device, splats.means, splats.sh, Kind().camera, projected.culled)
    assert device.get(colors)[7].tolist() == [0, 0, 0]
    gradients = grad_of_ones(device, splats, projected)
    by_sh = shade_grad(
        device, splats.means, splats.sh, Kind().camera, features=colors, gradients=gradients
    )
    assert not device.get(by_sh)[7].any()
    assert np.isfinite(device.get(by_sh)).all()
    assert np.isfinite(device.get(gradients.means)).all()
    assert np.isfinite(device.get(gradients.camera)).all()


def grad_of_ones(device, splats, projected, channels=3):
    """Gradients of projection with ones for every feature."""
    sums = np.zeros((len(splats), 6 + channels), np.float32)
    sums[:, 6:] = 1
    return project_grad(
        projected,
        device.array(sums),
    )


def test_splat_where_the_camera_stands_has_a_color_and_no_gradient_by_direction(device):
    camera = camera_of("pinhole", distance=0.0)
    values = random_splats(1)
    # The nearest float32 to the centre, which is as near as a splat can come.
    values["means"] = camera.center[None].astype(np.float32)
    splats, drawn = upload(device, values, Kind()), device.array(np.zeros(1, np.uint8))
    color = device.get(shade(device, splats.means, splats.sh, camera, drawn))
    assert np.isfinite(color).all()


def test_shading_needs_harmonics_and_three_channels(device):
    values = random_splats(5)
    splats = Splats.upload(device, **(values | {"sh": None}))
    projected = project(device, splats, Kind().camera, SplatSettings())
    with pytest.raises(InputError, match="no spherical harmonics"):
        shade(device, splats.means, splats.sh, Kind().camera, projected.culled)
    splats = upload(device, values, Kind())
    colors = shade(device, splats.means, splats.sh, Kind().camera, projected.culled)
    gradients = grad_of_ones(device, splats, projected, channels=2)
    with pytest.raises(ShapeError, match=r"\(5, 2\),.*\(5, 3\)"):
        shade_grad(
            device, splats.means, splats.sh, Kind().camera, features=colors, gradients=gradients
        )


def test_no_splats_have_no_colors(device):
    values = {name: value[:0] for name, value in random_splats(1).items()}
    assert colors_of(device, values)[0].shape == (0, 3)
