"""A step of training by its definitions: twins of adam, splat_activate and splat_noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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


def activate(log_scales: Floats, logits: Floats) -> tuple[Floats, Floats]:
    """Scales and opacities."""
    return np.exp(np.clip(log_scales, -30, 30)), 1 / (1 + np.exp(-logits))


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
