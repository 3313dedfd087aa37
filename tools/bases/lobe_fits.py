"""A lobe fitted in a basis: coefficients by ridge least squares, geometry by Gauss and Newton.

For every geometry the coefficients are the best ones (variable projection), so that only the few
numbers of axes and widths are searched, from several starts; the best end counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from bases.lobe_families import Family, Floats


@dataclass(frozen=True, eq=False)
class Fit:
    """A lobe in a basis.

    Args:
        family: the basis.
        geometry: as the basis takes it.
        coefficients: (L,) of its functions.
    """

    family: Family
    geometry: Floats
    coefficients: Floats

    def __call__(self, directions: Floats) -> Floats:
        """Values (P,) towards directions (P, 3)."""
        return np.asarray(self.family.design(self.geometry, directions) @ self.coefficients)


def fit_lobe(
    family: Family,
    directions: Floats,
    values: Floats,
    weights: Floats,
    *,
    ridge: float,
    starts: int,
    random: np.random.Generator,
    steps: int = 60,
) -> Fit:
    """Fit samples of a lobe.

    Args:
        family: the basis.
        directions: (P, 3) unit vectors.
        values: (P,) samples.
        weights: (P,) of the squared errors.
        ridge: weight of the squared coefficients against the mean squared error; above 0.
        starts: how many; linear families need none.
        random: draws them.
        steps: most Jacobians of a start.
    """
    problem = _Projected(family, directions, values, weights, ridge)
    begun = family.starts(starts, directions[int(np.argmax(values))], random)
    if not begun:
        return problem.fit(np.zeros(0))
    bounds = family.bounds()
    ends = [
        least_squares(
            problem.residual,
            np.clip(start, *bounds),
            problem.jacobian,
            bounds=bounds,
            max_nfev=steps,
            x_scale="jac",
            tr_solver="lsmr",
        )
        for start in begun
    ]
    return problem.fit(min(ends, key=lambda end: float(end.cost)).x)


class _Projected:
    """The residual as a function of the geometry alone, with Kaufman's Jacobian (1975)."""

    def __init__(
        self, family: Family, directions: Floats, values: Floats, weights: Floats, ridge: float
    ) -> None:
        self.family, self.directions, self.ridge = family, directions, ridge
        self.share = np.sqrt(weights / weights.sum())
        self.wanted = self.share * values

    def fit(self, numbers: Floats) -> Fit:
        """The fit at a geometry."""
        geometry = self.family.geometry(numbers)
        return Fit(
            self.family, geometry, self._solved(self.family.design(geometry, self.directions))[1]
        )

    def residual(self, numbers: Floats) -> Floats:
        """What is left with the best coefficients, those of the ridge below."""
        design, c = self._solved(self.family.design(self.family.geometry(numbers), self.directions))
        return np.concatenate([design @ c - self.wanted, np.sqrt(self.ridge) * c])

    def jacobian(self, numbers: Floats) -> Floats:
        """How it changes with the geometry, outside the span of the functions."""
        values, slopes = self.family.slopes(numbers, self.directions)
        design, c = self._solved(values)
        moved = self.share[:, None] * np.einsum("plg,l->pg", slopes, c)
        below = -np.sqrt(self.ridge) * ridge_least_squares(design, moved, self.ridge)
        return np.concatenate([moved + design @ below / np.sqrt(self.ridge), below])

    def _solved(self, values: Floats) -> tuple[Floats, Floats]:
        design = values * self.share[:, None]
        return design, ridge_least_squares(design, self.wanted, self.ridge)


def ridge_least_squares(design: Floats, wanted: Floats, ridge: float) -> Floats:
    """The c that minimises ``|design c - wanted|^2 + ridge |c|^2``."""
    normal = design.T @ design
    normal[np.diag_indices_from(normal)] += ridge
    return np.asarray(np.linalg.solve(normal, design.T @ wanted))
