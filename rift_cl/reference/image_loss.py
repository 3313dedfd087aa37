"""The image loss of splat training and its gradient, from the definitions: twin of the kernels.

SSIM is that of Wang et al. (IEEE Trans. Image Process. 13, 2004), written with its five blurred
moments; a blur is a matrix, so that its adjoint is the transposed one, whatever the border does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

RADIUS, SIGMA = 5, 1.5
C1, C2 = 0.01**2, 0.03**2


def image_loss(
    image: ArrayLike,
    target: ArrayLike,
    weights: ArrayLike | None = None,
    *,
    ssim_weight: float = 0.2,
    kind: str = "l1",
) -> tuple[float, Floats]:
    """The mean of ``m ((1 - w) |image - target| + w (1 - SSIM))``, and its gradient by the image.

    Args:
        image: (height, width, D), of which the first C channels count.
        target: (height, width, C).
        weights: m, (height, width); one if not given.
        ssim_weight: w.
        kind: ``l1``, or ``l2`` for the squared difference in place of its magnitude.

    Returns:
        The loss, and its gradient like the image, with zeros behind channel C.
    """
    x, y = np.asarray(image, dtype=np.float64), np.asarray(target, dtype=np.float64)
    channels = y.shape[2]
    m = np.ones(y.shape[:2]) if weights is None else np.asarray(weights, dtype=np.float64)
    gradient, total = np.zeros(x.shape), 0.0
    for c in range(channels):
        d = x[..., c] - y[..., c]
        error, slope = (np.abs(d), np.sign(d)) if kind == "l1" else (d**2, 2 * d)
        total += float(np.sum((1 - ssim_weight) * m * error))
        gradient[..., c] = (1 - ssim_weight) * m * slope
        if ssim_weight:
            total += float(np.sum(ssim_weight * m * (1 - similarity(x[..., c], y[..., c]))))
            gradient[..., c] -= ssim_weight * similarity_gradient(x[..., c], y[..., c], m)
    return total / y.size, gradient / y.size


def blur_matrix(n: int) -> Floats:
    """The Gaussian along one axis of n samples, mirrored at the border: c b a | a b c."""
    taps = np.exp(-0.5 * (np.arange(-RADIUS, RADIUS + 1) / SIGMA) ** 2)
    taps /= taps.sum()
    matrix = np.zeros((n, n))
    for i in range(n):
        for k, tap in zip(range(-RADIUS, RADIUS + 1), taps, strict=True):
            j = (i + k) % (2 * n)
            matrix[i, min(j, 2 * n - 1 - j)] += tap
    return matrix


class Moments(NamedTuple):
    """Blurred means, variances and covariance of two images."""

    mu1: Floats
    mu2: Floats
    s1: Floats
    s2: Floats
    s12: Floats


def moments(x: Floats, y: Floats) -> Moments:
    """The population's moments under the window, at every pixel."""
    down, along = (blur_matrix(n) for n in x.shape)
    mu1, mu2, xx, yy, xy = (down @ z @ along.T for z in (x, y, x * x, y * y, x * y))
    return Moments(mu1, mu2, xx - mu1**2, yy - mu2**2, xy - mu1 * mu2)


def similarity(x: Floats, y: Floats) -> Floats:
    """The SSIM map l c, of two images of one channel."""
    mu1, mu2, s1, s2, s12 = moments(x, y)
    luminance: Floats = (2 * mu1 * mu2 + C1) / (mu1**2 + mu2**2 + C1)
    contrast: Floats = (2 * s12 + C2) / (s1 + s2 + C2)
    return luminance * contrast


def similarity_gradient(x: Floats, y: Floats, m: Floats) -> Floats:
    """The gradient by x of the sum of m SSIM: three blurs, each with the window's adjoint.

    With E the adjoint blur, ``E(by mu1) + 2 x E(by s1) + y E(by s12)``, where the moments' own
    means count into the first: s1 = E(x x) - mu1^2 and s12 = E(x y) - mu1 mu2.
    """
    mu1, mu2, s1, s2, s12 = moments(x, y)
    square, spread = mu1**2 + mu2**2 + C1, s1 + s2 + C2
    luminance, contrast = (2 * mu1 * mu2 + C1) / square, (2 * s12 + C2) / spread
    by_mu1 = m * contrast * (2 * mu2 - 2 * mu1 * luminance) / square
    by_s1 = -m * luminance * contrast / spread
    by_s12 = m * luminance * 2 / spread
    by_mu1 -= 2 * mu1 * by_s1 + mu2 * by_s12
    down, along = (blur_matrix(n) for n in x.shape)
    first, second, third = (down.T @ z @ along for z in (by_mu1, by_s1, by_s12))
    return first + 2 * x * second + y * third
