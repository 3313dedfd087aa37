"""What a notebook shows of a result: its name, a few figures, and the pictures that say most.

A notebook has no room for a report, and none of its style sheets: these pieces of HTML carry what
they need in themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rift_cl.reconstruct.axis.estimate import AxisEstimate
from rift_cl.reconstruct.calibration.calibrate import Calibration
from rift_cl.report.html_page.pictures import data_address
from rift_cl.report.html_page.text import cell, escape
from rift_cl.report.plot import Stands, camera_plot, curves, figure_svg
from rift_cl.sampling.planning.view_plan import Plan

# Pixels across a picture that stands beside others, and across a drawing.
_PICTURE, _DRAWING = 300, 760


def card(
    title: str,
    facts: Mapping[str, object],
    pictures: Sequence[tuple[str, bytes]] = (),
    *,
    width: int = _PICTURE,
    more: str = "",
) -> str:
    """A result as HTML.

    Args:
        title: what it is.
        facts: figures by name.
        pictures: a caption and the content of a PNG, JPEG or SVG file each.
        width: pixels across a picture, at most.
        more: HTML that comes below.
    """
    rows = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th><td>{escape(cell(value))}</td></tr>"
        for name, value in facts.items()
    )
    shown = "".join(_figure(caption, content, width) for caption, content in pictures)
    return (
        f"<div><p><b>{escape(title)}</b></p><table>{rows}</table>"
        f"<div style='display:flex;flex-wrap:wrap;gap:8px'>{shown}</div>{more}</div>"
    )


def axis_card(found: AxisEstimate) -> str:
    """Where the axis is, and the curve of how likely each bin is."""
    low, high = found.interval
    figure = curves(
        {"all rows": (found.scores[0], found.scores[1])},
        xlabel="centre at the middle row, bins",
        ylabel="log-likelihood",
        mark=round(found.center, 2),
    )
    facts = {
        "centre, bins": f"{found.center:.2f}",
        "95 % interval": f"{low:.2f} to {high:.2f}",
        "tilt, bins per row": found.tilt,
        "found by": found.by,
    }
    curve = ("log-likelihood of each centre", figure_svg(figure))
    return card("Rotation axis", facts, [curve], width=_DRAWING)


def calibration_card(found: Calibration) -> str:
    """What the data say of a scan's geometry, a row for each quantity, and the axis."""
    lines = "".join(f"<li>{escape(line)}</li>" for line in found.in_words().splitlines())
    return f"<div><ul>{lines}</ul>{axis_card(found.axis)}</div>"


def plan_card(plan: Plan) -> str:
    """What a plan is worth, and where its cameras stand."""
    design = plan.objective.design
    groups = {"taken already": plan.fixed, "planned": plan.cameras}
    drawing = camera_plot(
        {name: Stands.of(cameras) for name, cameras in groups.items() if cameras},
        center=tuple(design.target.center),
        diameter=design.target.diameter,
        up=tuple(design.constraints.up),
        unit="",
    )
    facts = {"views": len(plan), plan.objective.kind: plan.elsewhere}
    facts |= {name: entry.elsewhere for name, entry in plan.baselines.items()}
    shown = ("cameras from above and from the side", figure_svg(drawing))
    return card(plan.verdict(), facts, [shown], width=_DRAWING)


def _figure(caption: str, content: bytes, width: int) -> str:
    # Drawings have dark ink and nothing behind it, which a dark notebook would hide.
    return (
        f"<figure style='margin:0;max-width:{width}px'>"
        f"<img src='{data_address(content)}' alt='{escape(caption)}' "
        "style='width:100%;background:#fff'>"
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
