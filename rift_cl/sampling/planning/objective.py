"""The merit of views as a planner moves them, and its derivatives by every number of theirs.

The chain goes from a row of settings to how the target's points are seen (``Looks``), to coverage,
to the merit, and back. It does for whole tables what ``Stations.cameras`` and ``Looks.of`` do one
camera at a time; tests hold the two together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rift_cl.reference.coverage import LooksGradient, coverage, coverage_grad
from rift_cl.sampling.criteria import functionals as criteria
from rift_cl.sampling.criteria.merit import CoverageMerit
from rift_cl.sampling.criteria.surface import surface_merit
from rift_cl.sampling.planning.design_space import (
    DISTANCE,
    ELEVATION,
    EXPOSURE,
    F_NUMBER,
    FOCAL,
    FOCUS,
    Site,
)
from rift_cl.sampling.planning.frequency_sets import for_choosing, for_judging
from rift_cl.sampling.planning.view_table import Stations
from rift_cl.sampling.targets.observations import Looks
from rift_cl.sampling.targets.prior import checked_power
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Objective:
    """What is to be small.

    Args:
        site: where views are planned.
        kind: of the merit.
        fixed: how views that are there already see the target's points; None if there are none.
        asked: the target, where the site has it at more frequencies; None if it has not.
    """

    site: Site
    kind: CoverageMerit = "wiener"
    fixed: Looks | None = None
    asked: Target | None = None

    @cached_property
    def base(self) -> Floats:
        """(P, K) coverage by the views that are there already."""
        target = self.site.target
        if self.fixed is None:
            return np.zeros((len(target.points), len(target.k)))
        return coverage(self.fixed, target.k, target.diameter)

    @cached_property
    def rough(self) -> Objective:
        """The same at the frequencies of the target that is asked about, to compare many views."""
        return self if self.asked is None else self._at(self.asked)

    @cached_property
    def elsewhere(self) -> Objective:
        """The same at frequencies that nothing was optimised with, to judge what was."""
        target = self.site.target
        judged = for_judging(target if self.asked is None else self.asked, target)
        return self if judged is target else self._at(judged)

    @cached_property
    def aside(self) -> Objective:
        """The same at a third set of frequencies, to choose with between what was optimised."""
        target = self.site.target
        chosen = for_choosing(target if self.asked is None else self.asked, target)
        return self if chosen is target else self._at(chosen)

    def _at(self, target: Target) -> Objective:
        return replace(self, site=replace(self.site, target=target), asked=None)

    @cached_property
    def power(self) -> Floats:
        """(K,) what the prior expects."""
        target = self.site.target
        return checked_power(target.prior, target.k, target.diameter)

    def scored(self, added: Floats) -> criteria.Scored:
        """A volume's merit with so much coverage (P, K) added to what is there; its derivative.

        That of ``merit_of_coverage``, with the prior asked but once.
        """
        known, target = self.base + added, self.site.target
        return criteria.scored(self.kind, known, self.power, target.snr, target.k)

    def looks(self, stations: Stations) -> Looks:
        """How the stations see the target's points."""
        return _Sight(self.site, stations).looks

    def value(self, stations: Stations) -> float:
        """The merit of the stations, with what is there already."""
        return self.value_of(self.looks(stations))

    def value_of(self, looks: Looks) -> float:
        """The merit of views that see the target so, with what is there already."""
        target = self.site.target
        if target.mode == "surface":
            return self.surface(looks)[0]
        return self.scored(coverage(looks, target.k, target.diameter)).value

    def surface(self, looks: Looks) -> tuple[float, LooksGradient]:
        """The merit of a surface, and its derivative by the looks."""
        known = looks if self.fixed is None else joined([self.fixed, looks])
        value, gradient = surface_merit(known, self.site.target, self.kind)
        return value, LooksGradient(*(values[-looks.views :] for values in gradient))

    def gradient(self, stations: Stations) -> tuple[float, Floats]:
        """The merit, and its derivative (V, 7) by the stations' table."""
        target, sight = self.site.target, _Sight(self.site, stations)
        if target.mode == "surface":
            value, by_looks = self.surface(sight.looks)
            return value, sight.chained(by_looks)
        scored = self.scored(coverage(sight.looks, target.k, target.diameter))
        by_looks = coverage_grad(sight.looks, target.k, target.diameter, scored.gradient)
        return scored.value, sight.chained(by_looks)


def joined(parts: Sequence[Looks]) -> Looks:
    """Looks of one set of points, one after another."""
    names = [entry.name for entry in fields(Looks)]
    return Looks(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def some(looks: Looks, which: Sequence[int] | slice) -> Looks:
    """Some of the views."""
    return Looks(*(getattr(looks, entry.name)[which] for entry in fields(Looks)))


@dataclass(frozen=True, eq=False)
class _Sight:
    """How stations see points; all arrays (V,), or (V, P) once points come in."""

    site: Site
    stations: Stations

    def _column(self, column: int) -> Floats:
        return self.stations.table[:, column]

    def _of_type(self, name: str) -> Floats:
        values = np.array([getattr(kind, name) for kind in self.site.types], np.float64)
        return values[self.stations.kind]

    @cached_property
    def frames(self) -> Floats:
        return self.stations.frames(self.site)

    @cached_property
    def plane(self) -> Floats:
        """Distance of the plane in focus."""
        return self._column(DISTANCE) + self._column(FOCUS)

    @cached_property
    def image(self) -> Floats:
        """Image distance, as ``CameraType.image_distance`` has it."""
        magnified = self._of_type("pupil_magnification")
        return 1 / (1 / self._column(FOCAL) - 1 / (magnified * self.plane))

    @cached_property
    def pupil(self) -> Floats:
        """Diameter of the entrance pupil."""
        return self._column(FOCAL) / self._column(F_NUMBER)

    @cached_property
    def away(self) -> Floats:
        """(V, P, 3) from the points to the cameras."""
        outward = self._column(DISTANCE)[:, None] * self.frames[:, 0]
        target = self.site.target
        return np.asarray(outward[:, None] + (target.center - target.points))

    @cached_property
    def depth(self) -> Floats:
        return np.asarray(np.einsum("vpd,vd->vp", self.away, self.frames[:, 0]))

    @cached_property
    def photons(self) -> Floats:
        """Relative photons from the target, exposure A^2 / z^2."""
        per_area = self._column(EXPOSURE) * (self.pupil / self._column(DISTANCE)) ** 2
        return per_area / self.site.brightness

    @cached_property
    def looks(self) -> Looks:
        reach = np.maximum(self.depth, 1e-9 * self.site.target.diameter)
        seen = (self.depth > 0) & self._in_picture(reach)
        wavelength = self._of_type("wavelength")[:, None]
        pupil = self.pupil[:, None]
        with np.errstate(divide="ignore"):
            cutoff = pupil / (wavelength * reach)
        return Looks(
            direction=self.away / np.linalg.norm(self.away, axis=2, keepdims=True),
            weight=self.photons[:, None] * seen,
            pixel=reach * (self._of_type("pixel") / self.image)[:, None],
            cutoff=cutoff,
            blur=pupil * np.abs(1 - reach / self.plane[:, None]),
        )

    def _in_picture(self, reach: Floats) -> NDArray[np.bool_]:
        scale = (self.image / self._of_type("pixel"))[:, None] / reach
        sizes = np.array([kind.size for kind in self.site.types], np.float64)[self.stations.kind]
        rise = np.einsum("vpd,vd->vp", self.away, self.frames[:, 2]) * scale
        along = np.einsum("vpd,vd->vp", self.away, self.frames[:, 1]) * scale
        return np.asarray((np.abs(rise) <= sizes[:, :1] / 2) & (np.abs(along) <= sizes[:, 1:] / 2))

    def chained(self, by: LooksGradient) -> Floats:
        """From derivatives by looks to those by the table, (V, 7)."""
        looks, plane = self.looks, self.plane[:, None]
        reach = np.maximum(self.depth, 1e-9 * self.site.target.diameter)
        sharp = 1 - reach / plane
        limited = np.isfinite(looks.cutoff)
        cut = by.cutoff * np.where(limited, looks.cutoff, 0)
        side = self.pupil[:, None] * np.sign(sharp) * by.blur
        by_reach = (by.pixel * looks.pixel - cut) / reach - side / plane
        by_pupil = ((cut + by.blur * looks.blur).sum(1)) / self.pupil
        by_image = -(by.pixel * looks.pixel).sum(1) / self.image
        by_plane = (side * reach).sum(1) / self.plane**2
        by_photons = (by.weight * (looks.weight > 0)).sum(1) * self.photons
        by_pupil = by_pupil + 2 * by_photons / self.pupil
        magnified = self._of_type("pupil_magnification")
        by_plane = by_plane - by_image * (self.image / self.plane) ** 2 / magnified
        by_focal = by_image * (self.image / self._column(FOCAL)) ** 2
        by_focal = by_focal + by_pupil / self._column(F_NUMBER)
        outward, turning = self._by_place(by.direction, by_reach)
        by_distance = outward + by_plane - 2 * by_photons / self._column(DISTANCE)
        by_stop = -by_pupil * self.pupil / self._column(F_NUMBER)
        by_exposure = by_photons / self._column(EXPOSURE)
        rest = (by_distance, by_focal, by_stop, by_plane, by_exposure)
        return np.column_stack([turning, *rest])

    def _by_place(self, by_direction: Floats, by_reach: Floats) -> tuple[Floats, Floats]:
        """By the distance (V,), and by azimuth and elevation (V, 2), of where a camera stands."""
        frames, distance = self.frames, self._column(DISTANCE)
        length = np.linalg.norm(self.away, axis=2, keepdims=True)
        unit = self.away / length
        across = by_direction - (by_direction * unit).sum(2, keepdims=True) * unit
        ahead = by_reach[:, :, None] * frames[:, None, 0]
        by_place = (across / length + ahead).sum(1)
        # Depth is counted along the axis, which turns as the camera moves.
        by_outward = distance[:, None] * by_place + (by_reach[:, :, None] * self.away).sum(1)
        level = np.cos(self._column(ELEVATION))
        azimuth = level * (by_outward * frames[:, 1]).sum(1)
        elevation = (by_outward * frames[:, 2]).sum(1)
        return (by_place * frames[:, 0]).sum(1), np.column_stack([azimuth, elevation])
