"""What a pixel leaves on the detector, written out as a matrix.

A pixel's shadow is ``along`` bins wide by one of its edges and ``across`` bins by the other:
``|dx cos| / pitch`` and ``|dy sin| / pitch``. A footprint is a density over the detector, in
1 / bin, about the place where the pixel's centre falls; bin b receives from a pixel of one, whose
mass is dx dy, the density at b times ``dx dy / pitch``.

- ``linear``: a hat ``max(0, 1 - |d| / h) / h``. With h = 1 that is linear interpolation between the
  two bins about the place; h is the wider shadow where that is more than a bin.
- ``joseph``: the same hat with h the wider shadow always. A ray through a bin's centre then reads
  each row (or column) of pixels that it crosses by linear interpolation between two of them, times
  its length between rows, dy / |cos| (Joseph, An improved algorithm for reprojecting rays through
  pixel images, 1982).
- ``strip``: the shares of the pixel's area that fall into bins. The shadow of its area is a
  trapezoid, ``(along + across) / 2`` to either side and level over ``|along - across| / 2``; a bin
  takes the trapezoid's integral over its own width.

Densities of ``linear`` over all bins of an endless detector add up to one when h is a whole number,
and nearly so when it is not; those of ``strip`` do always, those of ``joseph`` only in the mean.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]


class Footprint(NamedTuple):
    """A density over distances in bins, zero from ``half_width`` on."""

    half_width: float
    density: Callable[[Floats], Floats]


def footprint_of(name: str, along: float, across: float) -> Footprint:
    """The footprint of a pixel with these two shadows, in bins.

    Args:
        name: ``linear``, ``joseph`` or ``strip``.
        along: the shadow of one of the pixel's edges.
        across: the shadow of the other.
    """
    wider = max(along, across)
    makers = {
        "linear": lambda: _hat(max(1.0, wider)),
        "joseph": lambda: _hat(wider),
        "strip": lambda: Footprint(
            (along + across + 1) / 2,
            lambda d: _shadow(d + 0.5, along, across) - _shadow(d - 0.5, along, across),
        ),
    }
    return makers[name]()


def footprint_matrix(positions: Floats, footprint: Footprint, bins: int) -> Any:
    """The densities at all bins for all positions.

    Args:
        positions: (n,) fractional bin numbers, inside the detector or not.
        footprint: what is spread about them.
        bins: number of bins; what falls outside them is lost.

    Returns:
        Sparse (n, bins) float64 matrix.
    """
    half_width, density = footprint
    reached = int(np.ceil(2 * half_width)) + 1
    nearest = np.ceil(positions - half_width).astype(np.int64)[:, None] + np.arange(reached)
    weights = density(positions[:, None] - nearest)
    seen = (weights > 0) & (nearest >= 0) & (nearest < bins)
    entry, _ = np.nonzero(seen)
    shape = (len(positions), bins)
    return sparse.csr_matrix((weights[seen], (entry, nearest[seen])), shape=shape)


def _hat(half_width: float) -> Footprint:
    return Footprint(half_width, lambda d: np.maximum(0, 1 - np.abs(d) / half_width) / half_width)


def _shadow(place: Floats, along: float, across: float) -> Floats:
    """The share of a pixel's area whose shadow lies before a place, from 0 to 1."""
    outer, ramp, height = (along + across) / 2, min(along, across), 1 / max(along, across)
    from_end = np.maximum(0, outer - np.abs(place))
    on_ramp = np.minimum(from_end, ramp)
    with np.errstate(invalid="ignore", divide="ignore"):
        triangle = np.where(ramp > 0, on_ramp**2 / (2 * ramp), 0)
    end = height * (triangle + from_end - on_ramp)
    return np.where(place < 0, end, 1 - end)
