"""Splats of a file that can be drawn; those with numbers that are none are left out, and counted.

Fits of other programs leave a few of them behind, which viewers skip. A splat is drawn where each
of its numbers is finite, and so are the squares of its scales and the sum of its harmonics: what
the device makes of them in float32 is NaN or infinite otherwise, and the splat black or invisible.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import NonFiniteError
from rift_cl.splat.settings import SplatMode

Arrays = dict[str, NDArray[np.float32]]

_LARGEST = float(np.finfo(np.float32).max)
# Values up to which numbers can be drawn with, where that is less than the largest there is: half
# its logarithm, and its share of up to 36 coefficients times basis functions of up to 7.
_BOUNDS = {"log_scales": np.log(_LARGEST) / 2, "sh": _LARGEST / 256}
# What ``log_scales_of`` makes of a scale of 0.
_FLAT = np.log(np.finfo(np.float32).tiny)
# What belongs to the scene as a whole.
_SHARED = ("environment",)


def whole_splats(path: Path, mode: SplatMode, arrays: Arrays) -> Arrays:
    """The arrays of a scene without the splats that cannot be drawn, which a warning counts.

    Args:
        path: the file, for what is said of it.
        mode: what the strengths are. Infinite logits are opacities of 0 and 1, which some programs
            write so; they become the nearest numbers.
        arrays: the scene's, by their names; (N, ...) but for the environment light. Logarithms of
            scales of minus infinity are those of 0, of flat splats; they become that of the
            smallest normal number.

    Raises:
        NonFiniteError: more than half of the splats cannot be drawn.
    """
    scales = arrays["log_scales"]
    scales[np.isneginf(scales)] = _FLAT
    if mode == "light":
        logits = arrays["logit_opacities"]
        np.clip(logits, -_LARGEST, _LARGEST, out=logits)
    own = {name: array for name, array in arrays.items() if name not in _SHARED}
    broken = {name: _broken(name, array) for name, array in own.items()}
    without = np.logical_or.reduce(list(broken.values()))
    count = np.count_nonzero(without)
    if not count:
        return arrays
    what = ", ".join(name for name, found in broken.items() if found.any())
    words = (
        f"{path}: {count} of {without.size} splats cannot be drawn, since numbers of theirs are "
        f"not finite in float32 ({what})"
    )
    if 2 * count > without.size:
        raise NonFiniteError(f"{words}: the file is damaged, or of a fit that failed")
    warnings.warn(f"{words}: they are left out", stacklevel=2)
    return arrays | {name: array[~without] for name, array in own.items()}


def _broken(name: str, array: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which splats have a number in an array that cannot be drawn with; NaN is no number."""
    rows = array.reshape(len(array), math.prod(array.shape[1:]))
    most = _BOUNDS.get(name, _LARGEST)
    least = -_LARGEST if name == "log_scales" else -most
    inside: NDArray[np.bool_] = (rows.min(1, initial=0) >= least) & (rows.max(1, initial=0) <= most)
    return ~inside
