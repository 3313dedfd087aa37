"""Density compensation: what each view of a set of directions stands for at each frequency.

A view of a parallel scan samples the image's spectrum along a line through zero. Weighted by the
ramp |k|, times the share of the half-circle that it stands for, it gives filtered backprojection.
An object of diameter D, however, ties together what lies within 1 / D in the spectrum, and nothing
beyond: of a gap that is wider than that at frequency k, the views beside it know the strip of
width 1 / D alone (Crowther, DeRosier and Klug 1970). The share therefore depends on frequency:

- ``capped_voronoi``: half the gap to either neighbour, none counted beyond 1 / (D |k|);
- ``exact``: one over the overlap of strips of width 1 / D about all lines, the filter of Harauz and
  van Heel (Optik 73, 1986) and Radermacher (1988), here for lines in a plane;
- ``pipe_menon``: the same overlap, weighted by the shares themselves and iterated until it is level
  (Pipe and Menon, Magn. Reson. Med. 41, 1999).

Two laws hold for all. Directions that lie evenly get pi / n at every frequency, the plain ramp,
whatever D is: to that end a gap counts up to the mean gap at least. And at each frequency all
shares together are the part of the half-circle that is known by these rules, pi at frequency zero:
without this the filter made of overlaps, which does not vanish there, would be too heavy at the
low end. Shares are (views, frequencies), in radians; views of the same or opposite direction share
alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.filters.directions import Directions

Floats = NDArray[np.float64]

# The overlap of Pipe and Menon's shares is level when it varies by no more than this; clusters get
# there slowly, and beyond some steps noise grows more than the level gains.
LEVEL, MOST_STEPS = 0.02, 12
# Overlaps are computed at frequencies this far apart, in units of 1 / D, or by this share of
# themselves, whichever is more, and interpolated between.
_STEP, _RATIO = 0.25, 0.02


def capped_voronoi(directions: Directions, frequencies: Floats, diameter: float) -> Floats:
    """Half of both gaps beside each direction, capped at 1 / (D |k|), (n, frequencies)."""
    cap = 1 / np.maximum(diameter * np.abs(frequencies), 1e-300)
    cap = np.maximum(cap, np.pi / len(directions))
    # Half a gap is the same for the views on either side of it.
    halves = np.minimum(directions.gaps[:, None], cap) / 2
    shares: Floats = halves + np.roll(halves, 1, axis=0)
    return shares


def exact(directions: Directions, frequencies: Floats, diameter: float) -> Floats:
    """In inverse proportion to the overlap of strips of width 1 / D, (n, frequencies)."""

    def shares(overlap: Callable[[Floats], Floats]) -> Floats:
        return 1 / overlap(np.ones(len(directions)))

    return _from_overlaps(directions, frequencies, diameter, shares)


def pipe_menon(directions: Directions, frequencies: Floats, diameter: float) -> Floats:
    """Such that strips of width 1 / D, weighted by them, overlap evenly, (n, frequencies).

    Shares w become w / overlap(w) until the overlap is level to 2 %, or 12 times. The kernel,
    the overlap of two strips, is that of ``exact``, which is the first step.
    """

    def shares(overlap: Callable[[Floats], Floats]) -> Floats:
        found = np.ones(len(directions))
        for _ in range(MOST_STEPS):
            covered = overlap(found)
            covered /= np.mean(covered)
            if np.abs(covered - 1).max() <= LEVEL:
                break
            found = found / covered
        return found

    return _from_overlaps(directions, frequencies, diameter, shares)


def _from_overlaps(
    directions: Directions,
    frequencies: Floats,
    diameter: float,
    shares: Callable[[Callable[[Floats], Floats]], Floats],
) -> Floats:
    """Shares from overlaps at a few frequencies, in the total of ``capped_voronoi``."""
    knots = _knots(float(np.abs(frequencies).max(initial=0)) * diameter)
    table = np.empty((len(directions), len(knots)))
    neighbours = _Neighbours(directions)
    for index, steepness in enumerate(knots):
        neighbours.within(float(steepness))
        table[:, index] = shares(neighbours.overlap)
    table /= table.sum(0)
    total = capped_voronoi(directions, frequencies, diameter).sum(0)
    found = np.empty((len(directions), len(frequencies)))
    for row, values in zip(found, table, strict=True):
        row[:] = total * np.interp(np.abs(frequencies) * diameter, knots, values)
    return found


def _knots(last: float) -> Floats:
    """D k from 0 to ``last``, spaced evenly, then in proportion to itself."""
    turn = min(_STEP / _RATIO, last)
    even = np.linspace(0, turn, int(np.ceil(turn / _STEP)) + 1)
    if last <= turn:
        return even
    steps = int(np.ceil(np.log(last / turn) / _RATIO))
    return np.concatenate([even, turn * (last / turn) ** (np.arange(1, steps + 1) / steps)])


class _Neighbours:
    """Sums over the directions about each, by differences of running sums.

    The overlap of unit strips about two lines, at distance D k along one of them, is
    1 - D k |sin(angle between)|, or none. In a window in which the sine keeps its sign on either
    side, it is a sum of weights and of their products with sines and cosines, so that n directions
    cost n steps in place of n^2.
    """

    def __init__(self, directions: Directions) -> None:
        self._angles, self._count = directions.angles, len(directions)
        # Half a turn before and behind, so that every window lies within.
        turns = [self._angles - np.pi, self._angles, self._angles + np.pi]
        self._around = np.concatenate(turns)
        self._sines, self._cosines = np.sin(self._around), np.cos(self._around)
        self._middle = np.arange(self._count, 2 * self._count)
        self.within(0)

    def within(self, steepness: float) -> None:
        """Look at frequency k = ``steepness`` / D from now on."""
        self._steepness = steepness
        reach = np.arcsin(1 / steepness) if steepness > 1 else np.pi / 2
        self._low = np.searchsorted(self._around, self._angles - reach)
        self._high = np.searchsorted(self._around, self._angles + reach, side="right")
        if steepness <= 1:
            # Every direction once, be it on this or that side of a right angle.
            self._high = self._low + self._count

    def overlap(self, weights: Floats) -> Floats:
        """The weighted overlap of all strips with each, (n,)."""
        around = np.tile(weights, 3)
        below, above = self._sums(around)
        below_sine, above_sine = self._sums(around * self._sines)
        below_cosine, above_cosine = self._sums(around * self._cosines)
        middle = self._middle
        sine, cosine = self._sines[middle], self._cosines[middle]
        distances = sine * (below_cosine - above_cosine) - cosine * (below_sine - above_sine)
        overlap: Floats = below + above - self._steepness * distances
        return overlap

    def _sums(self, values: Floats) -> tuple[Floats, Floats]:
        """Sums over the window before each direction, and from it to the window's end."""
        running = np.concatenate([[0], np.cumsum(values)])
        middle = running[self._middle]
        return middle - running[self._low], running[self._high] - middle


COMPENSATIONS: dict[str, Callable[[Directions, Floats, float], Floats]] = {
    "capped-voronoi": capped_voronoi,
    "pipe-menon": pipe_menon,
    "exact": exact,
}


@dataclass(frozen=True, init=False, eq=False)
class Compensation:
    """The gains of a ``ViewFilter``: a function of frequencies to (views, frequencies).

    Args:
        angles: (views,) radians, any order; kept as their distinct directions.
        kind: ``capped-voronoi``, ``pipe-menon`` or ``exact``.
        diameter: of the object, in the unit whose inverse frequencies are given in.

    Raises:
        InputError: the kind is unknown, an angle is no finite number, or the diameter no length.
    """

    directions: Directions
    kind: str
    diameter: float

    def __init__(self, angles: ArrayLike, kind: str, diameter: float) -> None:
        """Check the arguments and find the distinct directions."""
        if kind not in COMPENSATIONS:
            names = ", ".join(map(repr, COMPENSATIONS))
            raise InputError(f"compensate is {kind!r}, wanted one of {names}")
        if not 0 < one_number(diameter) < np.inf:
            raise InputError(f"diameter is {diameter!r}, wanted the object's, a positive length")
        object.__setattr__(self, "directions", Directions.of(angles))
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "diameter", float(diameter))

    def __call__(self, frequencies: Floats) -> Floats:
        """Shares of the half-circle in radians, (views, frequencies)."""
        found = COMPENSATIONS[self.kind](self.directions, frequencies, self.diameter)
        return self.directions.share(found)
