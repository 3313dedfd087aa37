"""Full turns with the rotation axis off the detector's middle, which sees further on one side.

Over a full turn every line is met twice, from opposite sides, at t and at -t. Where the detector
reaches further on one side than on the other, lines near the axis are met twice and those beyond
once. Weights w(t) that go smoothly from 0 to 2 across the part that is met twice, with
``w(t) + w(-t) = 2``, count every line as often as all others (Wang, X-ray micro-CT with a displaced
detector array, Medical Physics 29, 1634, 2002; for parallel rays without its cosine factors).
Filtered backprojection of such views, the shorter side continued by zeros, is right to the far end
of the longer. Where the axis is off the middle by a little, weights leave 1 next to the ends of the
shorter side alone, so that noise averages out between the two rays of all other lines.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Fan, Parallel

Floats = NDArray[np.float64]
Stack = NDArray[np.float32]


class OwnSideViews(Parallel):
    """Views that were weighed and widened: each shows its own side of the axis and no other.

    Where one is missing, its neighbours on the whole circle stand for it, and the view from the
    opposite side does not.
    """


# An axis counts as offset where the shorter side is below this share of the longer.
_OFFSET = 0.8
# Sides of a detector that differ by no more bins than this reach as far as each other. Where they
# do not, and the axis is near the middle, weights go over within this share of the shorter side,
# and within no fewer bins than these.
_EVEN, _SHARE, _FEWEST_BINS = 0.5, 0.2, 12.0
# A full turn may lack as much of it as this many steps between views, or this angle: a view or
# two that were lost, and the jitter of a turntable, leave it what it is.
_SLACK, _HOLE = 1.5, np.pi / 36
# Where the axis is off the middle, views beside a hole of this angle stand for those in it: they
# left densities of three balls right to 1.3 %, and beside one of 24 degrees to 5 %. Views that
# leave a hole this much narrower than half a turn go clearly further than half a turn.
_BRIDGED = np.pi / 12
# A wider gap is no end of a span where another is at least this share of it, as between angles
# that are uneven all round; up to this angle, or so many median steps. Where every Nth view is
# left out gaps are two steps wide, and one is three where the first view and the last are left out.
# Of so few views that this may be half a turn and more, none is said to be left out.
_ALIKE, _WIDEST, _REGULAR = 0.5, np.pi / 12, 3.0
# Angles closer than this are the same, in radians.
_SAME = 1e-6


def is_full_turn(angles: Floats, hole: float = _HOLE) -> bool:
    """Whether views go all round, so that every line is met from both sides.

    Args:
        angles: in radians, in any order.
        hole: that the turn may have, in radians; of few views one of a step and a half.
    """
    circle = np.sort(np.mod(angles, 2 * np.pi))
    gaps = np.diff(circle, append=circle[0] + 2 * np.pi)
    # Turns that repeat each other differ by rounding.
    steps = gaps[gaps > _SAME]
    if angles.size <= 2:
        return False
    second, widest = np.partition(gaps, -2)[-2:]
    most = _SLACK * 2 * np.pi / max(steps.size, 1)
    if second < _ALIKE * widest - _SAME:
        return bool(widest <= max(most, hole))
    holes = _REGULAR * float(np.median(steps)) if steps.size > 2 * _REGULAR else 0.0
    return bool(widest <= max(most, _WIDEST, holes) + _SAME)


def is_bridged(angles: Floats) -> bool:
    """Whether views go round with no hole but one that those beside it can stand for."""
    return is_full_turn(angles, _BRIDGED)


def passes_half(angles: Floats) -> bool:
    """Whether views go clearly further than half a turn, so that they meet some lines twice."""
    first, last = widest_hole(angles)
    return last - first < np.pi - _BRIDGED


def widest_hole(angles: Floats) -> tuple[float, float]:
    """The angles of the views beside the widest gap of a turn, in radians, the lower one first."""
    order = np.argsort(np.mod(angles, 2 * np.pi), kind="stable")
    circle = np.mod(angles, 2 * np.pi)[order]
    gaps = np.diff(circle, append=circle[0] + 2 * np.pi)
    before = int(np.argmax(gaps))
    first = float(angles[order[before]])
    return first, first + float(gaps[before])


def is_offset(scan: Parallel | Fan) -> bool:
    """Whether a turn's axis lies so far from the detector's middle that it sees further.

    Parallel views may have a hole that others bridge, those of a fan go all round.
    """
    turn = is_bridged if isinstance(scan, Parallel) else is_full_turn
    return turn(scan.angles) and sees_further(scan.center, scan.bins)


def sees_further(center: float, bins: int) -> bool:
    """Whether a detector reaches much further on one side of the axis, and beyond it on both."""
    short, long = sorted((center, bins - 1 - center))
    return 0 < short < _OFFSET * long


def seen_bins(scan: Parallel | Fan) -> int:
    """Bins of a detector that reaches to the farther end on both sides of a scan's axis."""
    return scan.bins + _missing(scan)


def is_uneven(center: float, bins: int) -> bool:
    """Whether lines next to the ends of a detector are seen on one side of the axis alone."""
    short, long = sorted((center, bins - 1 - center))
    return short > 0 and long - short > _EVEN


def weighed_share(center: float, bins: int) -> float:
    """The share of the shorter side, from its end on, within which weights go over to 0 and 2.

    Args:
        center: bin of the axis, on the detector.
        bins: of the detector.
    """
    short = min(center, bins - 1 - center)
    if sees_further(center, bins):
        return 1.0
    return min(max(_FEWEST_BINS / short, _SHARE), 1.0)


def displaced_detector(away: Floats, share: float = 1.0) -> Floats:
    """Weights of a full turn whose detector reaches further on one side of the axis.

    Args:
        away: (bins,) fan angles in radians, or places of parallel rays; ascending, the axis at 0.
        share: of the shorter side, from its end on, within which weights leave 1. They are Wang's
            with the whole of it.

    Returns:
        (bins,) weights from 0 to 2, which add up to 2 for the two rays of a line, and are 2 for
        rays of lines that are measured once.
    """
    short = min(-away[0], away[-1])
    phase = (away if away[-1] > -away[0] else -away) / short
    rises = np.clip((np.abs(phase) - (1 - share)) / share, 0, 1)
    # Level where it begins, but for Wang's, which passes through the axis on a slope.
    rise = np.sin(np.pi / 2 * rises) ** (1 if share == 1 else 2)
    weights: Floats = 1 + np.sign(phase) * rise
    return weights


def offset_weights(scan: Parallel) -> Floats:
    """Weight of each bin of a full turn with an axis off the middle.

    Returns:
        (bins,) weights that add up to two for opposite bins, t and -t, that both exist, and are
        two where only one does: a full turn's views count half, as each direction comes twice.

    Raises:
        InputError: the axis is not on the detector.
    """
    if not min(scan.center, scan.bins - 1 - scan.center) > 0:
        raise InputError(
            f"the rotation axis is at bin {scan.center:g}, off a detector of {scan.bins} bins: "
            "opposite views do not overlap"
        )
    share = weighed_share(scan.center, scan.bins)
    return displaced_detector(np.arange(scan.bins, dtype=np.float64) - scan.center, share)


def shows_both_sides(scan: Parallel) -> bool:
    """Whether opposite views show what the shorter side of the detector lacks."""
    return is_uneven(scan.center, scan.bins) and (is_full_turn(scan.angles) or is_offset(scan))


def is_weighed(scan: Parallel) -> bool:
    """Whether filtered backprojection weighs a scan itself, as of one that ``widened`` did not.

    A full turn whose sides differ by a bin or less is taken as it is: ``widened`` leaves such.
    """
    return shows_both_sides(scan) and abs(_right_over_left(scan)) > 1


def widened(projections: Stack, scan: Parallel) -> tuple[Stack, Parallel]:
    """Weigh a full turn with an axis off the middle and continue its shorter side by zeros.

    ``fbp`` does so itself; this is for what else takes views of half a turn and the like.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin).
        scan: its geometry.

    Returns:
        Projections as wide as twice the longer side, and their geometry, from which filtered
        backprojection knows what each view stands for.
    """
    wide, before = widened_scan(scan)
    after = wide.bins - scan.bins - before
    weighted = np.asarray(projections, np.float32) * offset_weights(scan).astype(np.float32)
    margins = [(0, 0)] * (weighted.ndim - 1) + [(before, after)]
    return np.pad(weighted, margins), wide


def widened_scan(scan: Parallel) -> tuple[Parallel, int]:
    """The scan of a detector as wide as twice the longer side, and how many bins come before.

    Of an offset axis views are ``OwnSideViews``.
    """
    missing = _missing(scan)
    before = missing if _right_over_left(scan) > 0 else 0
    bins = scan.bins + missing
    kind = OwnSideViews if is_offset(scan) else Parallel
    return kind(scan.angles, bins, scan.pitch, scan.center + before), before


def _missing(scan: Parallel | Fan) -> int:
    """Bins that the shorter side of a detector lacks of the longer one."""
    return int(np.ceil(abs(_right_over_left(scan))))


def _right_over_left(scan: Parallel | Fan) -> float:
    """Bins that a detector has after the axis beyond those before it."""
    return scan.bins - 1 - scan.center - scan.center
