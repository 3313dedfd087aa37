"""A plan of views: the cameras, what they are set to, and what they are worth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.geometry.camera_type import CameraType
from rift_cl.geometry.numbers import one_number
from rift_cl.sampling.planning.baselines import Baseline
from rift_cl.sampling.planning.design_space import AZIMUTH, DISTANCE, ELEVATION, EXPOSURE, FOCUS
from rift_cl.sampling.planning.greedy import Choice, Limits, choose
from rift_cl.sampling.planning.objective import Objective
from rift_cl.sampling.planning.paths import Free
from rift_cl.sampling.planning.pool import pool_of
from rift_cl.sampling.planning.view_costs import cost
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.directional_prior import anisotropy

Floats = NDArray[np.float64]
# Gains below the first, as a share, are called none, and below the second little: in mean squared
# error those are 0.09 and 0.3 dB.
_NONE, _LITTLE = 0.02, 0.07
# Spread over mean of power by direction below which a target has none: measured spectra of
# isotropic objects have up to 0.14 by chance, those of 1.5 to 1 about 0.24.
_ALIKE = 0.2


class DiminishingReturns(NamedTuple):
    """What each further view brings, when the most useful come first.

    Args:
        merits: before the first new view, and with one, two, ...
        gains: by how much each view lowers the criterion.
        views: after so many the next brings less than ``share``; None if all bring more.
        share: of what those before it brought on average.
    """

    merits: Floats
    gains: Floats
    views: int | None
    share: float


@dataclass(frozen=True, eq=False)
class Plan:
    """Views that a planner chose.

    ``merit``, ``bound`` and each baseline's ``merit`` are at the frequencies that were planned with
    (``objective.design.target``); ``elsewhere``, diminishing returns and the verdict are at others,
    so that nothing compared was optimized on them. Both sets are the same if the target came with
    frequencies of its own.

    Args:
        objective: what was to be small, and where.
        stations: the views.
        merit: what it came to, views that were there already included; lower is better.
        bound: no choice of as many views among the planner's candidates and these gets below it.
        fixed: the views that were there already.
        fixed_weights: (V,) relative photons of each of those.
        baselines: what is done without a plan, at the same cost under the same constraints, by
            name.
    """

    objective: Objective
    view_table: ViewTable
    merit: float
    bound: float
    fixed: tuple[Camera, ...]
    fixed_weights: Floats
    baselines: Mapping[str, Baseline]

    def __len__(self) -> int:
        """How many new views there are."""
        return len(self.view_table)

    def __repr__(self) -> str:
        """One line: how many views, what they are worth, with which cameras."""
        counts = np.bincount(self.view_table.kind, minlength=len(self.objective.design.types))
        kinds = ", ".join(
            f"{n} x {kind.name!r}"
            for n, kind in zip(counts.tolist(), self.objective.design.types, strict=True)
            if n
        )
        more = f" besides {len(self.fixed)}" if self.fixed else ""
        return f"Plan({len(self)} views{more}, merit {self.merit:.4g}, cameras: {kinds})"

    def _repr_html_(self) -> str:
        """Table of the criterion, and a plot of the cameras, for notebooks."""
        html: str = import_module("rift_cl.report.notebook").plan_card(self)
        return html

    @cached_property
    def cameras(self) -> tuple[Camera, ...]:
        """The new views."""
        return self.view_table.cameras(self.objective.design)

    @cached_property
    def types(self) -> tuple[CameraType, ...]:
        """Camera of each new view with its settings: focal length, f-number, exposure."""
        return self.view_table.camera_types(self.objective.design)

    @property
    def weights(self) -> Floats:
        """(V,) relative photons of each view: the ``weights`` of ``merit`` and ``coverage``."""
        observations = self.objective.observations(self.view_table)
        return np.asarray(observations.weight.max(1))

    @property
    def poses(self) -> Floats:
        """(V, 4, 4) world-to-camera matrices."""
        return np.stack([camera.view for camera in self.cameras])

    @property
    def directions(self) -> Floats:
        """(V, 3) unit vectors from the target's centre to the cameras."""
        return np.asarray(self.view_table.frames(self.objective.design)[:, 0])

    @property
    def azimuth(self) -> Floats:
        """(V,) radians."""
        return self.view_table.table[:, AZIMUTH]

    @property
    def elevation(self) -> Floats:
        """(V,) radians."""
        return self.view_table.table[:, ELEVATION]

    @property
    def distance(self) -> Floats:
        """(V,) from the target's centre."""
        return self.view_table.table[:, DISTANCE]

    @property
    def focus(self) -> Floats:
        """(V,) distance of the plane in focus from each camera."""
        return self.view_table.table[:, DISTANCE] + self.view_table.table[:, FOCUS]

    @property
    def exposure(self) -> Floats:
        """(V,) in the unit of ``CameraType.exposure``."""
        return self.view_table.table[:, EXPOSURE]

    @property
    def cost(self) -> float:
        """What the views cost of the budget; 0 without one."""
        return cost(self.objective.design, self.view_table)

    def diminishing_returns(self, share: float = 0.25) -> DiminishingReturns:
        """What each further view brings, and after how many that is little.

        Args:
            share: what counts as little, of what the views before it brought on average.

        Raises:
            InputError: the share is not between 0 and 1.
        """
        if not 0 < one_number(share) < 1:
            raise InputError(f"diminishing_returns: share is {share!r}, wanted a number, 0 to 1")
        merits = np.array(self._ordered.merits)
        gains = -np.diff(merits)
        average = np.cumsum(gains) / np.arange(1, len(gains) + 1)
        little = np.flatnonzero(gains[1:] < share * average[:-1])
        return DiminishingReturns(merits, gains, int(little[0]) + 1 if len(little) else None, share)

    @property
    def order(self) -> list[int]:
        """The views, the most useful first, each given those before it."""
        return self._ordered.order

    @cached_property
    def _ordered(self) -> Choice:
        limits = Limits(len(self), np.zeros(len(self)), math.inf)
        return choose(pool_of(self.objective.elsewhere, self.view_table), limits, again=False)

    @cached_property
    def elsewhere(self) -> float:
        """The criterion at frequencies that the plan was not optimized for."""
        return self.objective.elsewhere.value(self.view_table)

    def gain(self, value: float) -> float:
        """The share by which the plan lies below another ``elsewhere``; negative if above."""
        return (value - self.elsewhere) / max(abs(value), 1e-300)

    def verdict(self) -> str:
        """In words, what planning was worth against the best of the baselines."""
        if not self.baselines:
            return "Nothing to compare with: no simple arrangement keeps to the constraints."
        best = min(self.baselines.values(), key=lambda baseline: baseline.elsewhere)
        gain, where = self.gain(best.elsewhere), f"{self._target_in_words()} target, "
        where += f"{self._cameras_in_words()} cameras"
        if gain < _NONE:
            worth = "is as good" if gain > -_NONE else "is better"
            apart = f"{abs(gain):.1%} apart"
            return f"Planning gains nothing ({where}): {best.described} {worth} ({apart})."
        start = "Planning pays" if gain >= _LITTLE else "Planning gains little"
        more = "more bits" if self.objective.kind == "logdet" else "less stays unknown"
        if self.objective.kind == "worst":
            more += " in the worst direction"
        return (
            f"{start} ({where}): {gain:.1%} {more} than with the best simple arrangement, "
            f"{best.described}."
        )

    @cached_property
    def isotropic(self) -> bool:
        """Whether the target's power is alike in all directions, as far as that can be told."""
        return anisotropy(self.objective.design.target) < _ALIKE

    def _target_in_words(self) -> str:
        return "isotropic" if self.isotropic else "anisotropic"

    def _cameras_in_words(self) -> str:
        limits = self.objective.design.constraints
        flat = self.objective.design.target.is_flat
        whole = limits.full_circle and (flat or float(np.ptp(limits.elevation)) > math.pi - 1e-6)
        free = whole and not limits.keepouts and isinstance(limits.path, Free)
        return "free" if free else "constrained"
