"""Result of a search for the rotation axis."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.sense import Sense

Floats = NDArray[np.float64]


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

    @property
    def tilt_error(self) -> float:
        """The standard error of ``tilt``, in bins per row; infinite of fewer than three rows."""
        if self.rows.size < 3:
            return float("inf")
        weights = 1 / self.errors**2
        away = self.rows - np.average(self.rows, weights=weights)
        left = self.centers - np.average(self.centers, weights=weights) - self.tilt * away
        scatter = np.sqrt((weights * left**2).sum() / (self.rows.size - 2))
        return float(max(1.0, scatter) / np.sqrt((weights * away**2).sum()))

    def in_words(self) -> str:
        """Where the axis is, how surely, and what told it."""
        low, high = self.interval
        said = (
            f"at bin {self.center:.2f} ({low:.2f} to {high:.2f} at 95 % confidence, by {self.by} "
            f"in {self.rows.size} rows)"
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
