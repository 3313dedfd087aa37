"""Numbers of a file of splats that look like scales and opacities themselves.

Files hold logarithms of scales and logits of opacities. Where a program wrote the scales as they
are, splats a hundredth of a unit wide become wider than one unit, and the scene a fog; where it
wrote opacities, none is more transparent than a half. Either may be meant, and is only doubted.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[np.float32]]

# Fewer splats tell nothing.
_FEWEST = 100
# How many times wider than they lie apart splats are where all of them overlap.
_FOG = 5.0
# Opacities as such are seldom without one near to each end.
_FAINT, _SOLID = 0.1, 0.9


def doubt_activations(path: Path, arrays: Arrays) -> None:
    """Warn where scales or opacities of a scene of photographs seem to be stored as they are.

    Args:
        path: the file, for what is said of it.
        arrays: the scene's, by their names: ``means`` (N, 3), ``log_scales`` (N, 3) and
            ``logit_opacities`` (N,), all of them finite.
    """
    if len(arrays["means"]) < _FEWEST:
        return
    if _are_scales(arrays["means"], arrays["log_scales"]):
        warnings.warn(
            f"{path}: every splat is wider than 1 unit along each axis, and {_FOG:g} times wider "
            "than they lie apart: if scale_0, scale_1 and scale_2 are the scales themselves, "
            "write their natural logarithms",
            stacklevel=2,
        )
    if _are_opacities(arrays["logit_opacities"]):
        warnings.warn(
            f"{path}: every splat has an opacity from 0.5 to 0.73, by numbers from 0 to 1: if "
            "these are the opacities themselves, write their logits, ln(p / (1 - p))",
            stacklevel=2,
        )


def _are_scales(means: NDArray[np.float32], stored: NDArray[np.float32]) -> bool:
    if stored.min() <= 0:
        return False
    places = means.astype(np.float64)
    size = np.median(np.linalg.norm(places - np.median(places, axis=0), axis=1))
    # How far apart splats are that fill a volume; on a surface they are nearer to each other.
    apart = size / len(means) ** (1 / 3)
    return bool(np.exp(float(np.median(stored))) > _FOG * apart)


def _are_opacities(stored: NDArray[np.float32]) -> bool:
    low, high = float(stored.min()), float(stored.max())
    return 0 <= low < _FAINT and _SOLID < high <= 1
