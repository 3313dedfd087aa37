"""Limited angles: the centre of mass of every view, which follows a sinusoid about the axis.

The mass of a view is that of the object, and its centre of mass lies at ``c + x cos(angle) +
y sin(angle)``, where (x, y) is the object's: the first two of the consistency conditions of
Helgason and Ludwig (Natterer, The Mathematics of Computerized Tomography, II.4). They need no
opposite views, but all of the object in every view, and air at zero; whether mass stays the same
from view to view tells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Most by which the mass may vary between views, as a share of it, beyond what noise explains.
_MASS = 0.02
# Share of the greatest mean line integral above which a bin sees the object; margin in bins.
_OBJECT, _MARGIN = 0.02, 2
# Groups of neighbouring views whose disagreement tells the error.
_GROUPS = 12


def mass_center(views: NDArray[np.float32], angles: Floats) -> tuple[float, float] | None:
    """The axis that the centres of mass turn about.

    Args:
        views: line integrals of one row, (angle, bin), whole in every view.
        angles: in radians.

    Returns:
        Its bin and the standard error of that; None where mass is not the same in all views.
    """
    bins = _object_bins(views)
    part, places = views[:, bins].astype(float), np.arange(views.shape[1])[bins]
    mass = part.sum(axis=1)
    mean = float(mass.mean())
    if not mean > 0:
        return None
    noise = _noise(views) * np.sqrt(places.size)
    if mass.std() > np.hypot(_MASS * mean, 2 * noise):
        return None
    centers = (part @ places) / mass
    model = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=1)
    inverse = np.linalg.pinv(model)
    center = float(inverse[0] @ centers)
    left = centers - model @ (inverse @ centers)
    # Sums over groups of neighbours, so that residuals that go together count together.
    order = np.argsort(angles, kind="stable")
    groups = np.array_split((inverse[0] * left)[order], min(_GROUPS, len(order)))
    free = len(order) / max(len(order) - 3, 1)
    error = max(
        np.sqrt(sum(group.sum() ** 2 for group in groups)),
        float(np.linalg.norm(inverse[0])) * float(left.std()) * np.sqrt(free),
    )
    return center, float(error)


def _object_bins(views: NDArray[np.float32]) -> NDArray[np.intp]:
    from scipy.ndimage import uniform_filter

    level = uniform_filter(views, (9, 3), mode="nearest").max(axis=0)
    floor = _OBJECT * level.max() + 4 * _noise(views) / np.sqrt(27)
    seen = np.flatnonzero(level > floor)
    if not seen.size:
        return np.arange(views.shape[1])
    return np.arange(max(0, seen[0] - _MARGIN), min(views.shape[1], seen[-1] + 1 + _MARGIN))


def _noise(views: NDArray[np.float32]) -> float:
    """Standard deviation of noise, from second differences between views."""
    if len(views) < 3:
        return 0.0
    bends = views[2:] - 2 * views[1:-1] + views[:-2]
    return float(np.median(np.abs(bends)) / 0.6745 / np.sqrt(6))
