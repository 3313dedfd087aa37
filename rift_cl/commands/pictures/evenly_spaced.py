"""An evenly spaced subset, for pictures and estimates."""

from __future__ import annotations

import numpy as np


def evenly(count: int, few: int) -> list[int]:
    """At most ``few`` numbers from 0 to ``count`` - 1, the first and the last among them."""
    places = np.unique(np.linspace(0, count - 1, few).round().astype(int))
    return [int(place) for place in places]
