"""Cameras round a target at random, and what becomes of them when one thing is changed a little."""

import numpy as np

from rift_cl.geometry import Camera
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.pose import look_at

UP = (0.1, 0.2, 1)


def cameras(count, seed=0, *, model="pinhole", lens=True, unit=1.0):
    """Cameras 3 to 5 units away that look at the origin; half of them with diffraction."""
    random = np.random.default_rng(seed)
    made = []
    for view in range(count):
        center = random.normal(size=3)
        center *= random.uniform(3, 5) / np.linalg.norm(center)
        pose = look_at(center * unit, (0, 0, 0), UP)
        focal = (90 + view) / (unit if model == "ortho" else 1)
        K = [[focal, 0, 32], [0, focal, 32], [0, 0, 1]]
        focus = [3.5, np.inf, 4.5][view % 3] * unit
        opening = Aperture((0.05 + 0.01 * view) * unit, focus, [0.0, 2e-3][view % 2] * unit)
        aperture = opening if lens and model == "pinhole" else None
        made.append(Camera((64, 64), K, pose, model, aperture))
    return made


def changed(camera, *, shift=(0, 0, 0), focal=0.0, radius=0.0, focus=0.0):
    """A camera that was shifted without turning, or whose lens was changed."""
    view = camera.view.copy()
    view[:3, 3] -= view[:3, :3] @ shift
    aperture = camera.aperture
    if aperture is not None:
        aperture = Aperture(aperture.radius + radius, aperture.focus + focus, aperture.wavelength)
    return Camera(camera.size, camera.K + np.diag([focal, focal, 0]), view, camera.model, aperture)
