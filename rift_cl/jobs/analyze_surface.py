"""What views of an opaque target miss, and what limits their detail: figures and sentences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rift_cl.jobs.analyze_facts import WHY, Findings, length_in_words, one_place
from rift_cl.jobs.sampled import Sampled
from rift_cl.jobs.surfaces import SQUARE, sides_of
from rift_cl.sampling.surface_limits import SurfaceLimits, surface_limits

_KEYS = ("pixel", "diffraction", "depth_of_field", "reached")
_HEADS = ("point", "pixel", "diffraction", "depth of field", "all together", "limited by")


def surface_missing(sampled: Sampled, distance: float) -> Findings:
    """Which sides of the target no view shows, and which cannot be looked at.

    Args:
        sampled: the views.
        distance: of cameras from the target's middle.
    """
    sides = sides_of(sampled, distance)
    figures = {
        "mode": "surface",
        "unseen_sides": sides.unseen,
        "sides_seen_once": sides.seen_once,
        "shut_sides": None if sampled.space is None else sides.shut,
    }
    sentences = [
        f"{sides.unseen:.1%} of the target's sides are seen by no view within {SQUARE:.0f} degrees "
        f"of straight on, {sides.seen_once:.1%} by one alone."
    ]
    if sampled.space is None:
        sentences.append(
            "What stands in the way is not known: analyse the folder of a fit, or a COLMAP model "
            "with its points."
        )
    elif sides.shut > 0:
        sentences.append(
            f"A further {sides.shut:.1%} of all sides cannot be looked at, since something stands "
            "before them; they are not counted."
        )
    return Findings(figures, (), (*sentences, *one_place(sampled)))


def surface_resolution(sampled: Sampled, names: tuple[str, ...]) -> Findings:
    """What ends detail at each point of the target, and how well parallax tells its depth.

    Args:
        sampled: the views.
        names: of the target's points.
    """
    found, units = surface_limits(sampled.looks(), sampled.target), sampled.units
    points = [_ends(found, p, name) for p, name in enumerate(names)]
    rows = [
        (
            point["point"],
            *(length_in_words(point[key], sampled) for key in _KEYS),
            point["limited_by"],
            _depth(point["depth"]),
        )
        for point in points
    ]
    caption = (
        f"One cycle of the finest detail, in {units}, as the middle one of the cameras tells it; a "
        "dash is no limit. Depth is what a pixel of parallax is worth between the two views that "
        "lie farthest apart."
    )
    first = points[0]
    sentences = [
        f"The {first['limited_by']} limits detail at the {names[0]}, to a cycle of "
        f"{length_in_words(first['reached'], sampled)} {units}: {WHY[first['limited_by']]}.",
        _parallax(first["parallax_degrees"], first["depth"], units),
    ]
    table = ((*_HEADS, f"depth, {units}"), rows, caption)
    return Findings({"limits": points}, (table,), tuple(sentences))


def _ends(found: SurfaceLimits, p: int, name: str) -> dict[str, Any]:
    ends = (found.pixel[p], found.diffraction[p], found.focus[p], found.reached[p])
    return {
        "point": name,
        **dict(zip(_KEYS, map(float, ends), strict=True)),
        "limited_by": found.cause[p],
        "parallax_degrees": math.degrees(found.parallax[p]),
        "depth": float(found.depth[p]),
    }


def _depth(depth: float) -> str:
    return f"{depth:.3g}" if np.isfinite(depth) else "not told"


def _parallax(degrees: float, depth: float, units: str) -> str:
    if not np.isfinite(depth):
        return "No two views see it from different sides: nothing tells its depth."
    return (
        f"The views that see it lie up to {degrees:.3g} degrees apart (a right angle counts at "
        f"most), so that a pixel of parallax is {depth:.3g} {units} of depth."
    )
