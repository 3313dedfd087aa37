"""What limits the detail of a target: pixels, diffraction, depth of field, or the number of views.

Each camera ends at a point of the target where the first of three ends:

- pixel: half a cycle a pixel, 1 / (2 a), beyond which detail is folded back;
- diffraction and depth of field: where either passes a tenth of the contrast alone;

and a little earlier where both weaken the same detail: where their product with the pixel's own
passes a tenth. A set of views tells a direction of frequency up to where the best of its cameras
ends whose slice, 1 / D thick, holds that frequency: a slice at an angle to it holds it up to
1 / (2 D sin(angle)). What nine tenths of all directions reach is the detail of the set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.reference.coverage import optical_transfer
from rift_cl.sampling.coverage_work import Views, looks_at
from rift_cl.sampling.looks import Looks
from rift_cl.sampling.orlov import frequency_directions, runs
from rift_cl.sampling.target import Target

Floats = NDArray[np.float64]
CAUSES = ("pixel", "diffraction", "depth of field", "number of views")
UNSEEN = "field of view"
# The contrast at which detail ends, and where diffraction and a disc of defocus pass it: in
# cut-offs, and in cycles per diameter of the disc.
_CONTRAST, _DIFFRACTION, _DEFOCUS = 0.1, 0.8054, 1.0885
# Steps in which the end is looked for, and the share of directions that a set must tell.
_STEPS, _MOST = 256, 0.9
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
        number: (P,) the set's, if its cameras were perfect.
        reached: (P,) the set's as it is; 0 where no camera sees the point.
        cause: (P,) what ends it, one of ``CAUSES``, or ``UNSEEN``.
    """

    pixel: Floats
    diffraction: Floats
    focus: Floats
    camera: Floats
    number: Floats
    reached: Floats
    cause: tuple[str, ...]

    @property
    def length(self) -> Floats:
        """(P,) one cycle of the finest detail that the set tells."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / self.reached)

    def camera_cause(self, point: int = 0) -> tuple[str, ...]:
        """(V,) what ends each camera's detail at a point; empty text where it sees nothing."""
        three = np.stack([self.pixel, self.diffraction, self.focus])[:, :, point]
        first = np.argmin(three, axis=0)
        blind = self.camera[:, point] == 0
        return tuple("" if b else CAUSES[f] for b, f in zip(blind, first, strict=True))

    @property
    def sentence(self) -> str:
        """The finding for a reader, at the point where it is worst."""
        worst = int(np.argmin(self.reached))
        seen = self.camera[:, worst] > 0
        if not seen.any():
            return f"No picture shows point {worst} of the target, so that nothing is known of it."
        one = float(np.median(self.camera[seen, worst]))
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
        views: cameras, a parallel scan about z, or ``Looks`` at the target's points.
        target: its points and diameter.
        weights: (V,) relative photons of cameras; a camera of weight 0 does not count.

    Raises:
        ShapeError: there is no view.
        InputError: every point lies outside every picture, or a number is out of its range.
    """
    looks = looks_at(views, target, weights)
    seen = looks.weight > 0
    if not seen.any():
        looks.require_seen()
    with np.errstate(divide="ignore"):
        parts = [0.5 / looks.pixel, _DIFFRACTION * looks.cutoff, _DEFOCUS / looks.blur]
    pixel, diffraction, focus = (np.where(seen, part, 0) for part in parts)
    camera = np.where(seen, _end(looks, np.min(parts, axis=0)), 0)
    told = [
        [_told(looks, target, p, ends[:, p]) for p in range(looks.points)]
        for ends in (np.where(seen, np.inf, 0), camera)
    ]
    number, reached = np.array(told)
    ends = (pixel, diffraction, focus, camera)
    cause = tuple(
        _cause(number[p], *(end[seen[:, p], p] for end in ends)) for p in range(looks.points)
    )
    return Limits(pixel, diffraction, focus, camera, number, reached, cause)


def _cause(number: float, pixel: Floats, diffraction: Floats, focus: Floats, camera: Floats) -> str:
    """What ends a set's detail at a point, by the ends of the cameras that see it."""
    if not len(camera):
        return UNSEEN
    if number <= np.median(camera):
        return CAUSES[3]
    return CAUSES[int(np.argmin([np.median(end) for end in (pixel, diffraction, focus)]))]


def _end(looks: Looks, first: Floats) -> Floats:
    """Where the product of all optics first passes a tenth, at most at the first of the ends."""
    ends = first.copy()
    view, point = np.nonzero(np.isfinite(first))
    steps = np.arange(1, _STEPS + 1) / _STEPS
    for part in runs(len(view), _STEPS):
        at = view[part], point[part]
        k = first[at][:, None] * steps
        optics = (values[at][:, None] for values in (looks.pixel, looks.cutoff, looks.blur))
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


def _told(looks: Looks, target: Target, point: int, ends: Floats) -> float:
    """The frequency that most directions are told up to, if the cameras' detail ends there."""
    units, directions = frequency_directions(target), looks.direction[:, point]
    best = np.empty(len(units))
    for part in runs(len(units), len(directions)):
        gaps = np.maximum(np.abs(units[part] @ directions.T), _LEAST)
        best[part] = np.minimum(0.5 / (target.diameter * gaps), ends).max(1)
    return float(np.quantile(best, 1 - _MOST))
