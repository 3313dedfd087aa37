"""Views that have one angle and show different pictures: an encoder that stuck, or a wrong list.

Frames that were taken twice at one place, or in two turns, differ by noise and by what little moved
between them. So views of one angle are compared with views that follow each other, which the step
between them makes differ more: the first view of an angle and the last, so that a stage that turned
on meanwhile shows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.reconstruct.axis.views import Views, binned, without_rings

Floats = NDArray[np.float64]

# Bins that views are compared in, about, and over which slopes are taken: what all of a view has
# more, as of a beam that decays, is no other picture.
_BINS, _SLOPE = 128, 2.0
# Angles that differ by less are one, in radians.
_SAME = 1e-6
# Views of one angle differ by at least so many times as much as views that follow each other, and
# by this share of what views far apart do.
_TIMES, _SHARE = 3.0, 0.05
# Views are far apart that are separated by this share of all.
_FAR = 0.3
# Fewer views tell too little of what is usual.
_FEWEST = 12


class Repeated(NamedTuple):
    """Views that cannot have the angles that they are given.

    Args:
        views: how many have an angle that others have too.
        angle: that most of them have, in degrees.
    """

    views: int
    angle: float

    def in_words(self) -> str:
        """What contradicts the angles, as the end of a sentence."""
        return (
            f"{self.views} views have the angle of another one, most of them {self.angle:.4g} "
            "degrees, and show other pictures, as where an encoder stuck: the angles are probably "
            "wrong"
        )


def repeated_angles(views: Views, angles: Floats) -> Repeated | None:
    """Views of one angle that show different pictures.

    Args:
        views: line integrals of one row, (angle, bin), in the order in which they were taken.
        angles: their directions in radians.

    Returns:
        How many, and where; None where views of one angle agree, or there are none.
    """
    if len(views) < _FEWEST:
        return None
    _, place, counts = np.unique(
        np.round(angles / _SAME).astype(np.int64), return_inverse=True, return_counts=True
    )
    shared = np.flatnonzero(counts > 1)
    if not shared.size:
        return None
    from scipy.ndimage import gaussian_filter1d

    small = binned(without_rings(views), max(1, round(views.shape[1] / _BINS)))
    slopes = gaussian_filter1d(small, _SLOPE, axis=1, order=1, mode="nearest")
    ends = [np.flatnonzero(place == number)[[0, -1]] for number in shared]
    apart = [_difference(slopes[[first]], slopes[[last]]) for first, last in ends]
    following = _difference(slopes[:-1], slopes[1:])
    lag = max(1, round(_FAR * len(slopes)))
    far = _difference(slopes[:-lag], slopes[lag:])
    least = max(_TIMES * following, _SHARE * far)
    other = [number for number, value in zip(shared, apart, strict=True) if value > least]
    if not other:
        return None
    most = max(other, key=lambda number: counts[number])
    degrees = float(np.rad2deg(angles[place == most][0]))
    return Repeated(int(counts[other].sum()), degrees)


def _difference(one: Views, other: Views) -> float:
    """Mean square difference of pairs of views."""
    return float(np.mean((one - other) ** 2, dtype=np.float64))
