"""Candidates for a surface: what views know of its texture and appearance, added up view by view.

``surface_merit`` scores a set of views; a greedy choice asks for thousands of sets that differ by
one. Here every candidate's part is kept: the coverage of the texture's frequencies, and how its
brightness at every point hangs together with that in all directions which are wanted. One more
view changes those covariances by a matrix of rank one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling.criteria import optimality as criteria
from rift_cl.sampling.criteria.appearance import covariance, light_of, shown, wanted_of
from rift_cl.sampling.criteria.surface import texture_coverage
from rift_cl.sampling.planning.objective import Objective, joined, some
from rift_cl.sampling.planning.view_table import ViewTable
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import checked_power
from rift_cl.sampling.targets.target import half_disc

Floats = NDArray[np.float64]
# Steps towards the best mixture of all candidates, and for how many of them that is not too long.
_MIXING, _FEW = 4, 600


class _Appearance(NamedTuple):
    """Brightness of P points given what is chosen: S views, candidates and others, D directions.

    Args:
        toward: (P, S, D) covariances of views and wanted directions.
        variance: (P, S) of the views.
        left: (P, D) of the wanted directions.
        rows: (P, S) each, whose products were taken from the views' own covariances.
        bits: (P,) of information.
    """

    toward: Floats
    variance: Floats
    left: Floats
    rows: tuple[Floats, ...]
    bits: Floats


class SurfacePool:
    """C candidates for a surface, of which some are chosen.

    Args:
        objective: what is to be small; its target has normals.
        looks: how the candidates see the target.
        texture: (C, P, K) coverage by every candidate, where it is known.
    """

    def __init__(
        self, objective: Objective, observations: Observations, texture: Floats | None = None
    ) -> None:
        target, fixed = objective.design.target, objective.fixed
        self._objective, self._observations, self._target = objective, observations, target
        self._texture = _texture(observations, objective) if texture is None else texture
        self._plane = half_disc(target.highest, self._texture.shape[2])
        self._power = checked_power(target.prior, self._plane, target.diameter)
        self._base = 0 * self._texture[0] if fixed is None else texture_coverage(fixed, target)
        # Views that are there already stand behind the candidates.
        views = observations if fixed is None else joined([observations, fixed])
        self._views = views.direction.transpose(1, 0, 2)
        normals = np.zeros((views.points, 3)) if target.normals is None else target.normals
        self._light = target.snr * light_of(views, normals)
        self._share = shown(target, normals).T / len(wanted_of(target))
        self._given = self._before()
        for index in range(len(self), views.views):
            self._given = self._with(self._given, index)
        self.clear()
        self.start = self._scored(self._base).value + self._error(self._appearance)

    @property
    def mixing(self) -> int:
        """Steps towards the best mixture that are worth their time."""
        return _MIXING if len(self) <= _FEW else 1

    def __len__(self) -> int:
        """C."""
        return len(self._texture)

    def clear(self) -> None:
        """Choose none."""
        self._known, self._appearance = self._base, self._given

    def criterion_with(self, index: int) -> float:
        """The criterion of the chosen candidates and one more."""
        texture = self._scored(self._known + self._texture[index]).value
        light, appearance = self._light[:, index], self._appearance
        more = 1 + light * appearance.variance[:, index]
        if self._objective.kind == "logdet":
            return texture + self._error(appearance) - self._per_wave(np.log2(more))
        lost = (self._share * appearance.toward[:, index] ** 2).sum(1) * light / more
        return texture + self._error(appearance) - float(lost.mean())

    def add(self, index: int) -> None:
        """Choose one more."""
        self._known = self._known + self._texture[index]
        self._appearance = self._with(self._appearance, index)

    def ceilings(self) -> Floats:
        """(C,) upper bound of how much each further candidate lowers the criterion."""
        slope = self._scored(self._known).gradient
        return self._falls(slope, self._appearance.toward, self._appearance.variance)

    def with_views(self, view_table: ViewTable) -> SurfacePool:
        """A pool with some more candidates, and none chosen."""
        own = self._objective.observations(view_table)
        texture = np.concatenate([self._texture, _texture(own, self._objective)])
        return SurfacePool(self._objective, joined([self._observations, own]), texture)

    def mixed(self, amounts: Floats) -> tuple[float, Floats]:
        """The criterion of candidates in amounts (C,), and minus its derivative by each."""
        scored = self._scored(self._base + np.tensordot(amounts, self._texture, 1))
        some_of_each = np.concatenate([amounts, np.ones(self._light.shape[1] - len(amounts))])
        used = np.flatnonzero(some_of_each)
        light, before = self._light[:, used] * some_of_each[used], self._before()
        between = covariance(self._views, self._views[:, used], self._target.degree)
        gram = np.eye(len(used)) + light[:, :, None] * between[:, used]
        of_used = [before.toward[:, used], between.transpose(0, 2, 1)]
        solved = np.linalg.solve(gram, light[:, :, None] * np.concatenate(of_used, axis=2))
        wanted = before.toward.shape[2]
        toward = before.toward - between @ solved[:, :, :wanted]
        variance = before.variance - (between * solved[:, :, wanted:].transpose(0, 2, 1)).sum(2)
        left = before.left - (before.toward[:, used] * solved[:, :, :wanted]).sum(1)
        bits = np.linalg.slogdet(gram)[1] / np.log(2)
        appearance = _Appearance(toward, variance, left, (), bits)
        return scored.value + self._error(appearance), self._falls(
            scored.gradient, toward, variance
        )

    def _before(self) -> _Appearance:
        """With no view at all."""
        wanted, degree = wanted_of(self._target), self._target.degree
        toward = covariance(self._views, wanted[None], degree)
        variance, left = np.ones(toward.shape[:2]), np.ones((len(toward), len(wanted)))
        return _Appearance(toward, variance, left, (), np.zeros(len(toward)))

    def _with(self, appearance: _Appearance, index: int) -> _Appearance:
        """With one view more, by Schur's complement."""
        one = self._views[:, index, None]
        across = covariance(self._views, one, self._target.degree)[:, :, 0]
        for row in appearance.rows:
            across = across - row * row[:, index, None]
        light = self._light[:, index]
        more = 1 + light * appearance.variance[:, index]
        root = np.sqrt(light / more)[:, None]
        row, column = root * across, root * appearance.toward[:, index]
        return _Appearance(
            appearance.toward - row[:, :, None] * column[:, None],
            appearance.variance - row**2,
            appearance.left - column**2,
            (*appearance.rows, row),
            appearance.bits + np.log2(more),
        )

    def _scored(self, coverage: Floats) -> criteria.Scored:
        kind = self._objective.kind
        return criteria.scored(kind, coverage, self._power, self._target.snr, self._plane)

    def _error(self, appearance: _Appearance) -> float:
        if self._objective.kind == "logdet":
            return -self._per_wave(appearance.bits)
        return float((self._share * appearance.left).sum(1).mean())

    def _falls(self, slope: Floats, toward: Floats, variance: Floats) -> Floats:
        count = len(self)
        texture = -np.tensordot(self._texture, slope, 2)
        if self._objective.kind == "logdet":
            bits = self._light[:, :count] * variance[:, :count] / np.log(2)
            return np.asarray(texture + bits.mean(0) / self._waves)
        lost = np.einsum("psd,pd->ps", toward[:, :count] ** 2, self._share)
        return np.asarray(texture + (self._light[:, :count] * lost).mean(0))

    @property
    def _waves(self) -> int:
        return (self._target.degree + 1) ** 2

    def _per_wave(self, bits: Floats) -> float:
        """Mean over points, for each harmonic."""
        return float(bits.mean() / self._waves)


def _texture(observations: Observations, objective: Objective) -> Floats:
    """(V, P, K) coverage of the texture's frequencies by every view for itself."""
    target = objective.design.target
    views = (some(observations, slice(view, view + 1)) for view in range(observations.views))
    return np.stack([texture_coverage(one, target) for one in views])
