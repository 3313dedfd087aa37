"""Projection and shading in torch float64, whose autograd is the oracle of their gradients.

Jacobians come from torch as well: nothing here is a derivative that a person wrote.
"""

from __future__ import annotations

from math import factorial

import numpy as np
import torch
from torch.func import jacrev, vmap

MARGIN, LEAST_COMPENSATION = 0.15, 0.005


def covariance(quats, scales):
    """R S S^T R^T of quaternions (w, x, y, z) and scales."""
    w, x, y, z = (quats / quats.norm(dim=1, keepdim=True)).unbind(1)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    root = torch.stack(rows, 1).reshape(-1, 3, 3) * scales[:, None, :]
    return root @ root.transpose(1, 2)


def from_six(covars):
    """Symmetric matrices of their upper triangles."""
    return covars[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)


def _pixel(model, lens, q):
    fx, fy, cx, cy = lens
    bend = 1 if model == "ortho" else 1 / q[2]
    if model == "fisheye":
        r = torch.sqrt(q[0] ** 2 + q[1] ** 2)
        bend = torch.atan2(r, q[2]) / r
    return torch.stack([fx * q[0] * bend + cx, fy * q[1] * bend + cy])


def _jacobian_at(camera, lens, q):
    """Where the Jacobian is taken, and the direction in which it sees nothing."""
    if camera.model == "ortho":
        return q, torch.zeros_like(q) + torch.tensor([0.0, 0.0, 1.0], dtype=q.dtype)
    if camera.model == "pinhole":
        fx, fy, cx, cy = lens
        x, y, z = q.unbind(1)
        edge = torch.tensor([-MARGIN, 1 + MARGIN], dtype=q.dtype)
        x = z * torch.clamp(x / z, *((edge * camera.width - cx) / fx))
        y = z * torch.clamp(y / z, *((edge * camera.height - cy) / fy))
        q = torch.stack([x, y, z], 1)
    return q, q / q.norm(dim=1, keepdim=True)


def _blur(camera, lens, opening, depths):
    """Variance of the disc, and of the Gaussian with the Airy pattern's light and peak.

    That peak is pi R^2 / (wavelength f)^2, a Gaussian's is 1 / (2 pi variance).
    """
    if opening is None:
        return torch.zeros_like(depths)
    radius, focus = opening
    diameter = 2 * radius * torch.abs(1 / depths - 1 / focus)
    peak = np.pi * radius**2
    airy = camera.aperture.wavelength**2 / (2 * np.pi * peak)
    return lens[0] * lens[1] * (diameter**2 / 16 + airy)


def screen(means, covars, opacities, view, lens, opening=None, *, camera, settings):
    """Pixel positions (N, 2), conics (N, 2, 2), weights, depths."""
    rotation, shift = view[:, :3], view[:, 3]
    points = means @ rotation.T + shift
    at, ray = _jacobian_at(camera, lens, points)
    jacobian = vmap(jacrev(lambda q: _pixel(camera.model, lens, q)))(at)
    map_ = jacobian @ rotation
    plain = map_ @ covars @ map_.transpose(1, 2)
    sharp = plain + settings.eps2d * torch.eye(2, dtype=plain.dtype)
    blur = _blur(camera, lens, opening, points[:, 2])
    wide = sharp + blur[:, None, None] * torch.eye(2, dtype=plain.dtype)
    factor = torch.ones_like(opacities)
    if settings.mode == "xray":
        volume = torch.linalg.det(torch.cat([jacobian, ray[:, None]], 1))
        along = volume**2 * torch.linalg.det(covars)
        factor = torch.sqrt(2 * np.pi * along / torch.linalg.det(wide))
    elif settings.antialiased:
        kept = torch.linalg.det(plain) / torch.linalg.det(sharp)
        factor = torch.sqrt(torch.clamp(kept, min=LEAST_COMPENSATION**2))
    if opening is not None:
        factor = factor * torch.sqrt(torch.linalg.det(sharp) / torch.linalg.det(wide))
    pixels = vmap(lambda q: _pixel(camera.model, lens, q))(points)
    depths = points.norm(dim=1) if camera.model == "fisheye" else points[:, 2]
    return pixels, torch.linalg.inv(wide), opacities * factor, depths


def shade(means, sh, view, model="pinhole"):
    """Colours of splats with spherical harmonics; parallel rays go along the camera's axis."""
    center = -torch.linalg.inv(view[:, :3]) @ view[:, 3]
    direction = view[2:, :3].expand(len(means), 3) if model == "ortho" else means - center
    x, y, z = (direction / direction.norm(dim=1, keepdim=True)).unbind(1)
    color = torch.full((len(means), 3), 0.5, dtype=means.dtype)
    degree = int(np.sqrt(sh.shape[1])) - 1
    for order in range(degree + 1):
        for m in range(-order, order + 1):
            basis = _harmonic(order, m, x, y, z)
            color = color + basis[:, None] * sh[:, order * order + order + m]
    return torch.clamp(color, min=0)


def _harmonic(order, m, x, y, z):
    n = abs(m)
    norm = (2 * order + 1) / (4 * np.pi) * factorial(order - n) / factorial(order + n)
    legendre = np.polynomial.Legendre.basis(order).convert(kind=np.polynomial.Polynomial)
    height = sum(c * z**k for k, c in enumerate(legendre.deriv(n).coef if n else legendre.coef))
    azimuth = torch.atan2(y, x)
    turn = torch.cos(n * azimuth) if m >= 0 else torch.sin(n * azimuth)
    scale = (-1) ** n * np.sqrt(norm * (2 if n else 1))
    return scale * (1 - z * z) ** (n / 2) * height * turn


def loss(drawn, sums, colors=None, *, depth_channel=False):
    """The scalar whose gradient by what was drawn is what the summed records say.

    Args:
        drawn: what ``screen`` gave, of the splats that are drawn.
        sums: (N, 6 + D) their summed records.
        colors: (N, 3) their colours, if those are differentiated as well.
        depth_channel: the last channel is depth.
    """
    pixels, conics, weights, depths = drawn
    s0, first, xx, xy, yy = sums[:, 0], sums[:, 1:3], sums[:, 3], sums[:, 4], sums[:, 5]
    by_pixel = (conics.detach() @ first[:, :, None])[:, :, 0]
    total = (by_pixel * pixels).sum() - (s0 * torch.log(weights)).sum()
    total = (
        total + (xx * conics[:, 0, 0] / 2 + xy * conics[:, 0, 1] + yy * conics[:, 1, 1] / 2).sum()
    )
    if depth_channel:
        total = total + (sums[:, -1] * depths).sum()
    if colors is not None:
        total = total + (sums[:, 6:9] * colors).sum()
    return total
