"""Full turns with the rotation axis near one end of the detector, which sees nearly twice as far.

Over a full turn every line is met twice, from opposite sides, at t and at -t. Where the detector
reaches further on one side than on the other, lines near the axis are met twice and those beyond
once. Weights w(t) that go smoothly from 0 to 1 across the part that is met twice, with
``w(t) + w(-t) = 1``, count every line once (Wang, X-ray micro-CT with a displaced detector array,
Medical Physics 29, 1634, 2002; for parallel rays without its cosine factors). Views and weights
are then those of two half turns that look past each other, and filtered backprojection of the
longer half, continued by zeros, is right to its far end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Fan, Parallel

Floats = NDArray[np.float64]
Stack = NDArray[np.float32]

# An axis counts as offset where the shorter side is below this share of the longer.
_OFFSET = 0.8
# A full turn may lack as much of it as this many steps between views, or this angle: a view or
# two that were lost, and the jitter of a turntable, leave it what it is.
_SLACK, _HOLE = 1.5, np.pi / 36
# Angles closer than this are the same, in radians.
_SAME = 1e-6


def is_full_turn(angles: Floats) -> bool:
    """Whether views go all round, so that every line is met from both sides."""
    circle = np.sort(np.mod(angles, 2 * np.pi))
    gaps = np.diff(circle, append=circle[0] + 2 * np.pi)
    # Turns that repeat each other differ by rounding.
    distinct = max(int(np.count_nonzero(gaps > _SAME)), 1)
    return angles.size > 2 and bool(gaps.max() <= max(_SLACK * 2 * np.pi / distinct, _HOLE))


def is_offset(scan: Parallel | Fan) -> bool:
    """Whether a full turn's axis lies so far from the detector's middle that it sees further."""
    return is_full_turn(scan.angles) and sees_further(scan.center, scan.bins)


def sees_further(center: float, bins: int) -> bool:
    """Whether a detector reaches much further on one side of the axis, and beyond it on both."""
    short, long = sorted((center, bins - 1 - center))
    return 0 < short < _OFFSET * long


def offset_weights(scan: Parallel) -> Floats:
    """Weight of each bin of a full turn with an offset axis.

    Returns:
        (bins,) weights that add up to two for opposite bins, t and -t, that both exist, and are
        two where only one does: a full turn's views count half, as each direction comes twice.

    Raises:
        InputError: the axis is not on the detector.
    """
    t = np.arange(scan.bins) - scan.center
    short = min(scan.center, scan.bins - 1 - scan.center)
    if not short > 0:
        raise InputError(
            f"the rotation axis is at bin {scan.center:g}, off a detector of {scan.bins} bins: "
            "opposite views do not overlap"
        )
    away = t if scan.bins - 1 - scan.center > scan.center else -t
    phase = np.clip(away / short, -1, 1)
    weights: Floats = 1 + np.sin(np.pi / 2 * phase)
    return weights


def widened(projections: Stack, scan: Parallel) -> tuple[Stack, Parallel]:
    """Weigh a full turn with an offset axis and continue its shorter side by zeros.

    Args:
        projections: line integrals, (angle, bin) or (angle, row, bin).
        scan: its geometry.

    Returns:
        Projections as wide as twice the longer side, and their geometry.
    """
    left, right = scan.center, scan.bins - 1 - scan.center
    missing = int(np.ceil(abs(right - left)))
    before, after = (missing, 0) if right > left else (0, missing)
    weighted = np.asarray(projections, np.float32) * offset_weights(scan).astype(np.float32)
    margins = [(0, 0)] * (weighted.ndim - 1) + [(before, after)]
    wide = Parallel(scan.angles, scan.bins + missing, scan.pitch, scan.center + before)
    return np.pad(weighted, margins), wide
