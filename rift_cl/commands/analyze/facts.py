"""What views miss, and what limits their detail, as figures, tables and sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.commands.inputs.view_set import ViewSet
from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.criteria.crowther import crowther, crowther_views
from rift_cl.sampling.criteria.limits import CAUSES, Limits, limits
from rift_cl.sampling.criteria.merit import merit_of_coverage
from rift_cl.sampling.criteria.orlov import Orlov, orlov
from rift_cl.sampling.criteria.tuy import tuy

Table = tuple[tuple[str, ...], list[tuple[Any, ...]], str]
# Frequencies, in cycles per diameter, at which holes are looked for.
_CYCLES, _DETAIL = (2, 4, 8, 16, 64, 256), 8
_ONE = (
    "One view samples a single slice: it tells nothing of where along its line of sight anything "
    "lies, and no angle between views can be given."
)
# Degrees between the views that lie farthest apart, up to which they stand at one place.
_ONE_PLACE = 2.0
# So much finer than pixels, a limit is none: what is in focus to rounding.
_ENDLESS = 1e6
_KEYS = (*(cause.replace(" ", "_") for cause in CAUSES), "reached")
WHY = {
    "pixel": "get nearer, take a longer lens, or smaller pixels",
    "diffraction": "open the aperture",
    "depth of field": "close the aperture, or focus where it matters",
    "number of views": "take more views, or spread them better",
}


@dataclass(frozen=True, eq=False)
class Findings:
    """What was found.

    Args:
        figures: for metrics.json.
        tables: columns, rows and caption of each, for people.
        sentences: what it comes to.
    """

    figures: dict[str, Any]
    tables: tuple[Table, ...]
    sentences: tuple[str, ...]


def missing(sampled: ViewSet) -> Findings:
    """Orlov's and Tuy's conditions, the missing cone and the largest gap."""
    observations, target = sampled.observations(), sampled.target
    finest = sampled.finest * target.diameter
    found = {
        n: orlov(observations, target, frequency=n / target.diameter)
        for n in _CYCLES
        if n <= max(finest, _DETAIL)
    }
    figures: dict[str, Any] = {
        "missing": [
            {"cycles_per_diameter": n, "share": entry.missing, "axis": entry.axis.tolist(),
             "half_angle_degrees": math.degrees(entry.angle)}
            for n, entry in found.items()
        ],
        "orlov": found[max(found)].satisfied,
        "tuy": None,
    }  # fmt: skip
    sentences = [_hole(found[_DETAIL]), *one_place(sampled)]
    if len(observations.weight) == 1:
        sentences.append(_ONE)
    if not sampled.is_flat and all(camera.model != "ortho" for camera in sampled.cameras):
        planes = tuy(sampled.cameras, target)
        figures["tuy"] = {"unmet": planes.unmet, "tolerance": planes.tolerance}
        sentences.append(_planes(planes.unmet, f"{planes.tolerance:.3g} {sampled.units}"))
    return Findings(figures, (_holes(found, sampled.unit),), tuple(sentences))


def one_place(sampled: ViewSet) -> tuple[str, ...]:
    """A sentence if several views look from one and the same side; none otherwise."""
    ways = sampled.directions()
    if len(ways) < 2:
        return ()
    # Opposite views of what is seen through tell the same.
    near = ways @ ways.T if sampled.opaque else np.abs(ways @ ways.T)
    apart = math.degrees(math.acos(min(1.0, float(near.min()))))
    if apart > _ONE_PLACE:
        return ()
    return (
        f"All {len(ways)} views that see the target look from one place, {apart:.2g} degrees apart "
        "at the most: they tell no more of it than one view does, and nothing of its depth.",
    )


def _told_by(frequency: float, sampled: ViewSet) -> str:
    """What a set's slices tell in nine tenths of all directions, if that is less than the whole."""
    if frequency * sampled.target.diameter < 1:
        return ", and leave more than a tenth of all directions without any detail"
    return f", and tell {1 / frequency:.3g} {sampled.units}"


def _holes(found: dict[int, Orlov], unit: str) -> Table:
    rows: list[tuple[Any, ...]] = [
        (
            f"{n} per diameter",
            f"{entry.frequency:.4g}",
            f"{entry.missing:.1%}",
            "none" if entry.satisfied else f"{math.degrees(entry.angle):.3g}°",
            "" if entry.satisfied else _axis(entry),
        )
        for n, entry in found.items()
    ]
    columns = ("detail of", f"cycles per {unit}", "on no slice", "largest hole", "about")
    caption = (
        "Directions of detail that no view samples (Orlov's condition), and the largest hole among "
        "them: from its middle to the nearest slice."
    )
    return columns, rows, caption


def _axis(entry: Orlov) -> str:
    return "({:.2f}, {:.2f}, {:.2f})".format(*(entry.axis + 0.0))


def _hole(entry: Orlov) -> str:
    if entry.satisfied:
        return "At 8 cycles per diameter every direction of detail lies on a slice: no cone misses."
    return (
        f"At 8 cycles per diameter {entry.missing:.1%} of all directions of detail lie on no "
        f"slice. The largest hole is a cone of {math.degrees(entry.angle):.3g} degrees about "
        f"{_axis(entry)}: detail along it is guessed, not measured."
    )


def _planes(unmet: float, near: str) -> str:
    if unmet == 0:
        return f"Tuy's condition is met: every plane through the target has a camera within {near}."
    return (
        f"Tuy's condition is not met: {unmet:.1%} of the planes through the target have no camera "
        f"within {near}."
    )


def resolution(sampled: ViewSet, names: tuple[str, ...]) -> Findings:
    """What ends detail at each point of the target, with lengths, and Crowther's count.

    Args:
        sampled: the views.
        names: of the target's points.
    """
    observations, target, units = sampled.observations(), sampled.target, sampled.units
    found, count = limits(observations, target), crowther(observations, target)
    points = [_ends(found, p, name) for p, name in enumerate(names)]
    rows = [
        (
            point["point"],
            *(length_in_words(point[key], sampled) for key in _KEYS),
            point["limited_by"],
        )
        for point in points
    ]
    heads = ("point", *CAUSES, "all together", "limited by")
    caption = (
        f"One cycle of the finest detail, in {units}: by each cause alone (of cameras, the middle "
        "one), and by all together in nine tenths of all directions. A dash is no limit; none is "
        "no detail, since a cycle is longer than the target."
    )
    needed = crowther_views(target.diameter, 1 / target.highest)
    sentences = (
        _ended(found, names[0], sampled),
        f"By Crowther's count {needed} views evenly round a circle tell detail of "
        f"{1 / target.highest:.3g} {units} a cycle; {count.views} of these see the target's "
        f"middle{_told_by(count.frequency, sampled)}.",
    )
    reached = {"needed": needed, "wanted": target.highest, "frequency": count.frequency}
    record = {"limits": points, "crowther": {"views": count.views, **reached}}
    return Findings(record, ((heads, rows, caption),), sentences)


def _ended(found: Limits, name: str, sampled: ViewSet) -> str:
    """What ends detail at the first point; within the directions seen, where many are not."""
    units, cause = sampled.units, found.cause[0]
    if found.reached[0] * sampled.target.diameter >= 1 or not found.within[0]:
        return (
            f"The {cause} limits detail at the {name}, to a cycle of {1 / found.reached[0]:.3g} "
            f"{units}: {WHY[cause]}."
        )
    return (
        f"{found.unseen[0]:.0%} of all directions of detail are not seen at the {name}: "
        f"{WHY['number of views']}. Within those that are seen, detail ends at a cycle of "
        f"{1 / found.within[0]:.3g} {units} in the median."
    )


def _ends(found: Limits, p: int, name: str) -> dict[str, Any]:
    """The frequencies at which detail ends at a point, by cause."""
    seen = found.camera[:, p] > 0
    parts = [
        float(np.median(end[seen, p])) for end in (found.pixel, found.diffraction, found.focus)
    ]
    ends = (*parts, float(found.number[p]), float(found.reached[p]))
    return {
        "point": name,
        **dict(zip(_KEYS, ends, strict=True)),
        "limited_by": found.cause[p],
        "unseen": float(found.unseen[p]),
        "within_seen": float(found.within[p]),
    }


def length_in_words(frequency: float, sampled: ViewSet) -> str:
    """One cycle at which detail ends; a dash where it does not, none where nothing is told."""
    if frequency * sampled.target.diameter < 1:
        return "none"
    return f"{1 / frequency:.3g}" if frequency < _ENDLESS * sampled.finest else "–"


def unknown_share(sampled: ViewSet) -> float:
    """The share of the target's power that stays unknown, if it falls as 1/k^2."""
    target = sampled.target
    found = host_coverage(sampled.observations(), target.k, target.diameter)
    return merit_of_coverage("wiener", found, target).value
