"""What a pixel leaves on the detector: three models of it, as the numbers that kernels read.

A model is its half-width on the detector and a record for each view; whatever else the projector
does is the same for all of them. ``kernels/include/tomo/footprint.h`` has the profiles that weight
a bin by its distance. Strips are otherwise summed over the edges between bins, which takes less
(``kernels/include/tomo/shadow.h``), as long as no shadow covers many of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError

Floats = NDArray[np.float64]

FOOTPRINTS = ("strip", "joseph", "linear")
# The one that weighs rays and not shadows, which tables of several slices do not.
_SINGLE = "joseph"
_RECORD = 8
# Bins, to which shares beyond edges are rounded as one number: wider shadows go bin by bin.
_WIDEST_BY_EDGES = 4.0
# Where a ramp has no width its inverse is never used, but must be a number.
_NARROWEST = 1e-30


@dataclass(frozen=True)
class FootprintRecords:
    """A footprint's numbers for a run of views.

    Args:
        support: half-widths in bins, (n,), of what bins or edges in reach are weighted by.
        records: what the kernels read for each view, (n, 8).
        by_edges: whether they are those of ``shadow.h``, and not those of ``footprint.h``.
    """

    support: Floats
    records: Floats
    by_edges: bool = False

    def of_views(self, chosen: NDArray[np.bool_]) -> FootprintRecords:
        """The numbers of some of the views."""
        return replace(self, support=self.support[chosen], records=self.records[chosen])


def check_footprint(name: str, known: tuple[str, ...] = FOOTPRINTS) -> str:
    """The name itself.

    Args:
        name: of a footprint.
        known: those that the projector has.

    Raises:
        InputError: it is none of them.
    """
    if name not in known:
        wanted = ", ".join(map(repr, known[:-1])) + f" or {known[-1]!r}"
        only = f": {name} is for parallel beams and fans of one slice" if name == _SINGLE else ""
        raise InputError(f"footprint is {name!r}, wanted {wanted}{only}")
    return name


def check_depth_power(power: int) -> int:
    """The power of the inverse depth that shares are weighted by, as a plain number.

    Raises:
        InputError: it is neither 1 nor 2.
    """
    if power not in (1, 2):
        raise InputError(f"depth_power is {power!r}, wanted 1 or 2")
    return int(power)


def footprint_records(name: str, step: Floats, cross_step: Floats, mass: float) -> FootprintRecords:
    """The numbers of views.

    Args:
        name: of the footprint.
        step: how far a view's pixel reaches over the detector by its longer shadow, in bins, (n,).
        cross_step: and by its shorter one, (n,).
        mass: what all bins of an endless detector receive from a pixel of one.
    """
    if name == "strip":
        by_edges = np.max(step, initial=0) <= _WIDEST_BY_EDGES
        return (_strip_by_edges if by_edges else _strip)(step, cross_step, mass)
    half_width = step if name == "joseph" else np.maximum(1.0, step)
    return _packed(half_width, mass / half_width, 1 / half_width)


def _strip_by_edges(step: Floats, cross_step: Floats, mass: float) -> FootprintRecords:
    half_width, inverse = (step + cross_step) / 2, 0.5 / np.maximum(cross_step, _NARROWEST)
    packed = _packed(half_width, mass / step, cross_step, inverse, step)
    return replace(packed, by_edges=True)


def _strip(step: Floats, cross_step: Floats, mass: float) -> FootprintRecords:
    short, middle, longest = np.sort([step, cross_step, np.ones_like(step)], axis=0)
    inverse = 0.5 / np.maximum(short, _NARROWEST)
    top = np.maximum(short + middle - longest, 0) / 2
    shape = (longest / 2, (short + middle) / 2, short, inverse, top, middle)
    return _packed((short + middle + longest) / 2, mass / (middle * longest), *shape)


def _packed(support: Floats, scale: Floats, *shape: Floats) -> FootprintRecords:
    spare = [np.zeros_like(support)] * (_RECORD - 2 - len(shape))
    return FootprintRecords(support, np.stack([support, scale, *shape, *spare], axis=1))
