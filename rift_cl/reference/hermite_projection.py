"""Hermite modes on the screen: the twin of ``hermite_project.cl``, from definitions.

The screen covariance is factorised as a matrix, each order's map is written out as the symmetric
power of A = L^-1 J W F, and how far a splat reaches is looked up along a fine line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.indices import order_of, order_slices
from rift_cl.basis.projection import gamma
from rift_cl.geometry import Camera
from rift_cl.reference.splat_projection import screen_map

Floats = NDArray[np.float64]
_ALPHA_THRESHOLD, _FARTHEST = 1 / 255, 6.0


class ScreenPolynomials(NamedTuple):
    """N splats' modes as the camera sees them.

    Args:
        whitening: (N, 2, 2) L^-1, lower triangles: u' = L^-1 (pixel - mean2d).
        maps: (N, 2, 3) A.
        shape: (N, K2(S) - 1) modes of the shape without the constant, graded.
        color: (N, K2(T) - 1, C) modes of the channels.
    """

    whitening: Floats
    maps: Floats
    shape: Floats
    color: Floats

    @property
    def table(self) -> Floats:
        """(N, W), as ``kernels/splat/hermite_project.cl`` says."""
        lower = self.whitening[:, [0, 1, 1], [0, 0, 1]]
        return np.concatenate([lower, self.shape, self.color.reshape(len(lower), -1)], axis=1)


def splat_roots(quats: Floats, scales: Floats) -> Floats:
    """R S of quaternions (w, x, y, z) and scales: (N, 3, 3), whose columns are a splat's axes."""
    with np.errstate(all="ignore"):
        w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    zero = np.zeros_like(w)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    rotation = np.eye(3) + 2 * w[:, None, None] * cross + 2 * cross @ cross
    return np.asarray(rotation * scales[:, None, :])


def project_modes(
    means: Floats,
    roots: Floats,
    covars: Floats,
    camera: Camera,
    shape_modes: Floats | None = None,
    color_modes: Floats | None = None,
) -> ScreenPolynomials:
    """The modes of splats on the screen.

    Args:
        means: (N, 3).
        roots: (N, 3, 3) from ``splat_roots``.
        covars: (N, 2, 2) dilated covariances on the screen, from ``project_splats``.
        camera: the view.
        shape_modes: (N, K3(S) - 1); none for Gaussians.
        color_modes: (N, K3(T) - 1, C); none for splats of one colour.
    """
    points = means @ camera.view[:3, :3].T + camera.view[:3, 3]
    _, jacobians, _ = screen_map(camera, points)
    lower = np.linalg.cholesky(covars)
    maps = np.linalg.solve(lower, jacobians @ camera.view[:3, :3] @ roots)
    shape = np.zeros((len(means), 0)) if shape_modes is None else shape_modes
    color = np.zeros((len(means), 0, 0)) if color_modes is None else color_modes
    return ScreenPolynomials(
        np.linalg.inv(lower), maps, _mapped(maps, shape[..., None])[..., 0], _mapped(maps, color)
    )


def reach(weights: Floats, shape_modes: Floats, *, squared: bool = False) -> Floats:
    """Standard deviations at which the bound of a blended splat falls to 1/255; 0 where below it.

    Args:
        weights: (N,) peaks of the Gaussians.
        shape_modes: (N, K3(S) - 1).
        squared: the polynomial is squared.
    """
    radii = np.linspace(0, _FARTHEST, 6001)
    order = order_of(shape_modes.shape[1] + 1, 3)
    bound = np.ones((len(weights), radii.size))
    for n, part in enumerate(order_slices(order, 3)[1:], 1):
        here = shape_modes[:, part.start - 1 : part.stop - 1]
        bound += np.linalg.norm(here, axis=1)[:, None] * np.sqrt(squares_of_order(n, radii))
    bound = weights[:, None] * bound ** (2 if squared else 1) * np.exp(-(radii**2) / 2)
    above = bound >= _ALPHA_THRESHOLD
    last = radii.size - 1 - above[:, ::-1].argmax(1)
    return np.where(above.any(1), radii[last], 0.0)


def squares_of_order(order: int, radius: Floats) -> Floats:
    """Sum of He~_m(u)^2 over |m| = order, at |u| = radius."""
    along, middle = (_polynomials(order, x) for x in (radius, np.zeros_like(radius)))
    return np.asarray(sum(along[order - k] ** 2 * middle[k] ** 2 for k in range(order + 1)))


def _polynomials(order: int, x: Floats) -> list[Floats]:
    """He~_0 .. He~_order, by numpy's polynomials."""
    norms = np.cumprod([1.0, *np.sqrt(np.arange(1, order + 1))])
    series = np.polynomial.HermiteE.basis
    return [np.asarray(series(n)(x) / norms[n]) for n in range(order + 1)]


def _mapped(maps: Floats, modes: Floats) -> Floats:
    """Gamma(A) on (N, K3 - 1, C) without the constant: (N, K2 - 1, C)."""
    order = order_of(modes.shape[1] + 1, 3)
    parts = zip(gamma(maps, order)[1:], order_slices(order, 3)[1:], strict=True)
    seen = [
        np.einsum("nij,njc->nic", block, modes[:, part.start - 1 : part.stop - 1])
        for block, part in parts
    ]
    return np.concatenate([np.zeros((len(modes), 0, modes.shape[2])), *seen], axis=1)
