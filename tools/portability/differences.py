"""How far the arrays of two runs of the families are apart, family by family."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from portability.problems import Arrays

# What rounding explains: the most that a right driver was seen to differ by is a third of this.
BOUND = 1e-4
_BOUNDS = {"double": 1e-12, "sorting": 0.0}


class Difference(NamedTuple):
    """The worst array of a family.

    Args:
        relative: L2 norm of the difference over that of the reference; 0 where all bits are equal.
        array: which one it is.
    """

    relative: float
    array: str


def worst(reference: Arrays, found: Arrays) -> Difference:
    """The array of a family that differs most; infinitely where one is missing or not finite."""
    differences = [
        Difference(_relative(reference.get(name), found.get(name)), name)
        for name in sorted(reference.keys() | found.keys())
    ]
    return max(differences, default=Difference(0.0, ""))


def bound(family: str) -> float:
    """The largest relative difference with which a family passes."""
    return _BOUNDS.get(family, BOUND)


def _relative(reference: np.ndarray | None, found: np.ndarray | None) -> float:
    if reference is None or found is None or reference.shape != found.shape:
        return np.inf
    if np.array_equal(reference, found, equal_nan=True):
        return 0.0
    wanted, given = reference.astype(float).ravel(), found.astype(float).ravel()
    relative = np.linalg.norm(given - wanted) / (np.linalg.norm(wanted) or 1)
    return float(relative) if np.isfinite(relative) else np.inf
