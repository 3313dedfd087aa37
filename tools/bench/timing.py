"""Wall-clock times on a machine that others may be using.

Noise only ever adds time, so the minimum is the figure to compare; the median says how noisy the
run was. Both are kept, and so is every raw number.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")


def timed(run: Callable[[], T]) -> tuple[float, T]:
    """Seconds that a call took, and what it returned."""
    start = time.perf_counter()
    result = run()
    return time.perf_counter() - start, result


def summary(seconds: Sequence[float]) -> dict[str, float | list[float]]:
    """Minimum, median and the raw times, as they stand in the JSON file."""
    return {
        "min_s": min(seconds),
        "median_s": statistics.median(seconds),
        "raw_s": [round(value, 7) for value in seconds],
    }
