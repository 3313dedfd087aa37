"""A small radiance field in torch: density and colour of a network, rendered along rays.

The least that shows what such fields do at a size that a processor trains in minutes: a hash grid
(Mueller et al. 2022) or random Fourier features (Tancik et al. 2020) of a place, one hidden layer
for the density and one for the colour, samples by chance within equal parts of a ray's way through
a box. Nothing is pruned, and no kernels are fused; torch's own operations alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from rift_cl.geometry import Camera

Floats = NDArray[np.float32]

_WIDTH, _SHARED = 64, 15
# Of the hash (Teschner et al. 2003), as hash grids take it.
_PRIMES = (1, 2654435761, 805459861)
# Density begins low, so that light gets through.
_SHIFT = -1.0


@dataclass(frozen=True)
class FieldSize:
    """How large a field is and how it is trained.

    Args:
        levels: of the hash grid, and ``entries`` of each with two numbers.
        entries: a power of two.
        finest: cells along the box on the last level; the first has 8.
        features: frequencies of Fourier features.
        samples: along a ray.
        patch: pixels along the side of a square of rays; ``patches`` of them make a step.
        patches: squares of a step.
        rate: of Adam.
    """

    levels: int = 12
    entries: int = 1 << 15
    finest: int = 256
    features: int = 128
    samples: int = 64
    patch: int = 32
    patches: int = 4
    rate: float = 5e-3


# For a look in a minute.
QUICK = FieldSize(
    levels=8, entries=1 << 13, finest=96, features=48, samples=24, patch=16, patches=3
)


class HashGrid(torch.nn.Module):
    """Features of places in the unit cube, from tables on grids of rising resolution."""

    def __init__(self, size: FieldSize) -> None:
        super().__init__()
        growth = (size.finest / 8) ** (1 / max(size.levels - 1, 1))
        self.cells = [round(8 * growth**level) for level in range(size.levels)]
        self.tables = torch.nn.Parameter(
            torch.empty(size.levels, size.entries, 2).uniform_(-1e-4, 1e-4)
        )
        self.width = 2 * size.levels

    def forward(self, places: Any) -> Any:
        """(n, width) of (n, 3)."""
        return torch.cat([self._level(places, level) for level in range(len(self.cells))], dim=1)

    def _level(self, places: Any, level: int) -> Any:
        scaled = places.clamp(0, 1) * self.cells[level]
        first = scaled.floor().clamp(max=self.cells[level] - 1)
        share, corner = scaled - first, first.long()
        table, total = self.tables[level], 0.0
        for number in range(8):
            offset = torch.tensor([number >> axis & 1 for axis in range(3)])
            at = (corner + offset) * torch.tensor(_PRIMES)
            key = (at[:, 0] ^ at[:, 1] ^ at[:, 2]) & (table.shape[0] - 1)
            weight = torch.where(offset.bool(), share, 1 - share).prod(dim=1, keepdim=True)
            total = total + weight * table[key]
        return total


class FourierFeatures(torch.nn.Module):
    """Cosines and sines of random frequencies.

    Args:
        size: of the field.
        sigma: standard deviation of the frequencies, in half cycles over half the cube.
    """

    def __init__(self, size: FieldSize, sigma: float) -> None:
        super().__init__()
        self.register_buffer("waves", math.pi * sigma * torch.randn(3, size.features))
        self.width = 2 * size.features

    def forward(self, places: Any) -> Any:
        """(n, width) of (n, 3)."""
        phase = (2 * places - 1) @ self.waves
        return torch.cat([torch.cos(phase), torch.sin(phase)], dim=1)


class SmallField(torch.nn.Module):
    """Density and colour in a box, and pictures of them.

    Args:
        size: of the field.
        encoding: features of places in the unit cube.
        box: (3,) and (3,), two opposite corners.
        behind: (3,) the background.
    """

    def __init__(
        self, size: FieldSize, encoding: Any, box: tuple[Floats, Floats], behind: Floats
    ) -> None:
        super().__init__()
        self.size, self.encoding = size, encoding
        layer, relu = torch.nn.Linear, torch.nn.ReLU
        self.body = torch.nn.Sequential(
            layer(encoding.width, _WIDTH), relu(), layer(_WIDTH, 1 + _SHARED)
        )
        self.color = torch.nn.Sequential(layer(_SHARED + 9, _WIDTH), relu(), layer(_WIDTH, 3))
        self.low, self.high = (torch.tensor(np.asarray(end, np.float32)) for end in box)
        self.behind = torch.tensor(np.asarray(behind, np.float32))

    def forward(self, places: Any, ways: Any) -> tuple[Any, Any]:
        """Densities (n,) per unit of length and colours (n, 3) of places and unit directions."""
        found = self.body(self.encoding((places - self.low) / (self.high - self.low)))
        density = functional.softplus(found[:, 0] + _SHIFT)
        color = self.color(torch.cat([found[:, 1:], second_degree(ways)], dim=1))
        return density / (self.high - self.low).max() * self.size.samples, torch.sigmoid(color)

    def rays(self, origins: Any, ways: Any, random: torch.Generator | None = None) -> Any:
        """Colours (n, 3) along rays; samples in the middle of their parts without ``random``."""
        near, far = self._within(origins, ways)
        count, rays = self.size.samples, len(origins)
        place = torch.full((rays, count), 0.5)
        if random is not None:
            place = torch.rand(rays, count, generator=random)
        step = (far - near) / count
        along = near[:, None] + (torch.arange(count) + place) * step[:, None]
        places = origins[:, None] + along[..., None] * ways[:, None]
        repeated = ways[:, None].expand(-1, count, -1)
        density, color = self(places.reshape(-1, 3), repeated.reshape(-1, 3))
        optical = density.reshape(rays, count) * step[:, None]
        before = torch.cumsum(optical, dim=1) - optical
        weight = torch.exp(-before) * (1 - torch.exp(-optical))
        left = torch.exp(-optical.sum(dim=1, keepdim=True))
        return (weight[..., None] * color.reshape(rays, count, 3)).sum(dim=1) + left * self.behind

    def _within(self, origins: Any, ways: Any) -> tuple[Any, Any]:
        """How far along each ray the box begins and ends; nothing where it is missed."""
        safe = torch.where(ways.abs() < 1e-9, torch.full_like(ways, 1e-9), ways)
        ends = torch.stack([(self.low - origins) / safe, (self.high - origins) / safe])
        near = ends.min(dim=0).values.max(dim=1).values.clamp(min=0)
        return near, torch.maximum(ends.max(dim=0).values.min(dim=1).values, near)

    def picture(self, camera: Camera, rows: int = 16) -> Floats:
        """(height, width, 3) of a pinhole camera, so many rows at a time."""
        parts = []
        with torch.no_grad():
            for row in range(0, camera.height, rows):
                some = slice(row, min(row + rows, camera.height))
                origins, ways = camera_rays(camera, some, slice(0, camera.width))
                parts.append(self.rays(origins.reshape(-1, 3), ways.reshape(-1, 3)))
        return np.asarray(torch.cat(parts).reshape(*camera.size, 3).numpy())


def camera_rays(camera: Camera, rows: slice, columns: slice) -> tuple[Any, Any]:
    """Origins and unit directions (rows, columns, 3) through the middles of a pinhole's pixels."""
    fx, fy, cx, cy = camera.intrinsics
    y, x = np.mgrid[rows, columns] + 0.5
    ways = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], axis=-1) @ camera.view[:3, :3]
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    way = torch.tensor(ways, dtype=torch.float32)
    return torch.tensor(camera.center, dtype=torch.float32).expand(way.shape), way


def second_degree(ways: Any) -> Any:
    """(n, 9): the functions of a direction to the second degree."""
    x, y, z = ways.unbind(dim=1)
    return torch.stack(
        [torch.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], dim=1
    )


class FieldFit:
    """A field that is trained on photographs, by squares of rays.

    Args:
        field: what is trained.
        images: the photographs, (height, width, 3) each.
        cameras: of them.
        ramp: whether the residual's frequencies are multiplied by the ramp.
        seed: of squares and samples.
    """

    def __init__(
        self,
        field: SmallField,
        images: list[Floats],
        cameras: list[Camera],
        *,
        ramp: bool,
        seed: int,
    ) -> None:
        self.field, self._ramp, self._cameras = field, ramp, cameras
        self._images = [torch.tensor(image) for image in images]
        self._choice = np.random.default_rng((seed, 0xF1))
        self._random = torch.Generator().manual_seed(seed)
        self._adam = torch.optim.Adam(field.parameters(), lr=field.size.rate, eps=1e-15)

    def step(self) -> None:
        """One step of Adam on a few squares."""
        squares = [self._square() for _ in range(self.field.size.patches)]
        origins, ways, wanted = (torch.stack(parts) for parts in zip(*squares, strict=True))
        flat = self.field.rays(origins.reshape(-1, 3), ways.reshape(-1, 3), self._random)
        drawn = flat.reshape(wanted.shape)
        slope = (drawn - wanted).detach()
        if self._ramp:
            slope = ramped(slope)
        self._adam.zero_grad()
        drawn.backward(slope / slope.numel())
        self._adam.step()

    def _square(self) -> tuple[Any, Any, Any]:
        number, edge = int(self._choice.integers(len(self._images))), self.field.size.patch
        image = self._images[number]
        starts = (int(self._choice.integers(max(side - edge, 0) + 1)) for side in image.shape[:2])
        part = tuple(slice(start, start + edge) for start in starts)
        return *camera_rays(self._cameras[number], *part), image[part]


def ramped(residual: Any) -> Any:
    """Residuals (n, edge, edge, C) times their frequency, with the norm they had."""
    edge = residual.shape[1]
    k = torch.hypot(torch.fft.fftfreq(edge)[:, None], torch.fft.fftfreq(residual.shape[2])[None])
    weight = torch.sqrt(k**2 + 1 / edge**2)[None, :, :, None]
    found = torch.fft.ifft2(torch.fft.fft2(residual, dim=(1, 2)) * weight, dim=(1, 2)).real
    return found * (residual.norm() / found.norm().clamp(min=1e-30))
