"""What limits the detail of an opaque surface: pixels, diffraction, depth of field; and its depth.

Every picture of a surface tells all of what it resolves there, so that the number of views limits
no detail. Depth comes from parallax: where the lines of sight of two views differ by an angle t, a
pixel of parallax is a pixel's edge over 2 tan(t / 2) of depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.sampling.coverage.work import Views, looks_at
from rift_cl.sampling.criteria.limits import CAUSES, UNSEEN, limits
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Views farther apart than a right angle see little in common of a surface.
_MOST = np.pi / 2


@dataclass(frozen=True, eq=False)
class SurfaceLimits:
    """Frequencies, in cycles per unit of length, at which detail of a surface ends; inf for no end.

    Args:
        pixel: (P,) by pixels, of the middle one of the cameras that see the point.
        diffraction: (P,) by diffraction.
        focus: (P,) by depth of field.
        reached: (P,) by all together; 0 where no camera sees the point.
        cause: (P,) what ends it: pixel, diffraction, depth of field, or ``limits.UNSEEN``.
        parallax: (P,) radians, the largest angle between lines of sight, a right angle at most.
        depth: (P,) a pixel of parallax, in units of length; inf where there is none.
    """

    pixel: Floats
    diffraction: Floats
    focus: Floats
    reached: Floats
    cause: tuple[str, ...]
    parallax: Floats
    depth: Floats


def surface_limits(
    views: Views, target: Target, *, weights: ArrayLike | None = None
) -> SurfaceLimits:
    """What limits the detail of a surface at each point of a target; arguments as ``limits``.

    Raises:
        ShapeError: there is no view.
        InputError: every point lies outside every picture, or a number is out of its range.
    """
    observations = looks_at(views, target, weights)
    found = limits(observations, target)
    points = range(observations.points)
    observed = [observations.weight[:, p] > 0 for p in points]
    pixel, diffraction, focus, camera = (
        np.array(
            [float(np.median(end[observed[p], p])) if observed[p].any() else 0.0 for p in points]
        )
        for end in (found.pixel, found.diffraction, found.focus, found.camera)
    )
    parallax = np.array([_parallax(observations.direction[observed[p], p]) for p in points])
    with np.errstate(divide="ignore"):
        # Half a cycle is a pixel.
        depth = 0.5 / (pixel * 2 * np.tan(parallax / 2))
    cause = tuple(_cause(found.first[observed[p], p]) for p in points)
    return SurfaceLimits(pixel, diffraction, focus, camera, cause, parallax, depth)


def _parallax(directions: Floats) -> float:
    if len(directions) < 2:
        return 0.0
    least = float((directions @ directions.T).min())
    return min(float(np.arccos(np.clip(least, -1, 1))), float(_MOST))


def _cause(first: NDArray[np.intp]) -> str:
    if not len(first):
        return UNSEEN
    told = first[first >= 0]
    return CAUSES[int(np.argmax(np.bincount(told)))] if len(told) else CAUSES[0]
