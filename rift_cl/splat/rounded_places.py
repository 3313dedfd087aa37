"""Places of splats that are given in more digits than float32 has, as surveys write them.

Metres of a map are millions, between which float32 has steps of a quarter: splats of a few
centimetres would be moved by several times their width. Such a scene is refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError

# How far rounding may move a splat: in its own widths, and as a share of the scene's size, below
# which nobody sees it of any splat. One splat in so many may be moved farther.
_WIDTHS, _SIZES, _FEW = 0.1, 1e-4, 100


def distances_moved(given: NDArray[np.floating], means: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far (N,) rounding moves places (N, 3) to ``means``; NaN where one is no number."""
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.linalg.norm(given - means.astype(np.float64), axis=1)
        return np.asarray(apart, np.float32)


def check_rounding(
    where: str,
    moved: NDArray[np.float32],
    means: NDArray[np.float32],
    log_scales: NDArray[np.float32],
    *,
    error: type[InputError] = InputError,
) -> None:
    """Check that float32 holds the places of splats.

    Args:
        where: what an error names first.
        moved: (N,) how far rounding moved each; NaN and infinity where a place is no number.
        means: (N, 3) the rounded places.
        log_scales: (N, 3) logarithms of standard deviations.
        error: what is raised.

    Raises:
        InputError: or what ``error`` says: more than one splat in 100 is moved by more than a tenth
            of its largest standard deviation and by more than 1e-4 of the scene's size.
    """
    known = np.isfinite(moved)
    moved, means = moved[known], means[known].astype(np.float64)
    if not moved.any():
        return
    middle = np.median(means, axis=0)
    size = np.median(np.linalg.norm(means - middle, axis=1))
    widest = log_scales[known].max(axis=1)
    # By logarithms: a width that no float holds is wide enough.
    with np.errstate(divide="ignore", invalid="ignore"):
        visible = (np.log(moved / _WIDTHS) > widest) & (moved > _SIZES * size)
    count = np.count_nonzero(visible)
    if count * _FEW > len(moved):
        shown = ", ".join(f"{value:.0f}" for value in middle)
        raise error(
            f"{where}: the splats lie up to {np.abs(means).max():.3g} from the origin, where "
            f"float32 is too coarse: it would move {count} of {len(moved)} by more than a tenth of "
            f"their width, up to {moved.max():.2g} units: subtract ({shown}) from all positions, "
            "and from those of the cameras"
        )
