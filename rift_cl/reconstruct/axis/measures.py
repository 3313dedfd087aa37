"""How one row is searched: which views are compared, where, and at what size.

A search begins with few wide bins, all over the detector, and ends with narrow ones at the best
place. Where the object leaves the field of view, the part of the detector that counts depends on
the centre that is tried, so that several places are followed until they settle, and the likeliest
is compared with the best of the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.double_wedge import wedge_evidence
from rift_cl.reconstruct.axis.evidence import Evidence
from rift_cl.reconstruct.axis.moments import MassCenter, mass_center
from rift_cl.reconstruct.axis.opposite_views import (
    Pairs,
    enough_pairs,
    mirror_scores,
    pair_evidence,
)
from rift_cl.reconstruct.axis.views import Row, Views, binned, evenly, is_cut

Floats = NDArray[np.float64]

# The widest gap between neighbouring directions of a half turn, and what may lack of it, radians.
_GAP, _SLACK = np.deg2rad(7.0), np.deg2rad(3.0)
# The least that limited angles go round, in radians.
_LIMITED = np.deg2rad(60.0)
# Where the axis of a half turn is looked for: from this share of the detector to as far from its
# other end. The least overlap of opposite views, as a share of the detector and in bins.
_HALF, _OVERLAP, _OVERLAP_BINS = 0.2, 0.03, 8
# Bins that the coarse and the fine search work with, about, and views for each of them.
_COARSE, _FINE, _VIEWS = 256, 512, 1.4
# Distance of windows about trial centres, as a share of the detector.
_WINDOWS = 1 / 32
# Step of trial centres all over the detector, next to the best and, as views without noise tell
# centres so sharply, next to the best of these, in bins of the row; and how far the second go.
_STEP, _NARROW, _SHARP, _REACH = 0.25, 0.1, 0.005, 2.0
# Places that are followed, and their least distance as a share of the detector.
_FOLLOWED, _APART = 8, 0.012
# How far to either side of a place the fine search begins, in bins of the row.
_SIDES = 1.5
# Most rounds in which a place is followed, the change that ends it and the longest jump, in bins.
_ROUNDS, _SETTLED, _JUMP = 8, 0.004, 2.0
# Changes that shrink by a factor in this range are taken to the end of their series at once.
_SLOW = (0.2, 0.95)
# Most by which wedge and centre of mass may differ to be averaged, in standard errors of that.
_AGREE = 3.0
_WEDGE, _MASS = "double wedge", "centre of mass"


Look = Callable[[float, float], Evidence]


class RowAxis(NamedTuple):
    """What one row tells of the axis.

    Args:
        center: in bins of the detector.
        error: its standard error.
        score: log-likelihood of the centre; infinite where that is not known.
        rival: the greatest one anywhere else.
        coherence: the score as a share of what it were if all frequencies agreed.
        evidence: what the row says near the centre, where it is told by frequencies.
        by: the measure that found it.
        mass: what the centres of mass say, where they are part of the answer.
        drift: the standard error that all rows have in common, as the axis moved during the scan.
    """

    center: float
    error: float
    score: float
    rival: float
    coherence: float
    evidence: Evidence | None
    by: str
    mass: MassCenter | None = None
    drift: float = 0.0


class Measure(Protocol):
    """A method that estimates the axis of one row."""

    def find(self, views: Views) -> RowAxis | None:
        """The axis of a row, (angle, bin); None where this measure does not apply to it."""


class OppositeViews:
    """Registration of opposite views.

    Args:
        pairs: which views are opposite.
        span: where to search, in bins of the detector; all of it but the ends if None.
        seen: (view, 2) the first and the last bin that each view holds; all of them if None.
    """

    def __init__(
        self, pairs: Pairs, span: tuple[float, float] | None, seen: Floats | None = None
    ) -> None:
        self._pairs, self._span, self._seen = pairs, span, seen

    def find(self, views: Views) -> RowAxis | None:
        """The axis of a row."""
        bins = views.shape[1]
        least = max(_OVERLAP_BINS, _OVERLAP * bins) / 2
        low, high = self._span or (least, bins - 1 - least)
        count = _binning(bins, _FINE)
        row = Row(binned(views, count), count, is_cut(views))
        if self._seen is not None:
            row = replace(row, seen=row.place(self._seen))
        centers, scores = mirror_scores(row, self._pairs, row.place(low), row.place(high))
        starts = _peaks(row.detector(centers), scores, _APART * bins)
        if not len(starts):
            return None
        best = _best([self._settled(row, start) for start in starts], bins)
        return best._replace(
            drift=0.0 if best.evidence is None else best.evidence.drift(best.center)
        )

    def _settled(self, row: Row, start: float) -> RowAxis:
        def look(window: float, near: float) -> Evidence:
            return pair_evidence(row, self._pairs, window, near)

        return _followed(row, look, start, "opposite views")


class DoubleWedge:
    """The double wedge of a half turn.

    Args:
        angles: of the views, in radians.
        start: the direction at which the half turn begins.
        span: where to search, in bins of the detector; its middle part if None.
    """

    def __init__(self, angles: Floats, start: float, span: tuple[float, float] | None) -> None:
        self._angles, self._start, self._span = angles, start, span

    def find(self, views: Views) -> RowAxis | None:
        """The axis of a row."""
        bins = views.shape[1]
        low, high = self._span or (_HALF * (bins - 1), (1 - _HALF) * (bins - 1))
        cut = is_cut(views)
        coarse = self._row(views, _binning(bins, _COARSE), cut)
        centers, scores = _everywhere(coarse, low, high)
        starts = _peaks(centers, scores, _APART * bins)
        if not len(starts):
            return None
        best = _best([self._settled(coarse, start) for start in starts], bins)
        if cut or _binning(bins, _FINE) != coarse.bin:
            fine = self._fine(self._row(views, _binning(bins, _FINE), cut), best.center)
            # The rival's score in proportion, since the finer search has more to tell of both.
            share = best.rival / best.score if best.score > 0 else 0.0
            best = fine._replace(rival=fine.score * share)
        return best if cut else self._with_mass(best, views)

    def _with_mass(self, wedge: RowAxis, views: Views) -> RowAxis:
        """The mean of the wedge's answer and the centre of mass's, where they agree.

        They owe nothing to each other: one comes from frequencies above all of the object's size,
        the other from the limit of frequency zero.
        """
        mass = mass_center(views, self._angles)
        if mass is None:
            return wedge
        errors = np.array([wedge.error, mass.error])
        if not abs(mass.center - wedge.center) <= _AGREE * np.linalg.norm(errors):
            return wedge
        weights = 1 / errors**2
        center = float(weights @ [wedge.center, mass.center] / weights.sum())
        error = float(1 / np.sqrt(weights.sum()))
        return wedge._replace(center=center, error=error, by=f"{_WEDGE} and {_MASS}", mass=mass)

    def _fine(self, row: Row, center: float) -> RowAxis:
        """The centre near a place.

        Where windows hold it back it is reached from both sides, and once with views whose mean is
        kept; by how much these differ is part of the error.
        """
        if not row.cut:
            return self._settled(row, center)
        left, right = (self._settled(row, center + side * row.bin) for side in (-_SIDES, _SIDES))
        best = max(left, right, key=lambda reached: reached.score)
        other = self._settled(replace(row, level=False), best.center)
        apart = np.array([left.center, right.center, other.center]) - best.center
        return best._replace(error=float(np.hypot(best.error, np.abs(apart).max() / 2)))

    def _row(self, views: Views, count: int, cut: bool) -> Row:
        bins = views.shape[1] // count
        average = max(1, int(len(self._angles) / (_VIEWS * bins)))
        wanted = max(2, len(self._angles) // average)
        even = evenly(self._angles, self._start, np.pi, wanted, average)
        return Row(even @ binned(views, count), count, cut)

    def _settled(self, row: Row, start: float) -> RowAxis:
        def look(window: float, near: float) -> Evidence:
            return wedge_evidence(row, window, near)

        return _followed(row, look, start, _WEDGE)


class CentreOfMass:
    """The centres of mass of all views.

    Args:
        angles: of the views, in radians.
    """

    def __init__(self, angles: Floats) -> None:
        self._angles = angles

    def find(self, views: Views) -> RowAxis | None:
        """The axis of a row; None where the object leaves the field of view or changes."""
        circle = np.sort(np.mod(self._angles, 2 * np.pi))
        gaps = np.diff(circle, append=circle[0] + 2 * np.pi)
        if 2 * np.pi - gaps.max() < _LIMITED or is_cut(views):
            return None
        told = mass_center(views, self._angles)
        if told is None:
            return None
        return RowAxis(told.center, told.error, np.inf, 0.0, 1.0, None, _MASS, told)


def chosen_measure(
    angles: Floats, span: tuple[float, float] | None, seen: Floats | None = None
) -> Measure:
    """The measure that the directions of views allow.

    Args:
        angles: in radians.
        span: where to search, in bins.
        seen: (view, 2) the first and the last bin that each view holds, if there are enough pairs
            of such views; None where each holds all of them.
    """
    pairs = enough_pairs(angles, seen)
    if pairs is not None:
        return OppositeViews(pairs, span, seen)
    circle = np.sort(np.mod(angles, 2 * np.pi))
    gaps = np.diff(circle, append=circle[0] + 2 * np.pi)
    widest = int(gaps.argmax())
    start = float(circle[(widest + 1) % circle.size])
    ahead = np.sort(np.mod(angles - start + 1e-9, 2 * np.pi))
    ahead = np.append(ahead[ahead < np.pi - 1e-6], np.pi)
    inner = np.diff(ahead)
    if inner.size > 1 and inner[:-1].max() <= _GAP and inner[-1] <= inner[:-1].max() + _SLACK:
        return DoubleWedge(angles, start, span)
    return CentreOfMass(angles)


def _binning(bins: int, aim: int) -> int:
    return max(1, round(bins / aim))


def _everywhere(row: Row, low: float, high: float) -> tuple[Floats, Floats]:
    """Trial centres all over a span of the detector, and their scores."""
    step = _STEP * row.bin
    if not row.cut:
        told = wedge_evidence(row, row.place((low + high) / 2), None)
        centers = np.arange(low, high + step / 2, step)
        return centers, told.scores(centers)
    width = _WINDOWS * row.views.shape[1] * row.bin
    count = max(1, round((high - low) / width))
    edges = np.linspace(low, high, count + 1)
    parts, heights = [], []
    for left, right in pairwise(edges):
        told = wedge_evidence(row, row.place(float(left + right) / 2), None)
        parts.append(np.arange(left, right, step))
        heights.append(told.scores(parts[-1]))
    return np.concatenate(parts), np.concatenate(heights)


def _peaks(centers: Floats, scores: Floats, apart: float) -> Floats:
    """The highest places, no two closer than ``apart``."""
    taken: list[float] = []
    for index in np.argsort(-scores, kind="stable"):
        if all(abs(centers[index] - other) >= apart for other in taken):
            taken.append(float(centers[index]))
        if len(taken) == _FOLLOWED:
            break
    return np.array(taken)


def _followed(row: Row, look: Look, start: float, by: str) -> RowAxis:
    """The centre that a place leads to, with the window and the noise taken about it.

    Where there is nothing in the window the place leads nowhere: its score is 0, and the error of
    its centre infinite.
    """
    center, last = start, 0.0
    trials = [
        row.bin * np.arange(-reach, reach + step / 2, step)
        for reach, step in ((_REACH, _NARROW), (_NARROW, _SHARP))
    ]
    for _ in range(_ROUNDS):
        told = look(row.place(center), row.place(center))
        if told.most == 0:
            break
        best = center
        for trial in trials:
            best += float(trial[told.scores(best + trial).argmax()])
        change = told.peak(best) - center
        found = center + change
        ratio = change / last if last else 0.0
        if abs(change) < _SETTLED * row.bin:
            center = found
            break
        if _SLOW[0] < ratio < _SLOW[1]:
            found = center + float(np.clip(change / (1 - ratio), -_JUMP, _JUMP)) * row.bin
            change = 0.0
        # Off the detector no window has anything in it.
        center, last = float(np.clip(found, 0, row.views.shape[1] * row.bin - 1)), change
    center = told.peak(center)
    score = float(told.scores(np.array([center]))[0])
    return RowAxis(center, told.error(center), score, 0.0, score / max(told.most, 1e-9), told, by)


def _best(settled: list[RowAxis], bins: int) -> RowAxis:
    """The likeliest of some places, and the best score of those that are not next to it."""
    best = max(settled, key=lambda place: place.score)
    away = [p.score for p in settled if abs(p.center - best.center) > 2 * _APART * bins]
    return best._replace(rival=max(away, default=0.0))
