"""A step of training by its definitions.

Coincident of adam, splat_update, splat_activate, splat_band, splat_band_coverage, splat_noise,
splat_statistics, residual_image, residual_statistics and image_shrink.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.optics.optical_transfer import optical_transfer

Floats = NDArray[np.float64]


def adam_step(
    x: Floats,
    m: Floats,
    v: Floats,
    g: Floats,
    *,
    rate: Floats | float,
    step: int,
    beta1: float = 0.9,
    beta2: float = 0.999,
    epsilon: float = 1e-15,
) -> tuple[Floats, Floats, Floats]:
    """Parameters and moments after step number ``step``, counted from 1 (Kingma and Ba, 2015)."""
    m = beta1 * m + (1 - beta1) * g
    v = beta2 * v + (1 - beta2) * g**2
    unbiased = m / (1 - beta1**step), v / (1 - beta2**step)
    return x - rate * unbiased[0] / (np.sqrt(unbiased[1]) + epsilon), m, v


def activate(
    log_scales: Floats,
    logits: Floats,
    *,
    band: Floats | float = 0.0,
    density: bool = False,
    amplitude: bool = False,
) -> tuple[Floats, Floats]:
    """Scales and opacities, or densities, or optical depths.

    ``band`` blurs splats as Mip-Splatting's 3D filter does. The gradient of this is the gradient
    kernel's oracle, by finite differences.
    """
    trained = np.exp(np.clip(log_scales, -30, 30))
    scales = np.sqrt(trained**2 + np.broadcast_to(band, logits.shape)[:, None] ** 2)
    opacities = np.exp(np.clip(logits, -30, 30)) if density else 1 / (1 + np.exp(-logits))
    if amplitude:
        opacities = np.logaddexp(0, logits)
    return scales, opacities * np.prod(trained / scales, axis=1)


def surface_loss(
    quats: Floats, log_scales: Floats, logits: Floats, normals: Floats, weights: Sequence[float]
) -> float:
    """The priors for surfaces, by ``SurfacePenalties``; splat_update adds the gradient of this.

    Args:
        quats: (N, 4), of any length.
        log_scales: (N, 3).
        logits: (N,).
        normals: (N, 3) of the sheets that splats lie in.
        weights: of the smallest scale, of the entropy of opacities, and of the squared sine between
            the axis of the smallest scale and the normal; each of the mean over splats.
    """
    opacities = 1 / (1 + np.exp(-logits))
    entropy = -opacities * np.log(opacities) - (1 - opacities) * np.log(1 - opacities)
    turns = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    axes = _turned(np.eye(3)[log_scales.argmin(axis=1)], turns[:, :1], turns[:, 1:])
    aside = 1 - (axes * normals).sum(axis=1) ** 2
    parts = np.exp(log_scales).min(axis=1), entropy, aside
    return float(np.dot(weights, [part.mean() for part in parts]))


def finest_seen(means: Floats, cameras: Floats, *, near: float, unseen: float) -> Floats:
    """The length b of each splat's band, (N,), from (V, 20) cameras; twin of splat_band."""
    finest = np.min([_pixel_at(means, row, near) for row in cameras], axis=0)
    return np.asarray(np.where(np.isfinite(finest), np.sqrt(0.2) * finest, unseen))


def finest_known(
    means: Floats, cameras: Floats, *, near: float, unseen: float, diameter: float, snr: float
) -> Floats:
    """The length b where all cameras together set it, (N,); twin of splat_band_coverage.

    Of 2,000 frequencies from one cycle per diameter to half a pixel's inverse, the last one known.
    """
    pixels = np.array([_pixel_at(means, row, near) for row in cameras])
    finest = pixels.min(axis=0)
    seen = np.isfinite(finest)
    highest = np.where(seen, 0.5 / np.where(seen, finest, 1), 1 / diameter)
    found = np.minimum(1 / diameter, highest)
    for share in np.linspace(0, 1, 2000):
        k = (1 / diameter) ** (1 - share) * highest**share
        # The mean of exp(-8 (q u)^2) over u from 0 to 1, for q of 1 and more.
        q = diameter * k
        clear = np.sqrt(np.pi / 32) / q * _passed(k, pixels, cameras) * snr / q**2 > 1
        found = np.where(clear, k, found)
    return np.asarray(np.where(seen, np.sqrt(0.2) / (2 * found), unseen))


def _passed(k: Floats, pixels: Floats, cameras: Floats) -> Floats:
    """Sum of the squares of what cameras' optics pass, up to half a cycle per pixel, (N,)."""
    total = np.zeros(len(k))
    for row, a in zip(cameras, pixels, strict=True):
        edge = np.where(np.isfinite(a), a, 1.0)
        z, (radius, nearness, wavelength) = edge * row[12], row[17:].tolist()
        cutoff = 2 * radius / (wavelength * z) if wavelength else np.inf
        blur = 2 * radius * np.abs(1 - z * nearness)
        passed = optical_transfer(k, edge, cutoff, blur).value ** 2
        total += np.where(a * k <= 0.5 + 1e-9, passed, 0)
    return total


def _pixel_at(means: Floats, row: Floats, near: float) -> Floats:
    """Edge of a camera's pixel at each point; inf where it is not seen, by a margin of 15 %."""
    view: Floats = row[:12].reshape(3, 4)
    focal, left, top, width, height = row[12:17].tolist()
    x, y, z = view[:, :3] @ means.T + view[:, 3:]
    with np.errstate(all="ignore"):
        u, v = focal * x / z + left, focal * y / z + top
    inside = (z > near) & (np.abs(u - width / 2) < 0.65 * width)
    inside &= np.abs(v - height / 2) < 0.65 * height
    return np.where(inside, z / focal, np.inf)


def noise(
    quats: Floats, scales: Floats, opacities: Floats, *, amount: float, seed: int, step: int
) -> Floats:
    """How far splats are moved at random, (N, 3)."""
    gate = 1 / (1 + np.exp(100 * (opacities - 0.005)))
    w, v = quats[:, :1], quats[:, 1:]
    length = np.linalg.norm(quats, axis=1, keepdims=True)
    w, v = w / length, v / length
    xi = _normals(len(quats), seed, step)
    back = _turned(xi, w, -v)
    return np.asarray(amount * gate[:, None] * _turned(back * scales**2, w, v))


def screen_statistics(
    before: Floats,
    grad_means2d: Floats,
    extents: Floats,
    drawn: NDArray[np.bool_],
    size: tuple[int, int],
) -> Floats:
    """What is known of each splat after one more frame, (N, 3).

    Args:
        before: (N, 3) sum of gradients, number of frames, largest radius.
        grad_means2d: (N, 2) gradient by the place on the screen, per pixel.
        extents: (N, 2) half the sides of the splats' rectangles in pixels.
        drawn: (N,) whether they are drawn at all.
        size: (height, width) of the image.
    """
    height, width = size
    magnitude = np.hypot(*(grad_means2d * [width / 2, height / 2]).T)
    counts = drawn & np.isfinite(magnitude)
    radius = np.maximum(before[:, 2], extents.max(axis=1) / max(height, width))
    after = np.stack([before[:, 0] + magnitude, before[:, 1] + 1, radius], axis=1)
    return np.where(counts[:, None], after, before)


def residual_image(image: Floats, target: Floats, weights: Floats | float, channels: int) -> Floats:
    """(height, width, channels): weighted mean absolute difference, weight, and zeros."""
    found = np.zeros((*image.shape[:2], channels))
    off = np.abs(image[..., : target.shape[2]] - target).mean(axis=2)
    found[..., 0], found[..., 1] = weights * off, weights
    return found


def residual_statistics(before: Floats, shown: Floats, culled: NDArray[np.uint8]) -> Floats:
    """What is known of each splat's share in residuals after one more view, (N, 3).

    Args:
        before: (N, 3) sums of the residual shown and of the pixels made up, and views.
        shown: (N, 2) what it shows of the residual of this view, and the pixels it makes up.
        culled: (N,) codes of ``CULL_REASONS``: 1 and 4 are out of the view.
    """
    counts = ~np.isin(culled, (1, 4)) & np.isfinite(shown.sum(axis=1))
    after = before + np.append(shown, np.ones((len(shown), 1)), axis=1)
    return np.where(counts[:, None], after, before)


def image_shrink(
    image: Floats, factor: int, weights: Floats | None = None
) -> tuple[Floats, Floats]:
    """Weighted means of blocks of ``factor`` x ``factor`` pixels, and the means of the weights."""
    rows, columns = (side // factor for side in image.shape[:2])
    counts = np.ones(image.shape[:2]) if weights is None else weights

    def blocks(array: Floats) -> Floats:
        whole = array[: rows * factor, : columns * factor]
        return whole.reshape(rows, factor, columns, factor, *array.shape[2:])

    share = blocks(counts).mean(axis=(1, 3))
    means = blocks(image * counts[..., None]).mean(axis=(1, 3))
    plain = blocks(image).mean(axis=(1, 3))
    known = share[..., None] > 0
    return np.where(known, means / np.where(known, share[..., None], 1), plain), share


def _turned(x: Floats, w: Floats, v: Floats) -> Floats:
    """Vectors turned by unit quaternions."""
    once = np.cross(v, x)
    return x + 2 * (w * once + np.cross(v, once))


def _normals(count: int, seed: int, step: int) -> Floats:
    """Three standard normal numbers for each splat: PCG4D, then Box and Muller."""
    bits = np.zeros((4, count), np.uint32)
    bits[0], bits[1], bits[2], bits[3] = np.arange(count), step, seed, 0x9E3779B9
    bits = bits * np.uint32(1664525) + np.uint32(1013904223)
    for turn in range(2):
        x, y, z, w = bits
        x += y * w
        y += z * x
        z += x * y
        w += y * z
        if turn == 0:
            bits ^= bits >> np.uint32(16)
    share = ((bits >> np.uint32(8)).astype(float) + 0.5) / (1 << 24)
    near, far = np.sqrt(-2 * np.log(share[0])), np.sqrt(-2 * np.log(share[2]))
    angles = 2 * np.pi * share[1], 2 * np.pi * share[3]
    return np.stack(
        [near * np.cos(angles[0]), near * np.sin(angles[0]), far * np.cos(angles[1])], axis=1
    )
