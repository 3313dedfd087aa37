"""How often a circular scan from a point measures each line, and what its rays then count.

The ray at fan angle gamma in the view at angle beta runs along the same line as the ray at -gamma
in the view at ``beta + pi - 2 gamma``. Filtered backprojection counts every line once:

- a full turn measures each line twice, and every view counts half the angle that it stands for;
- a full turn whose axis is seen near one end of the detector measures the lines near the axis
  twice and those beyond once: weights go smoothly from 0 to 2 across what is measured twice
  (Wang, X-ray micro-CT with a displaced detector array, Medical Physics 29, 1634, 2002). Where
  the axis is off the middle by a little they do so next to the ends of the shorter side alone,
  so that noise averages out between the two rays of all other lines;
- a short scan of half a turn and the fan measures some lines twice, and weights rise and fall
  smoothly over those (Parker, Optimal short scan convolution reconstruction for fanbeam CT,
  Medical Physics 9, 254, 1982). With half the excess over half a turn in the place of the fan's
  half-angle they hold for longer spans as well (Silver, Medical Physics 27, 773, 2000).

In the source's orbit this is exact; a line that leaves it is measured once at most, and the
weights are those of its shadow in the orbit, which is the approximation of Feldkamp, Davis and
Kress. Views may come in any order and turn in either sense: their places on the circle count alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Fan
from rift_cl.reconstruct.direct.offset_axis import (
    displaced_detector,
    is_full_turn,
    is_uneven,
    sees_further,
    weighed_share,
)
from rift_cl.reconstruct.direct.view_weights import view_weights

Floats = NDArray[np.float64]

# A span may lack this many steps between views of half a turn and the fan.
_SLACK = 1.5
# A gap within the span that is wider than this, and than so many mean gaps, is no sampling.
_HOLE, _HOLE_MEANS = np.pi / 12, 4.0
ITERATE = "cgls, sirt and tv reconstruct from any views"


class Redundancy(NamedTuple):
    """What views and rays of a scan count in filtered backprojection.

    Args:
        views: (views,) radians: the angle that each view stands for, halved where lines are
            measured twice.
        rays: (views, bins) factors, or (1, bins) where all views are alike.
        missing: bins that the shorter side of the detector lacks of the longer, before its first
            bin and after its last, 0 unless the axis is off its middle.
        sentence: what was chosen, for a reader.
    """

    views: Floats
    rays: Floats
    missing: tuple[int, int]
    sentence: str


def redundancy(scan: Fan | Cone, compensate: str | None = None) -> Redundancy:
    """What views and rays of a circular scan count, as its span and its detector ask for.

    Args:
        scan: the scan.
        compensate: ``voronoi``: each view stands for half the gaps to its neighbours. ``uniform``:
            every view for the same angle. None: as ``voronoi``.

    Raises:
        InputError: the views span less than half a turn and the fan or leave a hole in it, a
            detector that sees one side of the axis alone does not go all round, or the
            compensation is unknown or depends on frequency.
    """
    if compensate not in (None, "voronoi", "uniform"):
        raise InputError(
            f"compensate is {compensate!r}, wanted None, 'voronoi' or 'uniform' for rays from a "
            "point"
        )
    gamma, degrees = scan.fan_angles(), np.rad2deg
    center = scan.center[1] if isinstance(scan, Cone) else scan.center
    left, right = center, scan.bins - 1 - center
    if is_full_turn(scan.angles):
        # Twice around for halves of angles is once around: what counts is the whole circle.
        views = view_weights(scan.angles / 2, compensate or "voronoi")
        rays, missing = np.ones((1, scan.bins)), 0
        sentence = f"full turn of {scan.views} views, every line measured twice"
        if is_uneven(center, scan.bins):
            short, share = min(left, right), weighed_share(center, scan.bins)
            rays = displaced_detector(gamma, share)[None]
            missing = int(np.ceil(abs(right - left)))
            where = f"axis at bin {center:g} of {scan.bins}"
            which = (
                f"Wang's weights across the {2 * short:.0f} bins about it"
                if share == 1
                else f"lines beyond {short:g} bins from it are measured once and count twice, with "
                f"weights that change over within {share * short:.0f} bins"
            )
            sentence = f"full turn of {scan.views} views, {where}: {which}"
        elif not min(left, right) > 0:
            raise InputError(
                f"scan: the axis is seen at bin {center:g}, off a detector of {scan.bins} bins, so "
                f"that no line is measured from both sides; {ITERATE}"
            )
        before = missing if right > left else 0
        return Redundancy(views, rays, (before, missing - before), sentence)
    beta, cells = _arc(scan.angles)
    if compensate == "uniform":
        cells = np.full_like(cells, cells.mean())
    span, fan = float(cells.sum()), 2 * float(np.abs(gamma).max())
    if span < np.pi + fan - _SLACK * span / scan.views:
        raise InputError(
            f"scan: the views span {degrees(span):.3g} degrees, and filtered backprojection wants "
            f"{degrees(np.pi + fan):.4g}, half a turn and the fan; {ITERATE}"
        )
    excess = max((span - np.pi) / 2, 0.0)
    sentence = (
        f"short scan of {degrees(span):.4g} degrees, no views in the other "
        f"{degrees(2 * np.pi - span):.3g} of the turn: Parker's weights, half-angle "
        f"{degrees(excess):.3g} degrees"
    )
    if sees_further(center, scan.bins):
        sentence += (
            f"; the axis is at bin {center:g} of {scan.bins}, and the views do not go all round: "
            f"objects that reach further from the axis than {min(left, right):g} bins are not right"
        )
    return Redundancy(cells, short_scan(beta, gamma, excess), (0, 0), sentence)


def short_scan(beta: Floats, gamma: Floats, excess: float) -> Floats:
    """Parker's weights of a scan over ``pi + 2 excess``.

    Args:
        beta: (views,) angles of the views from the beginning of the span, in radians.
        gamma: (bins,) fan angles in radians, within ``excess`` of the axis.
        excess: half of what the span exceeds half a turn by, in radians.

    Returns:
        (views, bins) weights from 0 to 1, which add up to 1 for the two rays of a line.
    """
    b, g = beta[:, None], np.clip(gamma, -excess, excess)
    # At the ends of the fan a rise has no width, and no view within it.
    rise, fall = np.maximum(excess + g, 1e-12), np.maximum(excess - g, 1e-12)
    entering = np.sin(np.pi / 4 * np.clip(b / rise, 0, 2)) ** 2
    leaving = np.sin(np.pi / 4 * np.clip((np.pi + 2 * excess - b) / fall, 0, 2)) ** 2
    weights: Floats = np.minimum(entering, leaving)
    return weights


def _arc(angles: Floats) -> tuple[Floats, Floats]:
    """Places of views on the arc that they cover, from its beginning, and what each stands for."""
    circle = np.mod(angles, 2 * np.pi)
    order = np.argsort(circle, kind="stable")
    ascending = circle[order]
    gaps = np.diff(ascending, append=ascending[0] + 2 * np.pi)
    # The widest gap is where the arc ends.
    last = int(np.argmax(gaps))
    order, gaps = np.roll(order, -last - 1), np.roll(gaps, -last - 1)[:-1]
    if not len(gaps):
        return np.zeros(1), np.zeros(1)
    if gaps.max() > max(_HOLE, _HOLE_MEANS * gaps.mean()):
        raise InputError(
            f"scan: {np.rad2deg(gaps.max()):.3g} degrees within the span have no view, and "
            f"filtered backprojection wants views without a hole; {ITERATE}"
        )
    halves = np.concatenate([gaps[:1], gaps, gaps[-1:]]) / 2
    beta, cells = np.empty(len(order)), np.empty(len(order))
    beta[order] = halves[0] + np.concatenate([[0], np.cumsum(gaps)])
    cells[order] = halves[:-1] + halves[1:]
    return beta, cells
