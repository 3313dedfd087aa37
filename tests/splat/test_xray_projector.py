"""Line integrals of splats agree with the projector of voxels, and with quadrature along rays.

Splats in ``xray`` mode and ``rift.Projector`` measure the same thing by roads that share no code.
A parallel beam at an angle is an orthographic camera: where the two agree, axes, units and scale
of both are right. What is left is the voxels' error, which falls with the square of their spacing.
"""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import turned

import rift_cl as rift
from rift_cl.reference.splat_projection import covariances
from rift_cl.splat import Renderer, Splats, SplatSettings

pytestmark = pytest.mark.dealt

# The axes, a diagonal, and one in every other part of the circle.
ANGLES = np.array([0.0, 0.4, np.pi / 4, np.pi / 2, 2.3, 3.9, 5.5])
COUNT = 30
# Line integrals end at 4 standard deviations: what of a mass lies within.
WITHIN = 1 - np.exp(-8)


def gaussians(scales):
    """Splats of uneven axes and densities, with their means in a ball of radius 1/2."""
    random = np.random.default_rng(0)
    away = random.standard_normal((COUNT, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    return {
        "means": 0.5 * random.uniform(0, 1, (COUNT, 1)) * away,
        "quats": random.standard_normal((COUNT, 4)),
        "scales": random.uniform(*scales, (COUNT, 3)),
        "opacities": random.uniform(0.2, 2, COUNT),
    }


def density(values, points):
    """The sum of the Gaussians at points (..., 3)."""
    total = np.zeros(points.shape[:-1])
    inverses = np.linalg.inv(covariances(values["quats"], values["scales"]))
    for mean, inverse, peak in zip(values["means"], inverses, values["opacities"], strict=True):
        away = points - mean
        total += peak * np.exp(-0.5 * ((away @ inverse) * away).sum(axis=-1))
    return total


def mass(values):
    return (2 * np.pi) ** 1.5 * (values["opacities"] * values["scales"].prod(axis=1)).sum()


def parallel_beam(spacing):
    """A volume of fine voxels, thicker slices, and a scan of it; neither lies symmetrically.

    Bins are half as wide as voxels, between which the linear footprint then interpolates along the
    detector, as a smooth density wants; strips would show every voxel's steps along the axes.
    """
    columns, slices = round(3 / spacing), 40
    grid = rift.Grid((slices, columns, columns), (0.08, spacing, spacing), (0.07, 0, 0))
    scan = rift.Parallel(ANGLES, 2 * columns + 7, spacing / 2, center=columns - 2.3)
    return grid, scan


def parallel_camera(angle, grid, scan):
    """The orthographic camera that sees what a parallel beam sees.

    Its x axis is the detector's, t = x cos(angle) + y sin(angle), and its y axis is the rotation
    axis z, since rows of the image are slices; so it looks along (sin(angle), -cos(angle), 0),
    from where all lies before it. Bin k, at t = (k - center) * pitch, is the column of pixels
    whose centres are at k + 0.5, and slice i the row whose centres are at i + 0.5.
    """
    cos, sin = np.cos(angle), np.sin(angle)
    view = np.eye(4)
    view[:3, :3] = [[cos, sin, 0], [0, 0, 1], [sin, -cos, 0]]
    view[2, 3] = 10
    slices, height, middle = grid.shape[0], grid.spacing[0], grid.center[0]
    fx, fy, cx, cy = 1 / scan.pitch, 1 / height, scan.center + 0.5, slices / 2 - middle / height
    return rift.Camera((slices, scan.bins), [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], view, "ortho")


def drawn(device, values, camera, eps2d=0.0):
    """The image of the splats, none of which may be culled."""
    renderer = Renderer(SplatSettings(mode="xray", eps2d=eps2d), device=device)
    frame = renderer.forward(Splats.upload(device, **values, colors=np.ones((COUNT, 1))), camera)
    assert renderer.culled(frame) == {"visible": COUNT}
    return device.get(frame.image)[..., 0].astype(float)


def relative(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


def projector_errors(device, spacing):
    """Relative difference of splats and voxels, view by view."""
    values, (grid, scan) = gaussians((0.1, 0.25)), parallel_beam(spacing)
    z, y, x = np.meshgrid(*map(grid.coordinates, range(3)), indexing="ij")
    voxels = density(values, np.stack([x, y, z], axis=-1))
    projections = rift.Projector(grid, scan, "linear", device=device)(voxels)
    cameras = [parallel_camera(angle, grid, scan) for angle in scan.angles]
    pairs = zip(cameras, projections, strict=True)
    return np.array(
        [relative(drawn(device, values, camera), by_voxels) for camera, by_voxels in pairs]
    )


@pytest.mark.full
def test_parallel_views_are_the_projections_of_fine_voxels(device):
    coarse, fine = projector_errors(device, 0.1), projector_errors(device, 0.05)
    assert fine.max() < 4e-3
    assert (coarse / fine > 3.5).all()


@pytest.mark.parametrize("eps2d", [0.0, 0.3])
@pytest.mark.parametrize("angle", ANGLES)
def test_every_parallel_view_has_the_whole_mass(device, angle, eps2d):
    values, (grid, scan) = gaussians((0.1, 0.25)), parallel_beam(0.05)
    image = drawn(device, values, parallel_camera(angle, grid, scan), eps2d)
    found = image.sum() * scan.pitch * grid.spacing[0]
    assert found == pytest.approx(mass(values) * WITHIN, rel=1e-5)


def cone_camera(distance, aside):
    """A pinhole camera that looks past the scene; its size on the screen is always the same."""
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = turned(3), [aside * distance, 0, distance]
    fx, fy = 60 * distance, 66 * distance
    return rift.Camera((120, 130), [[fx, 0, 65 - aside * fx], [0, fy, 60], [0, 0, 1]], view)


def integrals(values, camera, rows, columns, step=0.01):
    """Line integrals along the rays through the centres of pixels, by quadrature."""
    fx, fy, cx, cy = camera.intrinsics
    ones = np.ones(len(rows))
    rays = np.stack([(columns + 0.5 - cx) / fx, (rows + 0.5 - cy) / fy, ones], axis=-1)
    depths = camera.view[2, 3] + np.arange(-1.2, 1.2, step)
    points = (rays[:, None] * depths[:, None] - camera.view[:3, 3]) @ camera.view[:3, :3]
    return density(values, points).sum(axis=1) * step * np.linalg.norm(rays, axis=1)


def cone_error(device, distance, aside):
    """Relative error of 300 pixels that see something."""
    values, camera = gaussians((0.04, 0.1)), cone_camera(distance, aside)
    image = drawn(device, values, camera)
    seen = np.argwhere(image > 0.01 * image.max())
    rows, columns = np.random.default_rng(0).permutation(seen)[:300].T
    return relative(image[rows, columns], integrals(values, camera, rows, columns))


@pytest.mark.parametrize("aside, most", [(0.0, 2e-3), (0.7, 1e-2)])
def test_cone_views_are_integrals_along_their_rays(device, aside, most):
    """Up to terms in size over distance, which the affine map of each splat leaves out."""
    near, far = cone_error(device, 6, aside), cone_error(device, 12, aside)
    assert near < most
    assert near / far > 1.7
