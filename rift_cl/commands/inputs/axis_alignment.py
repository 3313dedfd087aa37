"""Projections whose rotation axis is not at one bin of all rows: how they are put upright."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.reconstruct.preprocess import most_tilt, straightened, tilt_halo, upright

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Alignment:
    """Where the rotation axis is seen, if not at one bin of all rows.

    Args:
        center: bin at which it is to be in all rows; of a tilted axis, where it is seen at
            ``pivot``.
        pivot: the row about which projections are turned.
        tilt: of the axis in the detector's plane, in radians, positive where its bin grows with
            the row.
        centers: bin of each row of the scan, in place of a tilt.
        aspect: distance between rows over that between bins.

    Raises:
        InputError: the axis leans by more than projections are turned by.
    """

    center: float
    pivot: float
    tilt: float = 0.0
    centers: NDArray[np.float64] | None = None
    aspect: float = 1.0

    def __post_init__(self) -> None:
        """Refuse a tilt before it is announced."""
        degrees, most = math.degrees(self.tilt), most_tilt(self.aspect)
        if not abs(self.tilt) <= math.radians(most):
            raise InputError(
                f"the rotation axis leans by {degrees:.3f} degrees, and projections are turned by "
                f"{most:.3g} at most: leave them as they are (--tilt 0), or give 'rift "
                "reconstruct' the bin of the axis in every row (--centers), as of an axis that "
                "drifts; a detector that leans so far must be turned"
            )

    def halo(self, bins: int) -> int:
        """Rows that are needed on either side of those that are aligned."""
        return tilt_halo(self.tilt, bins, self.center, aspect=self.aspect) if self.tilt else 0

    def aligned(self, rows: Floats, first: int, wanted: slice, device: Device) -> Floats:
        """Rows of which the axis is at one bin.

        Args:
            rows: (angle, row, bin), the first of which is row ``first`` of the scan.
            first: see there.
            wanted: which of them to return.
            device: where to compute.
        """
        if self.centers is not None:
            centers = self.centers[first + wanted.start : first + wanted.stop]
            return straightened(rows[:, wanted], centers, self.center, device=device)
        part = (wanted.start, wanted.stop)
        pivot = self.pivot - first
        return upright(
            rows,
            self.tilt,
            self.center,
            pivot=pivot,
            rows=part,
            aspect=self.aspect,
            device=device,
        )

    @property
    def words(self) -> str:
        """What is done to the projections, in a sentence."""
        if self.centers is not None:
            return "Each row was moved to the axis that was given for it."
        return (
            f"Projections were turned by {math.degrees(self.tilt):.3f} degrees, the tilt of the "
            "axis."
        )
