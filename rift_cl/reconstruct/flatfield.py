"""From detector counts to line integrals: dark and flat correction, then -log.

By Beer and Lambert a ray that arrives with I of its I0 quanta has the line integral
``-log(I / I0)`` of attenuation. Counts are corrected by the means of the dark frames (no beam)
and of the flat frames (beam, no sample). A detector column that does not answer to the beam tells
nothing: it is filled from its neighbours in the row, because one such column becomes a ring, and
one NaN a ruined slice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError

Floats = NDArray[np.float32]
# A pixel is dead when the beam raises it by less than this share of what is usual in its row.
_DEAD = 0.05
# Fewer quanta than this share of the flat are not told from none; it bounds -log at 16.1.
_FAINTEST = 1e-7


@dataclass(frozen=True)
class Attenuation:
    """Line integrals, and what had to be mended to get them.

    Args:
        projections: line integrals of attenuation, (angle, row, bin), no unit.
        dead: detector pixels that were filled from their neighbours.
        starved: samples at which no quanta were left; set to the largest line integral.
    """

    projections: Floats
    dead: int
    starved: int


def attenuation(projections: Floats, flats: Floats, darks: Floats | None = None) -> Attenuation:
    """Correct counts by flat and dark frames and take -log.

    Args:
        projections: counts, (angle, row, bin).
        flats: counts without a sample, (n, row, bin), n >= 1.
        darks: counts without the beam, (n, row, bin); zero if not given.

    Raises:
        ShapeError: frames and projections do not have the same rows and bins.
        InputError: there is no flat frame, or the beam reaches no pixel of a row.
    """
    for name, frames in (("flats", flats), ("darks", darks)):
        if frames is not None and frames.shape[1:] != projections.shape[1:]:
            raise ShapeError(
                f"{name} have shape {frames.shape}, projections {projections.shape}: rows and "
                "bins must be the same"
            )
    if not len(flats):
        raise InputError("there is no flat frame: name one, or give data that is already -log")
    dark = np.zeros(flats.shape[1:], np.float32) if darks is None else _mean(darks)
    beam = _mean(flats) - dark
    dead = ~(beam > _DEAD * np.maximum(np.median(beam, axis=1, keepdims=True), 0)) | (beam <= 0)
    if dead.all(axis=1).any():
        row = int(np.flatnonzero(dead.all(axis=1))[0])
        raise InputError(
            f"flats are no brighter than darks anywhere in row {row}: are the two swapped, or "
            "is this row outside the beam (choose rows with --rows)?"
        )
    beam[dead] = 1
    transmission: Floats = (projections - dark) / beam
    _fill(transmission, dead)
    starved = transmission < _FAINTEST
    np.maximum(transmission, _FAINTEST, out=transmission)
    np.negative(np.log(transmission, out=transmission), out=transmission)
    return Attenuation(transmission, int(dead.sum()), int(starved.sum()))


def _mean(frames: Floats) -> Floats:
    mean: Floats = frames.mean(axis=0, dtype=np.float64).astype(np.float32)
    return mean


def _fill(projections: Floats, dead: NDArray[np.bool_]) -> None:
    """Replace dead columns of each row by linear interpolation between its good ones."""
    bins = np.arange(projections.shape[2])
    for row in np.flatnonzero(dead.any(axis=1)):
        good = ~dead[row]
        for view in projections[:, row]:
            view[dead[row]] = np.interp(bins[dead[row]], bins[good], view[good])
