"""What limits the detail of a target: pixels, diffraction, depth of field, or the number of views.

Each camera ends at a point of the target where the first of three ends:

- pixel: half a cycle a pixel, 1 / (2 a), beyond which detail is folded back;
- diffraction and depth of field: where either passes a tenth of the contrast alone; defocus of less
  than 0.54 wavelengths does so nowhere;

and earlier where they weaken the same detail: where their product with the pixel's own passes a
tenth. There the cause is the one that passes least. A set of views tells a direction of frequency
up to where the best of its cameras ends whose slice, 1 / D thick, holds that frequency: a slice at
an angle to it holds it up to 1 / (2 D sin(angle)). What nine tenths of all directions reach is the
detail of the set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.optics.optical_transfer import optical_transfer
from rift_cl.sampling.coverage.work import Views, looks_at
from rift_cl.sampling.criteria.orlov import frequency_directions, runs
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
CAUSES = ("pixel", "diffraction", "depth of field", "number of views")
UNSEEN = "field of view"
# The contrast at which detail ends, and where diffraction and a disc of defocus pass it: in
# cut-offs, and in cycles per diameter of the disc.
_CONTRAST, _DIFFRACTION, _DEFOCUS = 0.1, 0.80538, 1.08854
# Steps in which the end is looked for, and the share of directions that a set must tell.
_STEPS, _MOST = 256, 0.9
# A direction is seen if it is told up to so many cycles per diameter.
_SEEN = 8.0
# A direction that lies in a slice to rounding.
_LEAST = 1e-9


@dataclass(frozen=True, eq=False)
class Limits:
    """Frequencies, in cycles per unit of length, at which detail ends; inf for no end.

    Args:
        pixel: (V, P) each camera's by its pixels; 0 where it does not see the point, as are the
            next three.
        diffraction: (V, P) by diffraction.
        focus: (V, P) by depth of field.
        camera: (V, P) by all three together.
        first: (V, P) which of ``CAUSES`` ends the camera, -1 where nothing does.
        number: (P,) the set's, if its cameras were perfect.
        reached: (P,) the set's as it is; 0 where no camera sees the point.
        unseen: (P,) share of directions that no view tells up to eight cycles per diameter.
        within: (P,) what half of the other directions reach; 0 where there are none.
        cause: (P,) what ends it, one of ``CAUSES``, or ``UNSEEN``.
    """

    pixel: Floats
    diffraction: Floats
    focus: Floats
    camera: Floats
    first: NDArray[np.intp]
    number: Floats
    reached: Floats
    unseen: Floats
    within: Floats
    cause: tuple[str, ...]

    @property
    def length(self) -> Floats:
        """(P,) one cycle of the finest detail that the set tells."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / self.reached)

    def camera_cause(self, point: int = 0) -> tuple[str, ...]:
        """(V,) what ends each camera's detail at a point; empty text where nothing does.

        So it is for a camera that passes any detail, and for one that does not see the point.
        """
        return tuple(CAUSES[f] if f >= 0 else "" for f in self.first[:, point])

    @property
    def sentence(self) -> str:
        """The finding for a reader, at the point where it is worst."""
        worst = int(np.argmin(self.reached))
        observed = self.camera[:, worst] > 0
        if not observed.any():
            return f"No picture shows point {worst} of the target, so that nothing is known of it."
        one = float(np.median(self.camera[observed, worst]))
        where = "" if len(self.reached) == 1 else f" at point {worst}, the worst,"
        best = "any detail" if one == np.inf else f"{one:.3g} cycles per unit"
        return (
            f"The {self.cause[worst]} limits detail{where} to {self.reached[worst]:.3g} cycles per "
            f"unit, a length of {self.length[worst]:.3g}: one camera passes {best}, perfect "
            f"cameras in these places would tell {self.number[worst]:.3g}."
        )


def limits(views: Views, target: Target, *, weights: ArrayLike | None = None) -> Limits:
    """What limits detail at each point of a target.

    Args:
        views: cameras, a parallel scan about z, or ``Observations`` at the target's points.
        target: its points and diameter.
        weights: (V,) relative photons of cameras; a camera of weight 0 does not count.

    Raises:
        ShapeError: there is no view.
        InputError: every point lies outside every picture, or a number is out of its range.
    """
    observations = looks_at(views, target, weights)
    observed = observations.weight > 0
    if not observed.any():
        observations.check_seen()
    with np.errstate(divide="ignore"):
        parts = [0.5 / observations.pixel, _DIFFRACTION * observations.cutoff, _focus(observations)]
    pixel, diffraction, focus = (np.where(observed, part, 0) for part in parts)
    camera = np.where(observed, _end(observations, np.min(parts, axis=0)), 0)
    first = np.where(observed & np.isfinite(camera), _first(observations, camera, parts[0]), -1)
    perfect, told = (
        [_told(observations, target, p, ends[:, p]) for p in range(observations.points)]
        for ends in (np.where(observed, np.inf, 0), camera)
    )
    number, reached = (np.array([_most(one) for one in found]) for found in (perfect, told))
    held = [one[one >= _SEEN / target.diameter] for one in told]
    unseen = np.array([1 - len(part) / len(one) for part, one in zip(held, told, strict=True)])
    within = np.array([float(np.median(part)) if len(part) else 0.0 for part in held])
    cause = tuple(
        _cause(number[p], camera[observed[:, p], p], first[observed[:, p], p])
        for p in range(observations.points)
    )
    return Limits(pixel, diffraction, focus, camera, first, number, reached, unseen, within, cause)


def _focus(observations: Observations) -> Floats:
    """Where the disc of defocus alone passes a tenth: the least k of blur k (1 - k / cutoff)."""
    plain = _DEFOCUS / observations.blur
    with np.errstate(invalid="ignore"):
        share = 4 * plain / observations.cutoff
    # No real root where the disc never passes so little, and none without blur.
    root = np.sqrt(1 - np.where(share <= 1, share, 1))
    return np.where(share <= 1, 2 * plain / (1 + root), np.inf)


def _first(observations: Observations, camera: Floats, pixel: Floats) -> NDArray[np.intp]:
    """(V, P) what passes least where each camera ends; pixels where that is half their cycle."""
    k = np.where(np.isfinite(camera), camera, 0)
    square = optical_transfer(k, observations.pixel, np.inf, 0).value
    light = optical_transfer(k, 0, observations.cutoff, 0).value
    both = optical_transfer(k, 0, observations.cutoff, observations.blur).value
    disc = both / np.where(light > 0, light, 1)
    first = np.argmin([square, light, disc], axis=0)
    return np.where(camera >= pixel * (1 - 1e-9), 0, first)


def _cause(number: float, camera: Floats, first: NDArray[np.intp]) -> str:
    """What ends a set's detail at a point, by the cameras that see it."""
    if not len(camera):
        return UNSEEN
    if number <= np.median(camera):
        return CAUSES[3]
    return CAUSES[int(np.argmax(np.bincount(first[first >= 0])))]


def _end(observations: Observations, first: Floats) -> Floats:
    """Where the product of all optics first passes a tenth, at most at the first of the ends."""
    ends = first.copy()
    view, point = np.nonzero(np.isfinite(first))
    steps = np.arange(1, _STEPS + 1) / _STEPS
    for part in runs(len(view), _STEPS):
        at = view[part], point[part]
        k = first[at][:, None] * steps
        optics = (
            values[at][:, None]
            for values in (observations.pixel, observations.cutoff, observations.blur)
        )
        passed = optical_transfer(k, *optics).value
        below = passed < _CONTRAST
        last = np.where(below.any(1), np.argmax(below, axis=1), _STEPS - 1)
        row = np.arange(len(last))
        # The contrast is level before the first step; between two steps it is taken as straight.
        after = passed[row, last]
        before = np.where(last > 0, passed[row, last - 1], 1)
        back = np.where(after < _CONTRAST, (_CONTRAST - after) / (before - after), 0)
        ends[at] = first[at] * (last + 1 - back) / _STEPS
    return ends


def _most(told: Floats) -> float:
    """The frequency that most directions are told up to."""
    return float(np.quantile(told, 1 - _MOST))


def _told(observations: Observations, target: Target, point: int, ends: Floats) -> Floats:
    """(K,) the frequency that each direction is told up to, if the cameras' detail ends there."""
    units, directions = frequency_directions(target), observations.direction[:, point]
    best = np.empty(len(units))
    for part in runs(len(units), len(directions)):
        gaps = np.maximum(np.abs(units[part] @ directions.T), _LEAST)
        best[part] = np.minimum(0.5 / (target.diameter * gaps), ends).max(1)
    return best
