"""An array of wide and long lenses against arrays of one of them: part of ``planned_views``.

A wide lens has the whole target in its picture, a long one its middle, finer. Both look at an
opaque ball with a texture on it, whose points are known the better the more sides they are seen
from and the finer the pictures are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.planned_sector import directions
from rift_cl.geometry import CameraType
from rift_cl.sampling import Constraints, PowerLaw, Ranges, Target, plan

# Millimetres. The long lens has a third of the ball's outline in its picture.
WIDE = CameraType("wide", 12.0, 5.6, 0.012, (480, 480))
LONG = CameraType("long", 35.0, 16.0, 0.012, (480, 480))
ARRAYS = {"wide": (WIDE,), "long": (LONG,), "wide and long": (WIDE, LONG)}
VIEWS, DISTANCE = 24, 260.0
_DIAMETER, _POINTS, _BAND = 60.0, 24, 6.0
# In focus is the side of the ball that faces the camera.
_FOCUS = Ranges(focus=(-25.0, -25.0))
_RIG = Constraints(
    elevation=(-np.pi / 6, np.pi / 2),
    distance=DISTANCE,
    cover=0.25,
)

Floats = NDArray[np.float64]


def ball() -> Target:
    """A textured ball of 60 mm."""
    i = np.arange(_POINTS)
    elevation = np.arcsin(1 - (i + 0.5) / _POINTS * 1.4)
    normals = directions(np.pi * (1 + np.sqrt(5)) * i, elevation)
    return Target(
        (0, 0, 0),
        _DIAMETER,
        points=normals * _DIAMETER / 2,
        normals=normals,
        mode="surface",
        prior=PowerLaw(1.0),
        snr=1000.0,
        band=_BAND,
    )


def array_case(name: str) -> dict[str, Any]:
    """What is planned with an array: its merit, and each camera's place and type."""
    types = ARRAYS[name]
    ranges = {kind.name: _FOCUS for kind in types}
    made = plan(ball(), VIEWS, replace(_RIG, ranges=ranges), types)
    return {
        "array": name,
        "merit": made.merit,
        "elsewhere": made.elsewhere,
        "types": [kind.name for kind in made.types],
        "azimuth": made.azimuth.tolist(),
        "elevation": made.elevation.tolist(),
    }
