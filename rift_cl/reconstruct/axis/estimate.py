"""Result of a search for the rotation axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.sense import Sense

Floats = NDArray[np.float64]
# A tilt is sure from so many times its standard error; and where that is told by the scatter of a
# few rows, which is less sure itself. Slips of 0.6 to 3 degrees made tilts of up to 5.4 times; a
# tilt that moves the axis by a bin at the outermost rows is 20 times its error and more.
_SURE, _SURE_OF_SCATTERED = 4.0, 8.0


@dataclass(frozen=True, eq=False)
class AxisEstimate:
    """Where a rotation axis is seen on the detector.

    Args:
        center: bin of the axis at the middle row, ``(rows - 1) / 2``; of a cone at the row of the
            source's orbit.
        interval: the 95 % confidence interval of ``center``, in bins.
        tilt: by how many bins the axis moves from one row to the next; 0 for a single row.
        spread: root mean square distance of the rows' centres from the axis, in bins; 0 for a
            single row.
        by: the measure that found it: "opposite views", "double wedge", "double wedge and centre
            of mass" where both told at least one row, or "centre of mass".
        rows: (n,) the detector rows that were looked at and could tell.
        centers: (n,) the centre that each of them gives, in bins.
        errors: (n,) the standard error of each, in bins.
        scores: (2, m) trial centres and their log-likelihood, all rows together, 0 where the data
            say nothing and greatest at the best.
        sense: of rotation, as fans and cones tell it; None for parallel beams, which do not.
        doubt: what the data have against the scan's angles or lengths; empty where nothing.
        aspect: distance between rows over that between bins.
        beside_air: whether rows were chosen that show the object, as most show air.
    """

    center: float
    interval: tuple[float, float]
    tilt: float
    spread: float
    by: str
    rows: Floats
    centers: Floats
    errors: Floats
    scores: Floats
    sense: Sense | None = None
    doubt: str = ""
    aspect: float = 1.0
    beside_air: bool = False

    def degrees(self, slope: float) -> float:
        """The angle of an axis that moves by so many bins from one row to the next."""
        return math.degrees(math.atan(slope / self.aspect))

    def slope(self, degrees: float) -> float:
        """By how many bins an axis at this angle moves from one row to the next."""
        return math.tan(math.radians(degrees)) * self.aspect

    @property
    def tilt_error(self) -> float:
        """The standard error of ``tilt``, in bins per row; infinite of fewer than three rows."""
        if self.rows.size < 3:
            return float("inf")
        weights = 1 / self.errors**2
        away = self.rows - np.average(self.rows, weights=weights)
        return max(1.0, self.scatter) / float(np.sqrt((weights * away**2).sum()))

    @property
    def scatter(self) -> float:
        """How far rows lie off the axis, in their standard errors; 0 of fewer than three rows.

        About 1 where these are right, and more where rows contradict each other.
        """
        if self.rows.size < 3:
            return 0.0
        weights = 1 / self.errors**2
        away = self.rows - np.average(self.rows, weights=weights)
        left = self.centers - np.average(self.centers, weights=weights) - self.tilt * away
        return float(np.sqrt((weights * left**2).sum() / (self.rows.size - 2)))

    @property
    def tilt_is_sure(self) -> bool:
        """Whether ``tilt`` is that of an axis, and not of rows that err in different ways.

        Angles that are a little wrong move the centres of rows by what these happen to show, so
        that some lie near a slope by chance; but they scatter about it by more than their errors.
        """
        return abs(self.tilt) > self.times_sure * self.tilt_error

    @property
    def times_sure(self) -> float:
        """Of how many standard errors a tilt is sure."""
        return _SURE if self.scatter <= 1 else _SURE_OF_SCATTERED

    def in_words(self) -> str:
        """Where the axis is, how surely, and what told it."""
        low, high = self.interval
        rows = f"{self.rows.size} rows"
        if self.beside_air:
            rows += f" from {self.rows[0]:.0f} to {self.rows[-1]:.0f}, as most show air"
        said = (
            f"at bin {self.center:.2f} ({low:.2f} to {high:.2f} at 95 % confidence, by {self.by} "
            f"in {rows})"
        )
        said = said if self.sense is None else f"{said}; {self.sense.in_words()}"
        return f"{said}; {self.doubt}" if self.doubt else said

    def _repr_html_(self) -> str:
        """What a notebook shows: where the axis is, and the curve that says so."""
        html: str = import_module("rift_cl.report.notebook").axis_card(self)
        return html

    def record(self) -> dict[str, Any]:
        """The estimate in words and numbers, as reports and configurations keep it."""
        sense = {} if self.sense is None else {"sense": self.sense.record()}
        doubt = {"doubt": self.doubt} if self.doubt else {}
        return {
            "center": self.center,
            "interval": list(self.interval),
            "tilt": self.tilt,
            "spread": self.spread,
            "by": self.by,
            "rows": [int(row) for row in self.rows],
            **sense,
            **doubt,
        }
