"""Whether a scan turned the way its angles say.

A ray and the one that measures the same line from the other side agree if fans are read the right
way round, and contradict each other if the angles run backwards, the more the wider the fan.
Parallel beams do not tell: backwards, they show the mirror image. Reversed angles and mirrored bins
look alike, and both together give the mirror image, consistent again: data never tell which of the
two is mistaken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Fan
from rift_cl.reconstruct.axis.fan_rays import opposite_rays
from rift_cl.reconstruct.axis.views import Views

Floats = NDArray[np.float64]

# Groups of opposite rays whose agreement tells how sure the sense is, and by how many standard
# errors, and by how much, the logarithms of their mean squares must differ.
_GROUPS, _SURE, _LEAST = 12, 4.0, 0.04


@dataclass(frozen=True)
class Sense:
    """The sense of rotation that the data tell.

    Args:
        sign: 1: the angles are right as given; -1: they run the other way round, or the detector's
            bins do; 0: the data do not tell.
        disagreement: root mean square difference of opposite rays as a share of the line
            integrals' standard deviation, noise included, with the angles as given and reversed;
            NaN where no line was measured twice.
    """

    sign: Literal[-1, 0, 1]
    disagreement: tuple[float, float]

    def in_words(self) -> str:
        """One line: the sense, and by how much it was told."""
        given, turned = self.disagreement
        measured = (
            f"rays that measure one line from both sides differ by {given:.3f} of the contrast, "
            f"with reversed angles by {turned:.3f}"
        )
        if self.sign > 0:
            return f"the angles run as given ({measured})"
        if self.sign < 0:
            return (
                f"the angles run the other way round, or the detector is mirrored ({measured}); "
                "which of the two, and so which of the object and its mirror image one gets, data "
                "cannot tell"
            )
        if np.isnan(given):
            return "the sense of rotation cannot be told: no line was measured from both sides"
        return f"the sense of rotation cannot be told ({measured})"

    def record(self) -> dict[str, Any]:
        """The sense in words and numbers."""
        told = None if np.isnan(self.disagreement[0]) else list(self.disagreement)
        return {"sign": self.sign, "disagreement": told, "in_words": self.in_words()}


def sense_of(sinogram: Views, fan: Fan, centers: list[float]) -> Sense:
    """The sense in which opposite rays agree better.

    Args:
        sinogram: line integrals of one row, (view, bin).
        fan: its geometry, the angles as given.
        centers: bins at which the axis may be seen; each sense is judged at its best.
    """
    contrast = float(sinogram.std())
    squares = [
        min((_squares(sinogram, replace(one, center=center)) for center in centers), key=np.sum)
        for one in (fan, fan.at(-fan.angles))
    ]
    if squares[0].size != squares[1].size or squares[0].size < 3 or not contrast > 0:
        return Sense(0, (np.nan, np.nan))
    given, turned = (float(np.sqrt(part.mean())) / contrast for part in squares)
    ratio = np.log(squares[1] / squares[0])
    error = ratio.std(ddof=1) / np.sqrt(ratio.size)
    if not abs(ratio.mean()) > max(_SURE * error, _LEAST):
        return Sense(0, (given, turned))
    return Sense(1 if ratio.mean() > 0 else -1, (given, turned))


def _squares(sinogram: Views, fan: Fan) -> Floats:
    """Mean square difference of opposite rays, by groups of neighbouring views."""
    rays, opposite, seen = opposite_rays(sinogram, fan)
    differ = ((rays - opposite)[seen] ** 2).astype(np.float64)
    least = np.finfo(np.float32).eps * sinogram.std()
    groups = np.array_split(differ + least**2, min(_GROUPS, max(1, differ.size)))
    return np.array([group.mean() for group in groups if group.size])
