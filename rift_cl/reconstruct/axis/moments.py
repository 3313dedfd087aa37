"""The centre of mass of every view, which follows a sinusoid about the axis.

The mass of a view is that of the object, and its centre of mass lies at ``c + x cos(angle) +
y sin(angle)``, where (x, y) is the object's: the first two of the consistency conditions of
Helgason and Ludwig (Natterer, The Mathematics of Computerized Tomography, II.4). They need no
opposite views, but all of the object in every view, and air at zero. Whether mass stays the same
from view to view tells of the former; bins that the object never reaches tell of the latter, and
what their level would do to the centre is part of its error.

Limited angles have nothing else to go by. For half turns it is a second opinion that owes nothing
to the first, and the surer one where noise is strong, since it is told by the lowest frequencies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Most by which the mass may vary between views, as a share of it, beyond what noise explains.
_MASS = 0.02
# Share of the greatest mean line integral above which a bin sees the object, in addition to so many
# standard deviations of the noise of that mean; margin in bins.
_OBJECT, _SURE, _MARGIN = 0.02, 3.5, 6
# Bins of such a mean, and the share of the views in it.
_ACROSS, _AROUND = 5, 1 / 40
# Least number of bins on either side of the object that tell the level of air.
_AIR = 4
# Groups of neighbouring views whose disagreement tells the error, and whose mean centres must lie
# on the sinusoid.
_GROUPS, _PARTS = 12, 24
# By how much these may leave it: bins, a share of the detector, and so many standard errors.
_OFF, _OFF_SHARE, _OFF_SURE = 0.4, 5e-4, 4.0


class MassCenter(NamedTuple):
    """The axis that centres of mass turn about, in bins.

    Args:
        center: its bin.
        error: the standard error of that, what air may add included.
    """

    center: float
    error: float

    def scores(self, centers: Floats) -> Floats:
        """Log-likelihood of trial centres, 0 at the best."""
        return -(((centers - self.center) / self.error) ** 2) / 2


def mass_center(views: NDArray[np.float32], angles: Floats) -> MassCenter | None:
    """The axis that the centres of mass turn about.

    Args:
        views: line integrals of one row, (angle, bin), whole in every view.
        angles: in radians.

    Returns:
        Its bin and how sure that is; None where mass is not the same in all views.
    """
    path = _path(views, angles)
    if path is None:
        return None
    views, noise, seen, mass, centers, inverse, left = path
    places, center = np.arange(views.shape[1]), float(inverse[0] @ centers)
    # Sums over groups of neighbours, so that residuals that go together count together.
    groups = np.array_split(inverse[0] * left, min(_GROUPS, len(left)))
    free = len(left) / max(len(left) - 3, 1)
    error = max(
        np.sqrt(sum(group.sum() ** 2 for group in groups)),
        float(np.linalg.norm(inverse[0])) * float(left.std()) * np.sqrt(free),
    )
    # What a level that each bin adds to all views would do to the centre.
    pull = inverse[0] @ (seen * (places - centers[:, None]) / mass[:, None])
    return MassCenter(center, float(np.hypot(error, _air_error(views, seen, pull, noise))))


def mass_doubt(views: NDArray[np.float32], angles: Floats) -> str:
    """What the centres of mass of a row of parallel rays have against its angles.

    Args:
        views: line integrals of one row, (angle, bin), whole in every view.
        angles: in radians.

    Returns:
        The end of a sentence; empty where they lie on a sinusoid, or mass is not the same in all
        views.
    """
    path = _path(views, angles)
    if path is None or len(views) < 2 * _PARTS:
        return ""
    spread = path.noise * path.seen.sum(axis=1).mean() ** 1.5 / np.sqrt(12) / path.mass.mean()
    parts = np.array([part.mean() for part in np.array_split(path.left, _PARTS)])
    off = float(np.sqrt(np.mean(parts**2)))
    sure = _OFF_SURE * spread * np.sqrt(_PARTS / len(views))
    if not off > max(_OFF, _OFF_SHARE * views.shape[1], sure):
        return ""
    return (
        "the centres of mass of the views leave the sinusoid that those of a turning object follow "
        f"by {off:.2g} bins (root mean square): the angles are not those of the views, or the "
        "object moved during the scan"
    )


class _Path(NamedTuple):
    """The centres of mass of views, sorted by their angles.

    Args:
        views: the line integrals.
        noise: standard deviation of their noise.
        seen: the bins of each view that the object reaches.
        mass: of each view.
        centers: of mass, in bins.
        inverse: the pseudo-inverse of the sinusoid's model.
        left: what the best sinusoid leaves of the centres.
    """

    views: NDArray[np.float32]
    noise: float
    seen: NDArray[np.bool_]
    mass: Floats
    centers: Floats
    inverse: Floats
    left: Floats


def _path(views: NDArray[np.float32], angles: Floats) -> _Path | None:
    """None where mass is not the same in all views."""
    order = np.argsort(angles, kind="stable")
    views, angles = views[order], angles[order]
    noise = _noise(views)
    seen, places = _seen(views, noise), np.arange(views.shape[1])
    part = np.where(seen, views, 0).astype(float)
    mass = part.sum(axis=1)
    mean = float(mass.mean())
    if not mean > 0:
        return None
    spread = noise * np.sqrt(seen.sum(axis=1).mean())
    if mass.std() > np.hypot(_MASS * mean, 2 * spread):
        return None
    centers = (part @ places) / mass
    model = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=1)
    inverse = np.linalg.pinv(model)
    left = centers - model @ (inverse @ centers)
    return _Path(views, noise, seen, mass, centers, inverse, left)


def _air_error(
    views: NDArray[np.float32], seen: NDArray[np.bool_], pull: Floats, noise: float
) -> float:
    """What the level of air, and bins that are off by themselves, may do to the centre.

    Both are read from the bins that the object never reaches, or from the outermost where there are
    none: what is seen there must not decide. The level is taken to go on as a straight line
    underneath the object.
    """
    mean = views.mean(axis=0, dtype=float)
    reached = np.flatnonzero(seen.any(axis=0))
    first, last = reached[0], reached[-1]
    sides = mean[: max(first, _AIR)], mean[min(last + 1, mean.size - _AIR) :]
    across = (np.arange(mean.size) - first) / max(last - first, 1)
    pulls = np.array([pull @ (1 - across), pull @ across])
    levels = np.array([side.mean() for side in sides])
    single = np.sqrt(np.mean([side.var(ddof=1) for side in sides]))
    doubts = single * pulls / np.sqrt([side.size for side in sides])
    rings = np.sqrt(max(single**2 - noise**2 / len(views), 0.0)) * np.linalg.norm(pull)
    return float(np.linalg.norm([pulls @ levels, *doubts, rings]))


def _seen(views: NDArray[np.float32], noise: float) -> NDArray[np.bool_]:
    """The bins of each view from one end of the object to the other; all if nothing is seen.

    What noise hides is not seen; ends are therefore the furthest of neighbouring views.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter

    around = max(3, round(_AROUND * len(views)))
    level = uniform_filter(views, (around, _ACROSS), mode="nearest")
    over = level > _OBJECT * level.max() + _SURE * noise / np.sqrt(around * _ACROSS)
    some, last = over.any(axis=1), views.shape[1] - 1
    left = np.where(some, over.argmax(axis=1), 0)
    right = np.where(some, last - over[:, ::-1].argmax(axis=1), last)
    left = minimum_filter1d(left, around, mode="nearest") - _MARGIN
    right = maximum_filter1d(right, around, mode="nearest") + _MARGIN
    bins = np.arange(views.shape[1])
    seen: NDArray[np.bool_] = (bins >= left[:, None]) & (bins <= right[:, None])
    return seen


def _noise(views: NDArray[np.float32]) -> float:
    """Standard deviation of noise, from second differences between views."""
    if len(views) < 3:
        return 0.0
    bends = views[2:] - 2 * views[1:-1] + views[:-2]
    return float(np.median(np.abs(bends)) / 0.6745 / np.sqrt(6))
