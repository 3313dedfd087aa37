"""Candidates for a surface: what views know of its texture and its sheen, added up view by view.

``surface_merit`` scores a set of views; a greedy choice asks for thousands of sets that differ by
one. Here every candidate's part is kept: the coverage of the texture's frequencies, and its
spherical harmonics at every point, with which one more view changes the inverse of the angular
information by a matrix of rank one (Sherman and Morrison 1950).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rift_cl.sampling import criteria
from rift_cl.sampling.looks import Looks
from rift_cl.sampling.planning.objective import Objective, joined, some
from rift_cl.sampling.planning.stations import Stations
from rift_cl.sampling.prior import checked_power
from rift_cl.sampling.surface import texture_coverage
from rift_cl.sampling.target import half_disc

Floats = NDArray[np.float64]


class SurfacePool:
    """C candidates for a surface, of which some are chosen.

    Args:
        objective: what is to be small; its target has normals.
        looks: how the candidates see the target.
        texture: (C, P, K) coverage by every candidate, where it is known.
    """

    def __init__(self, objective: Objective, looks: Looks, texture: Floats | None = None) -> None:
        target = objective.site.target
        self._objective, self._looks, self._snr = objective, looks, target.snr
        self._texture = _texture(looks, objective) if texture is None else texture
        self._plane = half_disc(target.highest, self._texture.shape[2])
        self._power = checked_power(target.prior, self._plane, target.diameter)
        # (C, P, waves), so that their products with themselves are a view's angular information.
        self._waves = self._harmonics(looks)
        fixed = objective.fixed
        self._base = 0 * self._texture[0] if fixed is None else texture_coverage(fixed, target)
        before = self._waves[:0] if fixed is None else self._harmonics(fixed)
        self._given = np.eye(self._waves.shape[2]) + np.einsum("vpi,vpj->pij", before, before)
        self.clear()
        self.start = self._scored(self._base).value + self._angular()

    def __len__(self) -> int:
        """C."""
        return len(self._texture)

    def clear(self) -> None:
        """Choose none."""
        self._known = self._base
        self._inverse, self._bits = np.linalg.inv(self._given), self._bits_of(self._given)

    def merit_with(self, index: int) -> float:
        """The merit of what is chosen, and one more."""
        turned, more = self._turned(index)
        texture = self._scored(self._known + self._texture[index]).value
        if self._objective.kind == "logdet":
            return texture + self._angular() - self._per_wave(np.log2(more))
        return texture + self._angular() - self._per_wave((turned**2).sum(1) / more)

    def add(self, index: int) -> None:
        """Choose one more."""
        turned, more = self._turned(index)
        self._known = self._known + self._texture[index]
        product = turned[:, :, None] * turned[:, None]
        self._inverse = self._inverse - product / more[:, None, None]
        self._bits = self._bits + np.log2(more)

    def ceilings(self) -> Floats:
        """(C,) by how much one more of each lowers the merit at the most."""
        return self._falls(self._scored(self._known).gradient, self._inverse)

    def with_views(self, stations: Stations) -> SurfacePool:
        """A pool with some more candidates, and none chosen."""
        own = self._objective.looks(stations)
        texture = np.concatenate([self._texture, _texture(own, self._objective)])
        return SurfacePool(self._objective, joined([self._looks, own]), texture)

    def mixed(self, amounts: Floats) -> tuple[float, Floats]:
        """The merit of so much of each candidate (C,), and how fast it falls with each."""
        scored = self._scored(self._base + np.tensordot(amounts, self._texture, 1))
        weighted = self._waves * np.sqrt(amounts)[:, None, None]
        points = weighted.transpose(1, 2, 0)
        information = self._given + points @ points.transpose(0, 2, 1)
        inverse = np.linalg.inv(information)
        if self._objective.kind == "logdet":
            angular = -self._per_wave(self._bits_of(information))
        else:
            angular = self._per_wave(np.trace(inverse, axis1=1, axis2=2))
        return scored.value + angular, self._falls(scored.gradient, inverse)

    def _scored(self, coverage: Floats) -> criteria.Scored:
        kind = self._objective.kind
        return criteria.scored(kind, coverage, self._power, self._snr, self._plane)

    def _angular(self) -> float:
        if self._objective.kind == "logdet":
            return -self._per_wave(self._bits)
        return self._per_wave(np.trace(self._inverse, axis1=1, axis2=2))

    def _turned(self, index: int) -> tuple[Floats, Floats]:
        """(P, waves) the inverse times a candidate's waves, and (P,) 1 + waves inverse waves."""
        waves = self._waves[index]
        turned = np.einsum("pij,pj->pi", self._inverse, waves)
        return turned, 1 + (turned * waves).sum(1)

    def _falls(self, slope: Floats, inverse: Floats) -> Floats:
        texture = -np.tensordot(self._texture, slope, 2)
        turned = np.matmul(self._waves.transpose(1, 0, 2), inverse)
        if self._objective.kind == "logdet":
            products = (turned * self._waves.transpose(1, 0, 2)).sum(2) / math.log(2)
        else:
            products = (turned**2).sum(2)
        return np.asarray(texture + products.sum(0) / (len(products) * inverse.shape[1]))

    def _per_wave(self, values: Floats) -> float:
        """Mean over points of a sum over harmonics, for each of those."""
        return float(values.mean() / self._waves.shape[2])

    @staticmethod
    def _bits_of(information: Floats) -> Floats:
        return np.asarray(np.linalg.slogdet(information)[1] / math.log(2))

    def _harmonics(self, looks: Looks) -> Floats:
        """(V, P, waves) spherical harmonics, mean square 1, times the root of snr and light."""
        from scipy.special import lpmv

        target = self._objective.site.target
        normals = np.zeros((looks.points, 3)) if target.normals is None else target.normals
        x, y, z = np.moveaxis(looks.direction, 2, 0)
        turn, waves = np.arctan2(y, x), []
        for degree, order in ((n, m) for n in range(target.degree + 1) for m in range(n + 1)):
            scale = (
                (2 * degree + 1) * math.factorial(degree - order) / math.factorial(degree + order)
            )
            height = math.sqrt(scale * (2 if order else 1)) * lpmv(order, degree, z)
            waves.append(height * np.cos(order * turn))
            if order:
                waves.append(height * np.sin(order * turn))
        cosine = np.maximum(np.einsum("vpd,pd->vp", looks.direction, normals), 0)
        light = target.snr * looks.weight * cosine
        return np.asarray(np.stack(waves, axis=2) * np.sqrt(light)[:, :, None])


def _texture(looks: Looks, objective: Objective) -> Floats:
    """(V, P, K) coverage of the texture's frequencies by every view for itself."""
    target = objective.site.target
    views = (some(looks, slice(view, view + 1)) for view in range(looks.views))
    return np.stack([texture_coverage(one, target) for one in views])
