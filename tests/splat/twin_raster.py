"""Compositing in torch float64, whose autograd is the oracle of the raster gradient."""

import torch

from rift_cl.reference.splat_raster import (
    ADDED_EDGE,
    ALPHA_THRESHOLD,
    SMOOTH_EDGE,
    TRANSMITTANCE_THRESHOLD,
)


def raster_torch(scene, screen, features, rules, background):
    """Image and transmittance of a scene, differentiable in screen and features."""
    height, width = scene.size
    image = torch.zeros(height, width, features.shape[1], dtype=torch.float64)
    left = torch.ones(height, width, dtype=torch.float64)
    for tile in range(len(scene.starts) - 1):
        y = tile // scene.tiles.across * rules.tile
        x = tile % scene.tiles.across * rules.tile
        rows, columns = min(rules.tile, height - y), min(rules.tile, width - x)
        order = scene.entries[scene.starts[tile] : scene.starts[tile + 1], 0]
        color, rest = _tile(screen, features, order, (y, x, rows, columns), rules)
        image[y : y + rows, x : x + columns] = color
        left[y : y + rows, x : x + columns] = rest
    if not rules.additive:
        image = image + left[..., None] * torch.tensor(background, dtype=torch.float64)
    return image, left


def _tile(screen, features, order, place, rules):
    y, x, rows, columns = place
    py = torch.arange(rows, dtype=torch.float64)[:, None] + y + 0.5
    px = torch.arange(columns, dtype=torch.float64) + x + 0.5
    left = torch.ones(rows, columns, dtype=torch.float64)
    alive = torch.ones(rows, columns, dtype=torch.bool)
    color = torch.zeros(rows, columns, features.shape[1], dtype=torch.float64)
    for splat in order:
        mean_x, mean_y, a, b, c, weight = screen[splat, :6]
        dx, dy = mean_x - px, mean_y - py
        sigma = (a * dx**2 + c * dy**2) / 2 + b * dx * dy
        value = weight * torch.exp(-sigma)
        if rules.smooth:
            value = value * torch.clamp(1 - sigma / SMOOTH_EDGE, min=0) ** 2
        if rules.additive:
            inside = sigma <= ADDED_EDGE
            color = color + torch.where(inside, value, 0.0)[..., None] * features[splat]
            continue
        alpha = value
        if not rules.smooth:
            alpha = torch.clamp(value, max=rules.cap)
            counts = alive & (alpha >= ALPHA_THRESHOLD)
            alive = alive & ~(counts & (left * (1 - alpha) <= TRANSMITTANCE_THRESHOLD))
            alpha = torch.where(counts & alive, alpha, 0.0)
        color = color + (alpha * left)[..., None] * features[splat]
        left = left * (1 - alpha)
    return color, left
