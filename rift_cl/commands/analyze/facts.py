"""Missing directions and resolution limits of views, as figures, tables and sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rift_cl.commands.inputs.view_set import ViewSet
from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.criteria.crowther import crowther, crowther_views
from rift_cl.sampling.criteria.limits import CAUSES, Limits, limits
from rift_cl.sampling.criteria.merit import criterion_of_coverage
from rift_cl.sampling.criteria.orlov import Orlov, orlov
from rift_cl.sampling.criteria.tuy import Tuy, tuy
from rift_cl.sampling.targets.scattered import scattered

Table = tuple[tuple[str, ...], list[tuple[Any, ...]], str]
# Frequencies, in cycles per diameter, at which holes are looked for.
_CYCLES, _DETAIL = (2, 4, 8, 16, 64, 256), 8
_ONE = (
    "A single view samples one slice: it does not resolve depth along its line of sight, and there "
    "is no angle between views."
)
# Views within so many degrees of each other count as taken from one place.
_ONE_PLACE = 2.0
# A limit so much finer than pixels is none: the target is in focus to rounding.
_ENDLESS = 1e6
_KEYS = (*(cause.replace(" ", "_") for cause in CAUSES), "reached")
WHY = {
    "pixel": "move closer, use a longer lens, or smaller pixels",
    "diffraction": "open the aperture",
    "depth of field": "close the aperture, or change the focus",
    "number of views": "add views, or distribute them more evenly",
}


@dataclass(frozen=True, eq=False)
class Findings:
    """What was found.

    Args:
        figures: for metrics.json.
        tables: columns, rows and caption of each, for people.
        sentences: conclusions, for people.
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
        sentences.append(_planes(planes))
    return Findings(figures, (_holes(found, sampled.unit),), tuple(sentences))


def one_place(sampled: ViewSet) -> tuple[str, ...]:
    """A sentence if all views are taken from the same place; none otherwise."""
    ways = sampled.directions()
    if len(ways) < 2:
        return ()
    # Opposite views of a transparent target are equivalent.
    near = ways @ ways.T if sampled.opaque else np.abs(ways @ ways.T)
    apart = math.degrees(math.acos(min(1.0, float(near.min()))))
    if apart > _ONE_PLACE:
        return ()
    return (
        f"All {len(ways)} views that see the target are taken from one place, at most {apart:.2g} "
        "degrees apart: they add nothing to a single view, and do not resolve depth.",
    )


def _resolved_by(frequency: float, sampled: ViewSet) -> str:
    """The resolution of the slices in nine tenths of all directions, as part of a sentence."""
    if frequency * sampled.target.diameter < 1:
        return ", and leave more than a tenth of all directions unresolved"
    return f", and resolve {1 / frequency:.3g} {sampled.units} in nine tenths of all directions"


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
    columns = ("frequency", f"cycles per {unit}", "missing", "largest hole", "axis")
    caption = (
        "Fraction of the directions of detail that no view samples (Orlov's condition), and the "
        "largest hole among them: the angle from its axis to the nearest slice."
    )
    return columns, rows, caption


def _axis(entry: Orlov) -> str:
    return "({:.2f}, {:.2f}, {:.2f})".format(*(entry.axis + 0.0))


def _hole(entry: Orlov) -> str:
    if entry.satisfied:
        return "At 8 cycles per diameter every direction of detail is sampled: no missing cone."
    return (
        f"At 8 cycles per diameter {entry.missing:.1%} of all directions of detail are not "
        f"sampled. The largest missing cone has a half-angle of {math.degrees(entry.angle):.3g} "
        f"degrees about {_axis(entry)}: detail along it is not measured."
    )


def _planes(found: Tuy) -> str:
    path = "the path through neighbouring cameras"
    if found.satisfied:
        return f"Tuy's condition is met: every plane through the target meets {path}."
    return (
        f"Tuy's condition is not met: {found.unmet_in_words} of the planes through the target do "
        f"not meet {path}."
    )


def resolution(sampled: ViewSet, names: tuple[str, ...]) -> Findings:
    """The resolution limits at each point of the target, and Crowther's number of views.

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
    heads = ("point", *CAUSES, "combined", "limited by")
    caption = (
        f"Period of the finest resolved detail, in {units}: by each cause alone (median over the "
        "cameras), and combined, in nine tenths of all directions. A dash means no limit; none "
        "means no detail, since the period exceeds the target."
    )
    needed = crowther_views(target.diameter, 1 / target.highest)
    sentences = (
        _ended(found, names[0], sampled),
        f"By Crowther's criterion {needed} views evenly spaced on a circle resolve periods of "
        f"{1 / target.highest:.3g} {units} in all directions; {count.views} of these views see the "
        f"target's centre{_resolved_by(count.frequency, sampled)}.",
    )
    reached = {"needed": needed, "wanted": target.highest, "frequency": count.frequency}
    record = {"limits": points, "crowther": {"views": count.views, **reached}}
    return Findings(record, ((heads, rows, caption),), sentences)


def _ended(found: Limits, name: str, sampled: ViewSet) -> str:
    """The limit at the first point; within the sampled directions, where many are missing."""
    units, cause = sampled.units, found.cause[0]
    if found.reached[0] * sampled.target.diameter >= 1 or not found.within[0]:
        return (
            f"The {cause} limits resolution at the {name}, to a period of "
            f"{1 / found.reached[0]:.3g} {units}: {WHY[cause]}."
        )
    return (
        f"{found.unseen[0]:.0%} of all directions of detail are not sampled at the {name}: "
        f"{WHY['number of views']}. Within those that are, the median resolution is a period of "
        f"{1 / found.within[0]:.3g} {units}."
    )


def _ends(found: Limits, p: int, name: str) -> dict[str, Any]:
    """The limiting frequencies at a point, by cause."""
    observed = found.camera[:, p] > 0
    parts = [
        float(np.median(end[observed, p])) for end in (found.pixel, found.diffraction, found.focus)
    ]
    ends = (*parts, float(found.number[p]), float(found.reached[p]))
    return {
        "point": name,
        **dict(zip(_KEYS, ends, strict=True)),
        "limited_by": found.cause[p],
        "unsampled": float(found.unseen[p]),
        "within_seen": float(found.within[p]),
    }


def length_in_words(frequency: float, sampled: ViewSet) -> str:
    """The period at a limit; a dash where there is none, ``none`` where nothing is resolved."""
    if frequency * sampled.target.diameter < 1:
        return "none"
    return f"{1 / frequency:.3g}" if frequency < _ENDLESS * sampled.finest else "–"


def unknown_share(sampled: ViewSet) -> float:
    """The posterior variance as a fraction of the prior, for a power spectrum 1/k^2."""
    target = scattered(sampled.target)
    found = host_coverage(sampled.observations(), target.k, target.diameter)
    return criterion_of_coverage("wiener", found, target).value
