"""Adam on the host, for the few numbers of a view's pose.

Each view has its own count of steps, since only the view that was looked at has a gradient.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_BETA1, _BETA2, _EPSILON = 0.9, 0.999, 1e-12


class HostAdam:
    """Moments of (V, ...) numbers, one row of which moves at a time."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.first, self.second = np.zeros(shape), np.zeros(shape)
        self.counts = np.zeros(shape[0])

    def step(self, row: int, gradient: Floats, rate: Floats | float) -> Floats:
        """What is to be taken away from a row; a gradient that is not finite moves nothing."""
        if not np.isfinite(gradient).all():
            return np.zeros_like(gradient)
        self.counts[row] += 1
        self.first[row] = _BETA1 * self.first[row] + (1 - _BETA1) * gradient
        self.second[row] = _BETA2 * self.second[row] + (1 - _BETA2) * gradient**2
        mean = self.first[row] / (1 - _BETA1 ** self.counts[row])
        spread = np.sqrt(self.second[row] / (1 - _BETA2 ** self.counts[row]))
        return np.asarray(rate * mean / (spread + _EPSILON))

    def state(self) -> dict[str, Floats]:
        """What a checkpoint keeps."""
        return {"first": self.first, "second": self.second, "counts": self.counts}

    def restore(self, state: Mapping[str, Floats]) -> None:
        """Go on from a checkpoint."""
        self.first, self.second, self.counts = (
            np.array(state[name]) for name in ("first", "second", "counts")
        )
