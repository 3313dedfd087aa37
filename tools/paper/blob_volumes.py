"""Volumes of round blobs, their projections along any direction, and their reconstruction.

A Gaussian blob looks the same from everywhere, so that no direction is favoured by the way in which
projections are computed: not that of the grid's axes, nor any other. Part of ``planned_views``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
# Standard deviation of a blob and how far it is drawn, in samples.
BLOB, _REACH = 0.7, 2.5
# The ball that holds a volume and the width of its edge, in sides of the volume.
RADIUS, _FADE = 0.46, 0.12
_ELLIPSOIDS, _VARY = 12, 0.2


def random_volumes(count: int, size: int, seed: int) -> Floats:
    """Volumes (count, z, y, x) that vary by 0.2 in a ball, one standard deviation.

    Half are sums of soft ellipsoids, half fields whose power falls as the fourth power of the
    frequency; all fade out towards the edge of the ball.
    """
    line = (np.arange(size) + 0.5) / size - 0.5
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    far = np.sqrt(x**2 + y**2 + z**2)
    fade = np.clip((RADIUS - far) / _FADE, 0, 1)
    fade = fade * fade * (3 - 2 * fade)
    made = np.empty((count, size, size, size))
    for index in range(count):
        random = np.random.default_rng([seed, index])
        drawn = _field(random, size) if index % 2 else _ellipsoids(random, np.stack([x, y, z]))
        made[index] = fade * (drawn - np.average(drawn, weights=fade))
    spread = np.sqrt((made[:, far < RADIUS] ** 2).mean(1))
    return np.asarray(_VARY * made / spread[:, None, None, None])


def _ellipsoids(random: np.random.Generator, place: Floats) -> Floats:
    total, edge = np.zeros(place.shape[1:]), place.shape[1]
    for _ in range(_ELLIPSOIDS):
        turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
        center = random.uniform(-0.28, 0.28, 3)[:, None, None, None]
        axes = random.uniform(0.06, 0.2, 3)
        along = np.einsum("ij,j...->i...", turn, place - center) / axes[:, None, None, None]
        depth = (1 - np.sqrt((along**2).sum(0))) * axes.min() * edge / 1.5
        total += random.choice([-1, 1]) * random.uniform(0.3, 1) * np.clip(depth + 0.5, 0, 1)
    return total


def _field(random: np.random.Generator, size: int) -> Floats:
    k = frequencies(size) * size
    noise = np.fft.fftn(random.standard_normal((size, size, size)))
    return np.asarray(np.fft.ifftn(noise * np.maximum(k, 1) ** -2.0 * (k < size / 2.2)).real)


def frequencies(size: int) -> Floats:
    """(z, y, x) lengths of the frequencies of a volume, cycles per sample, zero first."""
    line = np.fft.fftfreq(size)
    return np.sqrt(line[:, None, None] ** 2 + line[:, None] ** 2 + line**2)


def radial_power(volumes: Floats) -> Floats:
    """Mean ``|FFT|^2`` over volumes and directions, over the number of samples: (z, y, x)."""
    size = volumes.shape[-1]
    power = (np.abs(np.fft.fftn(volumes, axes=(1, 2, 3))) ** 2).mean(0) / size**3
    k = frequencies(size) * size
    shell = np.rint(k).astype(int)
    counts = np.bincount(shell.ravel())
    mean = np.bincount(shell.ravel(), power.ravel()) / np.maximum(counts, 1)
    found = np.interp(k, np.arange(len(mean)), mean)
    return np.maximum(found, 1e-6 * found.max())


class BlobProjector:
    """Parallel projections of volumes of blobs, one blob for each sample of a ball.

    Args:
        directions: (V, 3) x, y, z along the rays.
        size: of the volume; pictures have as many pixels along a side.
    """

    def __init__(self, directions: Floats, size: int) -> None:
        line = np.arange(size) - (size - 1) / 2
        z, y, x = np.meshgrid(line, line, line, indexing="ij")
        self.inside = x**2 + y**2 + z**2 < (RADIUS * size) ** 2
        places = np.stack([x[self.inside], y[self.inside], z[self.inside]], axis=1)
        self.size = size
        self.matrix = sparse.vstack(
            [_view(places, direction, size) for direction in directions], format="csr"
        )
        self.back = self.matrix.T.tocsr()

    def __call__(self, volumes: Floats) -> Floats:
        """Pictures (V pixels, volumes) of volumes (volumes, z, y, x)."""
        return np.asarray(self.matrix @ volumes[:, self.inside].T.astype(np.float32))

    def adjoint(self, pictures: Floats) -> Floats:
        """Volumes (volumes, z, y, x)."""
        found = np.zeros((pictures.shape[1], *(self.size,) * 3))
        found[:, self.inside] = (self.back @ pictures.astype(np.float32)).T
        return found


def _view(places: Floats, direction: Floats, size: int) -> sparse.csr_matrix:
    """(pixels, blobs) of one view; each blob's footprint adds up to 1."""
    axis = np.eye(3)[np.argmin(np.abs(direction))]
    first = np.cross(axis, direction)
    first /= np.linalg.norm(first)
    flat = np.stack([places @ first, places @ np.cross(direction, first)]) + (size - 1) / 2
    reach = int(np.ceil(_REACH))
    near = np.rint(flat).astype(int)
    steps = np.arange(-reach, reach + 1)
    column = near[:, :, None] + steps
    parts = np.exp(-0.5 * ((column - flat[:, :, None]) / BLOB) ** 2)
    parts *= (column >= 0) & (column < size)
    parts /= np.sqrt(2 * np.pi) * BLOB
    column = np.clip(column, 0, size - 1)
    values = (parts[0][:, :, None] * parts[1][:, None]).reshape(len(places), -1)
    pixels = (column[0][:, :, None] * size + column[1][:, None]).reshape(len(places), -1)
    kept = values > 1e-4
    blobs = np.broadcast_to(np.arange(len(places))[:, None], values.shape)[kept]
    entries = (values[kept].astype(np.float32), (pixels[kept], blobs))
    return sparse.csr_matrix(entries, shape=(size**2, len(places)))


def best_linear(A: BlobProjector, y: Floats, power: Floats, noise: float, steps: int) -> Floats:
    """The estimate with the least expected error for volumes of a mean spectrum.

    Conjugate gradients on ``(1 + S A' A S / noise^2) u = S A' y / noise^2``, x = S u, with S the
    root of the spectrum.

    Args:
        A: the projector.
        y: (V pixels, volumes) pictures.
        power: (z, y, x) the spectrum, frequency zero first.
        noise: standard deviation of a pixel.
        steps: how many.
    """
    root = np.sqrt(power)

    def shaped(volumes: Floats) -> Floats:
        changed = np.fft.rfftn(volumes, axes=(1, 2, 3)) * root[..., : root.shape[-1] // 2 + 1]
        return np.asarray(np.fft.irfftn(changed, volumes.shape[1:], axes=(1, 2, 3)))

    residual = shaped(A.adjoint(y)) / noise**2
    u, direction = np.zeros_like(residual), residual
    square = (residual**2).sum((1, 2, 3))
    for _ in range(steps):
        bent = shaped(A.adjoint(A(shaped(direction)))) / noise**2 + direction
        length = square / (direction * bent).sum((1, 2, 3))
        u = u + length[:, None, None, None] * direction
        residual = residual - length[:, None, None, None] * bent
        square, before = (residual**2).sum((1, 2, 3)), square
        direction = residual + (square / before)[:, None, None, None] * direction
    return shaped(u)
