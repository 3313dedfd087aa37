"""Views for the tests of sampling: at random with all optics, and rings of cameras."""

from __future__ import annotations

import numpy as np

from rift_cl.geometry import Aperture, Camera
from rift_cl.geometry.pose import look_at
from rift_cl.sampling.targets.observations import Observations


def random_observations(
    views: int, points: int, *, diameter: float = 1.0, seed: int = 0
) -> Observations:
    """Views in all directions; some have no pixels, no diffraction or no blur."""
    random = np.random.default_rng(seed)
    direction = random.normal(size=(views, points, 3))
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    shape = (views, points)

    def some(values: np.ndarray, otherwise: float) -> np.ndarray:
        return np.where(random.random(shape) < 0.25, otherwise, values)

    return Observations(
        direction,
        random.uniform(0.5, 1.5, shape),
        some(diameter * random.uniform(0.005, 0.08, shape), 0),
        some(random.uniform(5, 25, shape) / diameter, np.inf),
        some(diameter * random.uniform(0.01, 0.5, shape), 0),
    )


def ring_directions(count: int, elevation: float = 0.0) -> np.ndarray:
    """Directions (count, 3) round z, so many radians above the plane."""
    turn = 2 * np.pi * (np.arange(count) + 0.5) / count
    across = np.cos(elevation) * np.stack([np.cos(turn), np.sin(turn)])
    return np.stack([*across, np.full(count, np.sin(elevation))], axis=1)


def ring_of_cameras(
    count: int,
    distance: float = 10.0,
    *,
    focal: float = 200.0,
    size: int = 100,
    elevation: float = 0.0,
    aperture: Aperture | None = None,
    axis: int = 2,
) -> list[Camera]:
    """Cameras that look at zero from a ring about an axis."""
    cameras = []
    for direction in np.roll(ring_directions(count, elevation), axis - 2, axis=1):
        view = look_at(distance * direction, (0, 0, 0), np.eye(3)[axis])
        K = [[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]]
        cameras.append(Camera((size, size), K, view, aperture=aperture))
    return cameras
