"""The criterion as a function of a view table, and its gradient by every entry of the table.

The chain goes from a row of settings to how the target's points are seen (``Observations``), to
coverage, to the criterion, and back. It does for whole tables what ``ViewTable.cameras`` and
``Observations.of`` do one camera at a time; tests hold the two together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.coverage.host import host_coverage, host_coverage_grad
from rift_cl.sampling.criteria import optimality as criteria
from rift_cl.sampling.criteria.merit import CoverageCriterion
from rift_cl.sampling.criteria.surface import surface_criterion
from rift_cl.sampling.planning.design_space import (
    DISTANCE,
    ELEVATION,
    EXPOSURE,
    F_NUMBER,
    FOCAL,
    FOCUS,
    DesignSpace,
)
from rift_cl.sampling.planning.frequency_sets import for_choosing, for_judging
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.observations import Observations, ObservationsGradient
from rift_cl.sampling.targets.prior import checked_power
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Objective:
    """What is to be small.

    Args:
        site: where views are planned.
        kind: the criterion.
        fixed: how views that are there already see the target's points; None if there are none.
        asked: the target, where the site has it at more frequencies; None if it has not.
    """

    design: DesignSpace
    kind: CoverageCriterion = "wiener"
    fixed: Observations | None = None
    asked: Target | None = None

    @cached_property
    def base(self) -> Floats:
        """(P, K) coverage by the views that are there already."""
        target = self.design.target
        if self.fixed is None:
            return np.zeros((len(target.points), len(target.k)))
        return host_coverage(self.fixed, target.k, target.diameter)

    @cached_property
    def rough(self) -> Objective:
        """The same at the frequencies of the target that is asked about, to compare many views."""
        return self if self.asked is None else self._at(self.asked)

    @cached_property
    def elsewhere(self) -> Objective:
        """The same at frequencies that nothing was optimised with, to judge what was."""
        target = self.design.target
        judged = for_judging(target if self.asked is None else self.asked, target)
        return self if judged is target else self._at(judged)

    @cached_property
    def aside(self) -> Objective:
        """The same at a third set of frequencies, to choose with between what was optimised."""
        target = self.design.target
        chosen = for_choosing(target if self.asked is None else self.asked, target)
        return self if chosen is target else self._at(chosen)

    def _at(self, target: Target) -> Objective:
        return replace(self, design=replace(self.design, target=target), asked=None)

    @cached_property
    def power(self) -> Floats:
        """(K,) what the prior expects."""
        target = self.design.target
        return checked_power(target.prior, target.k, target.diameter)

    def scored(self, added: Floats) -> criteria.Scored:
        """A volume's criterion with coverage (P, K) added to the fixed views', and its derivative.

        That of ``merit_of_coverage``, with the prior asked but once.
        """
        known, target = self.base + added, self.design.target
        return criteria.scored(self.kind, known, self.power, target.snr, target.k)

    def observations(self, view_table: ViewTable) -> Observations:
        """Observations of the target's points by the views of a table."""
        return _Sight(self.design, view_table).observations

    def value(self, view_table: ViewTable) -> float:
        """The criterion of a view table, with the fixed views."""
        return self.value_of(self.observations(view_table))

    def value_of(self, observations: Observations) -> float:
        """The criterion of these observations, with the fixed views."""
        target = self.design.target
        if target.mode == "surface":
            return self.surface(observations)[0]
        return self.scored(host_coverage(observations, target.k, target.diameter)).value

    def surface(self, observations: Observations) -> tuple[float, ObservationsGradient]:
        """A surface's criterion, and its derivative by the observations."""
        known = observations if self.fixed is None else joined([self.fixed, observations])
        value, gradient = surface_criterion(known, self.design.target, self.kind)
        return value, ObservationsGradient(*(values[-observations.views :] for values in gradient))

    def gradient(self, view_table: ViewTable) -> tuple[float, Floats]:
        """The criterion, and its derivative (V, 7) by the view table."""
        target, sight = self.design.target, _Sight(self.design, view_table)
        if target.mode == "surface":
            value, by_observations = self.surface(sight.observations)
            return value, sight.chained(by_observations)
        scored = self.scored(host_coverage(sight.observations, target.k, target.diameter))
        by_observations = host_coverage_grad(
            sight.observations, target.k, target.diameter, scored.gradient
        )
        return scored.value, sight.chained(by_observations)


def joined(parts: Sequence[Observations]) -> Observations:
    """Observations of one set of points, one after another."""
    names = [entry.name for entry in fields(Observations)]
    return Observations(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in names)
    )


def some(observations: Observations, which: Sequence[int] | slice) -> Observations:
    """Some of the views."""
    return Observations(
        *(getattr(observations, entry.name)[which] for entry in fields(Observations))
    )


@dataclass(frozen=True, eq=False)
class _Sight:
    """Geometry of each view and point; arrays are (V,), or (V, P) where points come in."""

    design: DesignSpace
    view_table: ViewTable

    def _column(self, column: int) -> Floats:
        return self.view_table.table[:, column]

    def _of_type(self, name: str) -> Floats:
        values = np.array([getattr(kind, name) for kind in self.design.types], np.float64)
        return values[self.view_table.kind]

    @cached_property
    def frames(self) -> Floats:
        return self.view_table.frames(self.design)

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
        target = self.design.target
        return np.asarray(outward[:, None] + (target.center - target.points))

    @cached_property
    def depth(self) -> Floats:
        return np.asarray(np.einsum("vpd,vd->vp", self.away, self.frames[:, 0]))

    @cached_property
    def photons(self) -> Floats:
        """Relative photons from the target, exposure A^2 / z^2."""
        per_area = self._column(EXPOSURE) * (self.pupil / self._column(DISTANCE)) ** 2
        return per_area / self.design.brightness

    @cached_property
    def observations(self) -> Observations:
        reach = np.maximum(self.depth, 1e-9 * self.design.target.diameter)
        observed = (self.depth > 0) & self._in_picture(reach)
        wavelength = self._of_type("wavelength")[:, None]
        pupil = self.pupil[:, None]
        with np.errstate(divide="ignore"):
            cutoff = pupil / (wavelength * reach)
        return Observations(
            direction=self.away / np.linalg.norm(self.away, axis=2, keepdims=True),
            weight=self.photons[:, None] * observed,
            pixel=reach * (self._of_type("pixel") / self.image)[:, None],
            cutoff=cutoff,
            blur=pupil * np.abs(1 - reach / self.plane[:, None]),
        )

    def _in_picture(self, reach: Floats) -> NDArray[np.bool_]:
        scale = (self.image / self._of_type("pixel"))[:, None] / reach
        sizes = np.array([kind.size for kind in self.design.types], np.float64)[
            self.view_table.kind
        ]
        rise = np.einsum("vpd,vd->vp", self.away, self.frames[:, 2]) * scale
        along = np.einsum("vpd,vd->vp", self.away, self.frames[:, 1]) * scale
        return np.asarray((np.abs(rise) <= sizes[:, :1] / 2) & (np.abs(along) <= sizes[:, 1:] / 2))

    def chained(self, by: ObservationsGradient) -> Floats:
        """Chain derivatives by observations to those by the view table, (V, 7)."""
        observations, plane = self.observations, self.plane[:, None]
        reach = np.maximum(self.depth, 1e-9 * self.design.target.diameter)
        sharp = 1 - reach / plane
        limited = np.isfinite(observations.cutoff)
        cut = by.cutoff * np.where(limited, observations.cutoff, 0)
        side = self.pupil[:, None] * np.sign(sharp) * by.blur
        by_reach = (by.pixel * observations.pixel - cut) / reach - side / plane
        by_pupil = ((cut + by.blur * observations.blur).sum(1)) / self.pupil
        by_image = -(by.pixel * observations.pixel).sum(1) / self.image
        by_plane = (side * reach).sum(1) / self.plane**2
        by_photons = (by.weight * (observations.weight > 0)).sum(1) * self.photons
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
        """Derivatives by distance (V,), and by azimuth and elevation (V, 2)."""
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
