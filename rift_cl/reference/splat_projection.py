"""Splats on the screen: the twin of ``splat_project.cl`` and ``splat_shade.cl``, from definitions.

Covariances are formed and inverted as matrices, Jacobians are written out as matrices, and
spherical harmonics come from associated Legendre functions. (EWA splatting, Zwicker et al. 2001;
3D Gaussian Splatting, Kerbl et al. 2023; line integrals: R2-Gaussian, Zha et al. 2024, with the
screen Jacobian in place of the world's axes.)
"""

from __future__ import annotations

from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Camera
from rift_cl.reference.sight import sights

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_EXTENT, _XRAY_EXTENT = 3.33, 4.0
_ALPHA_THRESHOLD = 1 / 255
_LEAST_COMPENSATION = 0.005
_MARGIN = 0.15


class ProjectedSplats(NamedTuple):
    """N splats on the screen; what is culled has the numbers it would have had, or NaN.

    Args:
        means: (N, 2) pixel positions.
        covars: (N, 2, 2) covariances with the dilation, in square pixels.
        conics: (N, 3) their inverses a, b, c.
        weights: (N,) opacity times factor.
        depths: (N,) camera z; distances from a fisheye.
        factors: (N,) compensation, line integral through a unit peak, or 1.
        extents: (N, 2) half the bounding rectangle's sides before they are rounded up.
        radii: (N, 2) after.
        boxes: (N, 4) tile rectangles; zero where culled.
        culled: (N,) codes as in the kernel.
    """

    means: Floats
    covars: Floats
    conics: Floats
    weights: Floats
    depths: Floats
    factors: Floats
    extents: Floats
    radii: Floats
    boxes: Ints
    culled: Ints


def covariances(quats: Floats, scales: Floats) -> Floats:
    """R S S^T R^T of quaternions (w, x, y, z) and scales: (N, 3, 3)."""
    with np.errstate(all="ignore"):
        w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    zero = np.zeros_like(w)
    # Rodrigues: R = 1 + 2 w [v] + 2 [v]^2 with [v] the matrix of the cross product.
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    rotation = np.eye(3) + 2 * w[:, None, None] * cross + 2 * cross @ cross
    root = rotation * scales[:, None, :]
    return np.asarray(root @ root.transpose(0, 2, 1))


def project_splats(
    means: Floats,
    covars: Floats,
    opacities: Floats,
    camera: Camera,
    *,
    near: float = 0.01,
    far: float = 1e10,
    radius_clip: float = 0.0,
    eps2d: float = 0.3,
    tile: int = 16,
    antialiased: bool = False,
    mode: str = "light",
) -> ProjectedSplats:
    """Project Gaussians of (N, 3) means, (N, 3, 3) covariances and (N,) opacities."""
    points = means @ camera.view[:3, :3].T + camera.view[:3, 3]
    # The rays of a fisheye go round by up to half a turn.
    depths = np.linalg.norm(points, axis=1) if camera.model == "fisheye" else points[:, 2]
    with np.errstate(all="ignore"):
        centers, jacobians, rays = screen_map(camera, points)
        to_screen = jacobians @ camera.view[:3, :3]
        plain = to_screen @ covars @ to_screen.transpose(0, 2, 1)
        sharp = plain + eps2d * np.eye(2)
        wide = sharp + _blur(camera, depths)[:, None, None] * np.eye(2)
        determinants = np.linalg.det(wide)
        conics = np.stack([wide[:, 1, 1], -wide[:, 0, 1], wide[:, 0, 0]], 1) / determinants[:, None]
        factors = np.ones(len(means))
        if mode == "xray":
            factors = _line_integrals(jacobians, rays, covars, determinants)
        elif antialiased:
            kept = np.linalg.det(plain) / np.linalg.det(sharp)
            factors = np.sqrt(np.maximum(kept, _LEAST_COMPENSATION**2))
        if camera.aperture is not None:
            factors *= np.sqrt(np.linalg.det(sharp) / determinants)
        weights = opacities * factors
        extents = _reach(weights, mode)[:, None] * np.sqrt(wide[:, [0, 1], [0, 1]])
        radii = np.ceil(extents)
        culled, boxes = _cull(camera, tile, centers, radii, radius_clip)
        culled[weights < _ALPHA_THRESHOLD if mode == "light" else ~(weights > 0)] = 3
        culled[(depths < near) | (depths > far)] = 1
    boxes[culled > 0] = 0
    return ProjectedSplats(
        centers, wide, conics, weights, depths, factors, extents, radii, boxes, culled
    )


def _blur(camera: Camera, depths: Floats) -> Floats:
    """Variance that a thin lens adds at these depths, in square pixels.

    A disc of diameter d has the variance d^2 / 16 along each axis. The Airy pattern's variance is
    infinite; in its place stands that of the Gaussian of the same light and the same peak, which
    is (sqrt(2) / pi f lambda / (2 R))^2 (Zhang, Zerubia and Olivo-Marin 2007 compare the choices).
    """
    aperture, (fx, fy, _, _) = camera.aperture, camera.intrinsics
    if aperture is None:
        return np.zeros_like(depths)
    across = aperture.blur(depths) / depths
    airy = np.sqrt(2) / np.pi * aperture.wavelength / (2 * aperture.radius)
    return np.asarray(fx * fy * (across**2 / 16 + airy**2))


def _line_integrals(
    jacobians: Floats, rays: Floats, covars: Floats, determinants: Floats
) -> Floats:
    """Integrals through the middle of unit peaks, kept in mass when they are dilated."""
    volume = np.linalg.det(np.concatenate([jacobians, rays[:, None]], axis=1))
    by_ray = volume**2 * np.linalg.det(covars)
    return np.asarray(np.sqrt(2 * np.pi * by_ray / determinants))


def _reach(weights: Floats, mode: str) -> Floats:
    """Standard deviations at which a splat ends."""
    if mode == "xray":
        return np.full(len(weights), _XRAY_EXTENT)
    at_threshold = np.sqrt(2 * np.log(np.maximum(weights / _ALPHA_THRESHOLD, 1)))
    return np.asarray(np.minimum(_EXTENT, at_threshold))


def screen_map(camera: Camera, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Pixel positions, 2 x 3 Jacobians, and the unit rays along which those see nothing."""
    fx, fy, cx, cy = camera.intrinsics
    x, y, z = points.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    if camera.model == "ortho":
        u, v, ray = x, y, np.stack([zero, zero, one], 1)
        rows = [[one, zero, zero], [zero, one, zero]]
    elif camera.model == "pinhole":
        u, v = x / z, y / z
        tx = np.clip(u, *((np.array([-_MARGIN, 1 + _MARGIN]) * camera.width - cx) / fx))
        ty = np.clip(v, *((np.array([-_MARGIN, 1 + _MARGIN]) * camera.height - cy) / fy))
        ray = np.stack([tx, ty, one], 1)
        rows = [[1 / z, zero, -tx / z], [zero, 1 / z, -ty / z]]
    else:
        r, square, ray = np.hypot(x, y), x**2 + y**2 + z**2, points
        bend = np.where(r > 0, np.arctan2(r, z) / np.where(r > 0, r, 1), 1 / z)
        slope = np.where(r > 0, (z / square - bend) / np.where(r > 0, r**2, 1), 0)
        u, v = x * bend, y * bend
        rows = [
            [bend + x**2 * slope, x * y * slope, -x / square],
            [x * y * slope, bend + y**2 * slope, -y / square],
        ]
    focal = np.array([fx, fy])
    jacobians = np.array(rows).transpose(2, 0, 1) * focal[:, None]
    rays = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    return np.stack([fx * u + cx, fy * v + cy], 1), jacobians, rays


def _cull(
    camera: Camera,
    tile: int,
    centers: Floats,
    radii: Floats,
    radius_clip: float,
) -> tuple[Ints, Ints]:
    """Codes as far as rectangles decide them, and tile rectangles."""
    size = np.array([camera.width, camera.height])
    low, high = centers - radii, centers + radii
    codes = np.zeros(len(centers), np.int64)
    codes[((high <= 0) | (low >= size)).any(1)] = 4
    codes[(radii <= radius_clip).all(1)] = 5
    tiles = -(-size // tile)
    corners = np.concatenate([np.floor(low / tile), np.ceil(high / tile)], axis=1)
    inside = np.clip(np.nan_to_num(corners), 0, np.tile(tiles, 2))
    return codes, inside.astype(np.int64)


def spherical_harmonics(directions: Floats, degree: int) -> Floats:
    """All real spherical harmonics to a degree: (N, (degree + 1)^2), with inria's signs.

    Function l^2 + l + m is N_lm P_l^|m|(z) times sqrt(2) cos(m phi) for m > 0 and
    sqrt(2) sin(|m| phi) for m < 0, with the phase (-1)^m of Condon and Shortley.
    """
    x, y, z = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
    azimuth = np.arctan2(y, x)
    values = []
    for order in range(degree + 1):
        for m in range(-order, order + 1):
            n = abs(m)
            norm = (2 * order + 1) / (4 * np.pi) * factorial(order - n) / factorial(order + n)
            turn = np.cos(n * azimuth) if m >= 0 else np.sin(n * azimuth)
            scale = np.sqrt(norm * (2 if n else 1))
            values.append(scale * _legendre(order, n, z) * turn)
    return np.stack(values, axis=1)


def _legendre(order: int, m: int, z: Floats) -> Floats:
    """P_l^m(z) with Condon and Shortley's phase: (-1)^m (1 - z^2)^(m/2) d^m P_l / dz^m."""
    height = np.polynomial.Legendre.basis(order).deriv(m)(z)
    return np.asarray((-1) ** m * np.maximum(1 - z**2, 0) ** (m / 2) * height)


def shade_splats(means: Floats, sh: Floats, camera: Camera) -> Floats:
    """Colours (N, 3) of splats with (N, K, 3) coefficients, as a camera sees them."""
    degree = int(np.sqrt(sh.shape[1])) - 1
    basis = spherical_harmonics(sights(means, camera), degree)
    color: Floats = np.maximum(np.einsum("nk,nkc->nc", basis, sh) + 0.5, 0)
    return color
