"""Missing sides and resolution limits of views of an opaque target: figures and sentences.

Sentences are of what the views did not see, and of predictors that hold against errors of held-out
photographs (``verdicts``); the rest are figures in metrics.json.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rift_cl.commands.analyze.facts import WHY, Findings, length_in_words, one_place
from rift_cl.commands.analyze.verdicts import said
from rift_cl.commands.inputs.surfaces import SQUARE, sides_of
from rift_cl.commands.inputs.view_set import ViewSet
from rift_cl.sampling.criteria.surface_limits import SurfaceLimits, surface_limits

_KEYS = ("pixel", "diffraction", "depth_of_field", "reached")
_HEADS = ("point", "pixel", "diffraction", "depth of field", "combined", "limited by")


def surface_missing(sampled: ViewSet, distance: float) -> Findings:
    """Which sides of the target no view sees, and which are occluded.

    Args:
        sampled: the views.
        distance: of cameras from the target's middle.
    """
    sides = sides_of(sampled, distance)
    figures = {
        "mode": "surface",
        "largest_gap_degrees": sides.gap,
        "uncovered_sides": sides.unseen,
        "sides_seen_once": sides.seen_once,
        "shut_sides": None if sampled.space is None else sides.shut,
    }
    way = "({:.2f}, {:.2f}, {:.2f})".format(*(sides.farthest + 0.0))
    sentences = said(
        {
            "angle": f"The side of the target farthest from all views, {way}, is {sides.gap:.3g} "
            "degrees from the nearest of them.",
        }
    )
    if sides.unseen > 0:
        # A fact of the views that were taken, not a forecast of errors.
        sentences.append(
            f"{sides.unseen:.1%} of the target's sides are seen by no view within {SQUARE:.0f} "
            "degrees of their normal."
        )
    if sampled.space is None:
        sentences.append(
            "Occlusion is not known: analyze the folder of a fit, or a COLMAP model with its "
            "points."
        )
    elif sides.shut > 0:
        sentences.append(
            f"A further {sides.shut:.1%} of all sides are occluded; they are not counted."
        )
    return Findings(figures, (), (*sentences, *one_place(sampled)))


def surface_resolution(sampled: ViewSet, names: tuple[str, ...]) -> Findings:
    """The resolution limits at each point of the target, and the depth resolution of parallax.

    Args:
        sampled: the views.
        names: of the target's points.
    """
    found, units = surface_limits(sampled.observations(), sampled.target), sampled.units
    points = [_ends(found, p, name) for p, name in enumerate(names)]
    rows = [
        (
            point["point"],
            *(length_in_words(point[key], sampled) for key in _KEYS),
            point["limited_by"],
        )
        for point in points
    ]
    caption = (
        f"Period of the finest resolved detail, in {units}, for the median camera; a dash means no "
        "limit."
    )
    first = points[0]
    sentences = said(
        {
            "pixel": f"The {first['limited_by']} limits resolution at the {names[0]}, to a period "
            f"of {length_in_words(first['reached'], sampled)} {units}: {WHY[first['limited_by']]}.",
            "parallax": f"The views that see it are up to {first['parallax_degrees']:.3g} degrees "
            f"apart, so that a pixel of parallax is {first['depth']:.3g} {units} of depth.",
        }
    )
    if not np.isfinite(first["depth"]):
        sentences.append(
            "No two views see it from different directions: its depth is not resolved."
        )
    return Findings({"limits": points}, ((_HEADS, rows, caption),), tuple(sentences))


def _ends(found: SurfaceLimits, p: int, name: str) -> dict[str, Any]:
    ends = (found.pixel[p], found.diffraction[p], found.focus[p], found.reached[p])
    return {
        "point": name,
        **dict(zip(_KEYS, map(float, ends), strict=True)),
        "limited_by": found.cause[p],
        "parallax_degrees": math.degrees(found.parallax[p]),
        "depth": float(found.depth[p]),
    }
