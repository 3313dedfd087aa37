"""The bases that view-dependent colour is fitted in, each with its number of RGB parameters.

Geometry is shared by the three channels, linear coefficients are not: SH degree 1, 2 and 3 take 12,
27 and 48 numbers, and every other family is filled up to those budgets. The functions themselves
are those of ``rift_cl.basis.angular``; what is here is which of them, and how a fit moves them.
Lobes of one width turn by two angles alone: a spin about their own axis would be a parameter more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rift_cl.basis import (
    AngularBasis,
    AnisotropicSphericalGaussians,
    HGLobe,
    LGLobe,
    SphericalGaussians,
    SphericalHarmonics,
    indices,
)

Floats = NDArray[np.float64]
Kind = Literal["sh", "hg", "lg", "hg aniso", "sg", "asg"]
# Logarithms of widths and sharpnesses are held within these.
WIDTHS = (np.log(0.03), 0.0)
SHARPNESS = (np.log(0.05), np.log(600.0))


@dataclass(frozen=True, eq=False)
class Family:
    """A basis at a budget.

    Args:
        name: of the basis, the same at every budget.
        kind: how its geometry is told.
        basis: evaluates the functions.
        columns: which of the functions are taken.
        parameters: of a splat with three channels.
        lobes: of spherical Gaussians.
    """

    name: str
    kind: Kind
    basis: AngularBasis
    columns: NDArray[np.intp]
    parameters: int
    lobes: int = 0

    def design(self, geometry: Floats, directions: Floats) -> Floats:
        """Values (P, L) of the functions towards directions (P, 3)."""
        return np.asarray(self.basis.functions(geometry, directions)[:, self.columns])

    def slopes(self, numbers: Floats, directions: Floats) -> tuple[Floats, Floats]:
        """Values (P, L), and their derivatives (P, L, n) by what a fit moves."""
        found = self.basis.slopes(self.geometry(numbers), directions)
        chain = _jacobian(self.geometry, numbers)
        return found.values[:, self.columns], found.by_geometry[:, self.columns] @ chain

    def starts(self, count: int, toward: Floats, random: np.random.Generator) -> list[Floats]:
        """Numbers to begin fits with; the first of them look towards the lobe's peak.

        Args:
            count: how many.
            toward: (3,) where the target is brightest.
            random: draws the others.
        """
        return [self._start(toward, k, random) for k in range(count)] if self.kind != "sh" else []

    def _start(self, toward: Floats, k: int, random: np.random.Generator) -> Floats:
        axes = toward + (0.15 if k == 0 else 0.5) * random.normal(size=(max(1, self.lobes), 3))
        axes[0] = toward if k < 3 else axes[0]
        turns = [_rotation_to(axis / np.linalg.norm(axis)) for axis in axes]
        if self.kind == "sg":
            sharp = random.uniform(np.log(2), np.log(60), self.lobes)
            return np.concatenate(
                [[*t.as_matrix()[:, 2], s] for t, s in zip(turns, sharp, strict=True)]
            )
        if self.kind == "asg":
            sharp = random.uniform(np.log(1), np.log(40), (self.lobes, 2))
            return np.concatenate([[*_wxyz(t), *s] for t, s in zip(turns, sharp, strict=True)])
        width = np.log((0.5, 0.25, 0.8, 0.35)[k % 4])
        return np.array([*turns[0].as_rotvec(), *[width] * (2 if self.kind == "hg aniso" else 1)])

    def geometry(self, numbers: Floats) -> Floats:
        """What the basis takes, from what a fit moves."""
        if self.kind in ("sh", "sg", "asg"):
            return numbers
        turn = Rotation.from_rotvec(numbers[:3])
        if self.kind != "hg aniso":
            turn = _rotation_to(turn.as_matrix()[:, 2])
        widths = numbers[3:]
        return np.array([*_wxyz(turn), *(np.repeat(widths, 2) if self.kind == "hg" else widths)])

    def bounds(self) -> tuple[Floats, Floats]:
        """Least and largest of what a fit moves."""
        if self.kind in ("sg", "asg"):
            free, held = (3, 1) if self.kind == "sg" else (4, 2)
            low, high = ([-np.inf] * free + [v] * held for v in SHARPNESS)
            return np.tile(low, self.lobes), np.tile(np.abs(high), self.lobes)
        count = 2 if self.kind == "hg aniso" else 1
        return (
            np.array([-np.inf] * 3 + [WIDTHS[0]] * count),
            np.array([np.inf] * 3 + [WIDTHS[1]] * count),
        )


def laguerre_columns(count: int) -> list[int]:
    """Where the first ``count`` LG modes by rows p + |l| stand among those by total order.

    Within a row |l| rises, so that one that is cut short keeps what is round.
    """
    modes = sorted(indices.laguerre_rows(min(count, 5), "real").tolist(), key=_laguerre_row)
    return indices.laguerre_place(np.array(modes[:count])).tolist()


def _laguerre_row(mode: Sequence[int]) -> tuple[int, int, int]:
    p, turns, part = mode
    return p + turns, turns, part


def hermite_columns(count: int) -> list[int]:
    """Where the first ``count`` HG modes by rows max(m, n) stand; within one, m + n rises."""
    modes = sorted(indices.rows(min(count, 5), 2).tolist(), key=lambda mode: (max(mode), sum(mode)))
    return indices.place(np.array(modes[:count])).tolist()


def chart(name: str, kind: Kind, modes: Sequence[int], geometry: int) -> Family:
    """A family of lobes on the chart: the constant and these modes.

    Args:
        name: of the family.
        kind: ``hg``, ``hg aniso`` or ``lg``.
        modes: by total order, from 0.
        geometry: numbers that the channels share.
    """
    linear = 2 + max(modes)
    basis = LGLobe(linear) if kind == "lg" else HGLobe(linear)
    columns = np.array([0, *(1 + np.array(modes))], np.intp)
    return Family(name, kind, basis, columns, geometry + 3 * len(columns))


def budget(degree: int) -> list[Family]:
    """The families that take as many numbers as SH of a degree 1, 2 or 3, or a few less."""
    n, aniso = {1: (3, 2), 2: (8, 7), 3: (15, 14)}[degree], {2: 3, 3: 5}.get(degree, 0)
    linear = (degree + 1) ** 2
    found = [
        Family("SH", "sh", SphericalHarmonics(degree), np.arange(linear), 3 * linear),
        chart("HG", "hg", range(n[0] - 1), 3),
        chart("LG row", "lg", laguerre_columns(n[0] - 1), 3),
        chart("LG total", "lg", range(n[0] - 1), 3),
    ]
    if n[1] > 2:
        found.append(chart("HG anisotropic", "hg aniso", range(n[1] - 1), 5))
    lobes = {1: 1, 2: 4, 3: 7}[degree]
    gaussians = SphericalGaussians(lobes), np.arange(1 + lobes)
    found.append(Family("SG", "sg", *gaussians, 3 + 6 * lobes, lobes))
    if aniso:
        sharper = AnisotropicSphericalGaussians(aniso), np.arange(1 + aniso)
        found.append(Family("ASG", "asg", *sharper, 3 + 8 * aniso, aniso))
    return found


def _jacobian(of: Callable[[Floats], Floats], numbers: Floats) -> Floats:
    """Derivatives of a few smooth numbers by a few others, to about 1e-10."""
    steps = 1e-5 * np.eye(numbers.size)
    columns = [(of(numbers + step) - of(numbers - step)) / 2e-5 for step in steps]
    return np.stack(columns, axis=-1)


def _rotation_to(axis: Floats) -> Rotation:
    """The shortest rotation that takes z to a unit vector."""
    across = np.cross([0.0, 0.0, 1.0], axis)
    sine = float(np.linalg.norm(across))
    angle = np.arctan2(sine, axis[2])
    return Rotation.from_rotvec(across / sine * angle if sine > 1e-12 else [angle, 0.0, 0.0])


def _wxyz(turn: Rotation) -> Floats:
    return np.asarray(np.roll(turn.as_quat(), 1))
