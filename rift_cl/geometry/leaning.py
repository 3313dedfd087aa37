"""A cone whose detector is turned in its plane, so that the axis leans on it."""

from __future__ import annotations

import math

from rift_cl.geometry.cone import Cone
from rift_cl.geometry.vectors import Vectors


def leaning(cone: Cone, lean: float) -> Vectors:
    """A cone whose detector is turned in its plane, about the middle of the axis.

    Args:
        cone: the cone whose axis runs along the columns.
        lean: of the axis as the detector shows it, in radians, positive where its bin grows with
            the row.
    """
    straight = cone.vectors()
    rows, bins = cone.pitch
    across = straight.across / bins
    down = straight.down / rows
    cosine, sine = math.cos(lean), math.sin(lean)
    # The axis is along z and shows as down + lean * across: the detector is turned against it.
    turned_across = cosine * across + sine * down
    turned_down = cosine * down - sine * across
    row = (cone.rows - 1) / 2 - cone.center[0]
    bin = (cone.bins - 1) / 2 - cone.center[1]
    foot = straight.middle - row * straight.down - bin * straight.across
    middle = foot + row * rows * turned_down + bin * bins * turned_across
    return Vectors(
        straight.source, middle, bins * turned_across, rows * turned_down, cone.rows, cone.bins
    )
